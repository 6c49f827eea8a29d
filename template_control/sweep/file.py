"""Results of a sweep on disk: JSON lines, one appended as each item finishes.

The first line names function and seed of the sweep; each further line is a finished item with its
arguments. A process killed while it writes leaves at most a torn last line, which the next one
drops.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, NoReturn

from template_control.errors import SweepError
from template_control.storage import free_lock, take_lock, to_jsonable

_FORMAT = "template-control sweep 1"


class Outcome(NamedTuple):
    """Outcome of an item: result or error.

    Attributes:
        result: as :func:`~template_control.storage.to_jsonable` makes it; None where it failed.
        error: None, or why it failed as 'TypeName: message'.
    """

    result: Any
    error: str | None


def name_of(function: Callable[..., Any]) -> str:
    """Module and qualified name; of a ``functools.partial`` its arguments too."""
    if isinstance(function, partial):
        return (
            f"{name_of(function.func)}{json.dumps(to_jsonable([function.args, function.keywords]))}"
        )
    kind = function if hasattr(function, "__qualname__") else type(function)
    return f"{kind.__module__}.{kind.__qualname__}"


class SweepFile:
    """A results file, open and locked for this process; a context manager.

    The file may have fewer or more items than ``items``, the calls' arguments; the ``function``
    counts by its name, not its code. ``finished`` are outcomes by item index; the last of an item
    counts. A SweepError if the file holds anything but this sweep, or cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        function: Callable[..., Any],
        items: Sequence[Mapping[str, Any]],
        seed: int,
    ) -> None:
        self.path = Path(path)
        self._items: list[Any] = []
        what = "the function"
        try:
            self._head = {"format": _FORMAT, "function": name_of(function), "seed": seed}
            for i, item in enumerate(items):
                what = f"item {i}"
                self._items.append(to_jsonable(item))
        except TypeError as error:
            raise SweepError(f"{what} cannot be written to a file: {error}") from None
        self.finished: dict[int, Outcome] = {}
        if self.path.exists() and not self.path.is_file():
            self._refuse("is no file")
        try:
            self._file: BinaryIO = self.path.open("a+b")
        except OSError as error:
            self._refuse(f"cannot be written ({error.strerror})")
        try:
            if not take_lock(self._file.fileno()):
                self._refuse("is being written by another sweep", "wait for that")
            self._read()
        except BaseException:
            self._close()
            raise

    def _refuse(self, why: str, mend: str = "give another path") -> NoReturn:
        raise SweepError(f"{self.path} {why}: {mend}") from None

    def _close(self) -> None:
        free_lock(self._file.fileno())
        # A full disk was reported before; closing would try the write once more.
        with suppress(OSError):
            self._file.close()

    def _read(self) -> None:
        """Read existing outcomes, truncate a torn last line, write the header of an empty file."""
        first = json.dumps(self._head).encode() + b"\n"
        self._file.seek(0)
        end = 0
        for number, line in enumerate(self._file):
            if not line.endswith(b"\n"):
                if number == 0 and not first.startswith(line):
                    self._refuse("holds no sweep")
                break
            if number == 0:
                self._compare(line)
            else:
                self._take(number, line)
            end += len(line)
        self._file.seek(end)
        self._file.truncate()
        if end == 0:
            self._write(first)

    def _compare(self, line: bytes) -> None:
        found: Any = None
        with suppress(ValueError):
            found = json.loads(line)
        if not isinstance(found, dict) or found.get("format") != _FORMAT:
            self._refuse("holds no sweep")
        for key, value in self._head.items():
            if found.get(key) != value:
                self._refuse(f"holds another sweep ({key} {found.get(key)}, not {value})")

    def _take(self, number: int, line: bytes) -> None:
        try:
            entry = json.loads(line)
            index, error = entry["index"], entry.get("error")
            known = index >= 0 and (isinstance(error, str) or "result" in entry)
        except (ValueError, KeyError, TypeError, AttributeError):
            known = False
        if not known:
            raise SweepError(
                f"{self.path} line {number + 1} is no result: delete the line, its item runs again"
            )
        if index >= len(self._items):
            return  # a longer sweep's
        item, own = (json.dumps(x, sort_keys=True) for x in (entry.get("item"), self._items[index]))
        if item != own:
            self._refuse(f"holds another sweep (another item {index})")
        self.finished[index] = Outcome(entry.get("result"), error)

    def append(self, index: int, seed: int, outcome: Outcome) -> None:
        """Append a finished item; the line is flushed to the operating system."""
        end = {"result": outcome.result} if outcome.error is None else {"error": outcome.error}
        entry = {"index": index, "item": self._items[index], "seed": seed, **end}
        self._write(json.dumps(entry).encode() + b"\n")

    def _write(self, line: bytes) -> None:
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            raise SweepError(
                f"cannot write to {self.path}: {error.strerror}; mend that and run the same sweep"
                " again, it goes on from what is there"
            ) from None

    def __enter__(self) -> SweepFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()
