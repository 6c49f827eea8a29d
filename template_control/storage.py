"""Files that are written whole or not at all, and records kept in them.

A record is a ``.npz`` with one array a field and the metadata as JSON.
"""

from __future__ import annotations

import json
import numbers
import os
import shutil
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from filelock import lock_descriptor, unlock_descriptor

from template_control.errors import RecordError, TemplateControlError

T = TypeVar("T")


def to_jsonable(value: Any, describe: Callable[[Any], Any] | None = None) -> Any:
    """A value as JSON keeps it, so that what is read back equals it.

    Numbers of NumPy become Python's, arrays and tuples lists, keys of mappings texts. ``describe``
    makes one of these of any other value; without it that is a TypeError.
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return to_jsonable(value.tolist(), describe)
    if isinstance(value, str):
        return str(value)  # of an enumeration's member, what JSON writes
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    if isinstance(value, list | tuple):
        return [to_jsonable(entry, describe) for entry in value]
    if isinstance(value, Mapping):
        return {str(key): to_jsonable(entry, describe) for key, entry in value.items()}
    if describe is not None:
        return to_jsonable(describe(value), describe)
    raise TypeError(
        f"a {type(value).__name__} is no plain data: give numbers, texts, arrays, or lists and"
        " dictionaries of them"
    )


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Path at which to write a file, so that the old one is replaced by a whole one or stays.

    The file takes its name at the end of the ``with`` block, and is removed if an error ends it; an
    OSError becomes a RecordError. A link keeps its target; a device is written directly.
    """
    target = Path(os.path.realpath(path))
    partial = target.with_name(f".part-{uuid.uuid4().hex[:12]}{target.suffix}")
    device = False
    try:
        if target.exists() and not (target.is_file() or target.is_dir()):
            device, partial = True, target
        if target.is_dir() or (target.exists() and not os.access(target, os.W_OK)):
            target.open("ab").close()  # which raises what is the matter with it
        partial.touch()
        yield partial
        if not device:
            with partial.open("rb+") as file:
                os.fsync(file.fileno())  # some file systems notice only now that they are full
            if target.exists():
                shutil.copymode(target, partial)
            partial.replace(target)
    except OSError as error:
        raise RecordError(
            f"cannot write {path}: {error.strerror or error}; make room, or give another place"
        ) from None
    finally:
        if not device:
            with suppress(OSError):
                partial.unlink(missing_ok=True)


class Files:
    """Writes files, so that a command's table is printed whatever becomes of them."""

    def __init__(self) -> None:
        self._trouble: TemplateControlError | KeyboardInterrupt | None = None

    def write(self, write: Callable[[], T]) -> T | None:
        """Call ``write``; None where it fails, or Ctrl-C came before or meanwhile."""
        if isinstance(self._trouble, KeyboardInterrupt):
            return None
        try:
            return write()
        except TemplateControlError as error:
            self._trouble = self._trouble or error
        except KeyboardInterrupt:
            self._trouble = KeyboardInterrupt("interrupted: not all files are written")
        return None

    def raise_pending(self) -> None:
        """Raise what went wrong (an error or a Ctrl-C), once the table is printed."""
        if self._trouble is not None:
            raise self._trouble


def save(record: Any, path: str | Path, kind: str, quick: bool = False) -> Path:
    """Write a dataclass of arrays with a ``metadata`` dictionary as a ``.npz`` of a ``kind``."""
    arrays = {f.name: getattr(record, f.name) for f in fields(record) if f.name != "metadata"}
    text = json.dumps({"format": kind, **record.metadata})
    write = np.savez if quick else np.savez_compressed
    with atomic_path(path) as place, place.open("wb") as file:
        write(file, metadata=np.array(text), **arrays)
    return Path(path)


def load(
    record_type: Callable[..., T],
    path: str | Path,
    kind: str,
    layout: Mapping[str, str],
    metadata: Mapping[str, tuple[type, ...]],
) -> T:
    """Record that :func:`save` wrote with the same ``kind``; a RecordError says what is wrong.

    ``layout`` has by name the sizes of each field's axes, such as "T nv 2": a letter is the same
    number in all fields, "S+1" one more than "S". A last word "<nodes" says that it holds indices
    into ``metadata["nodes"]``, "<2" that they are below 2. ``metadata`` are types by entry.
    """
    try:
        values = _values(path, kind)
        _check(values, layout, metadata)
    except FileNotFoundError:
        raise RecordError(f"there is no run at {path}: give a run.npz") from None
    except _NoRecordError as error:
        raise RecordError(
            f"{path} is no recorded run ({error}): give a run.npz of this library"
        ) from None
    return record_type(**{name: values[name] for name in (*layout, "metadata")})


class _NoRecordError(Exception):
    """Reason why a file is no record."""


def _values(path: str | Path, kind: str) -> dict[str, Any]:
    """The fields by name, and the metadata."""
    name = "it"
    values: dict[str, Any] = {}
    try:
        with np.load(path, allow_pickle=False) as data:
            for name in data.files:
                values[name] = data[name]
        name = "metadata"
        values[name] = json.loads(str(values[name]))
        found = str(values[name].pop("format", ""))
    except FileNotFoundError:
        raise
    except KeyError as error:
        raise _NoRecordError(f"it lacks {error.args[0]}") from None
    except Exception as error:  # a damaged file has any of a dozen
        # NumPy's own words for what is no array advise to load it unsafely.
        known = isinstance(error, json.JSONDecodeError) or not isinstance(error, ValueError)
        reason = str(error) if known else "it holds no arrays of numbers"
        raise _NoRecordError(f"{name} cannot be read: {reason}") from None
    if found != kind:
        if found.rpartition(" ")[0] == kind.rpartition(" ")[0]:
            raise RecordError(
                f"{path} was written by another version of this library ({found!r}, not"
                f" {kind!r}): record it anew"
            )
        raise _NoRecordError("its metadata tells another format")
    return values


def _check(
    values: Mapping[str, Any], layout: Mapping[str, str], kinds: Mapping[str, tuple[type, ...]]
) -> None:
    metadata = values["metadata"]
    for name, types in kinds.items():
        if not isinstance(metadata.get(name), types):
            raise _NoRecordError(f"its metadata has no {name}, or another kind of it")
    sizes: dict[str, int] = {}
    for name, text in layout.items():
        if name not in values:
            raise _NoRecordError(f"it lacks {name}")
        *axes, bound = text.split() if "<" in text else (*text.split(), "")
        array = values[name]
        if array.dtype.kind not in ("iu" if bound else "fiub"):
            raise _NoRecordError(f"{name} holds {array.dtype} and not numbers as it should")
        wanted = _wanted(axes, array.shape, sizes)
        # Of nothing, numpy does not know how wide it is.
        if array.shape != wanted and not (array.size == 0 and array.shape[:1] == wanted[:1]):
            raise _NoRecordError(f"{name} has the shape {array.shape} and not {wanted}")
        if bound and array.size:
            end = bound.removeprefix("<")
            limit = int(end) if end.isdigit() else len(metadata[end])
            if array.min() < 0 or array.max() >= limit:
                raise _NoRecordError(f"{name} holds indices that are not from 0 to {limit - 1}")


def _wanted(axes: Sequence[str], shape: tuple[int, ...], sizes: dict[str, int]) -> tuple[int, ...]:
    """The shape that a field is to have; a letter met for the first time is what it is here."""
    wanted = []
    for i, axis in enumerate(axes):
        letter, _, more = axis.partition("+")
        if not letter.isdigit() and i < len(shape):
            sizes.setdefault(letter, shape[i] - int(more or 0))
        wanted.append((int(letter) if letter.isdigit() else sizes.get(letter, 0)) + int(more or 0))
    return tuple(wanted)


def write_text(path: str | Path, text: str) -> Path:
    """Write a text file in UTF-8; a RecordError if it fails."""
    with atomic_path(path) as place:
        place.write_text(text, encoding="utf-8")
    return Path(path)


@contextmanager
def writing(folder: Path) -> Iterator[Path]:
    """Keep a folder for one command's files: made if need be, and locked meanwhile."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RecordError(
            f"cannot write to {folder}: {error.strerror}; give another --output"
        ) from None
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folder as a file
        descriptor = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT)
    try:
        if not take_lock(descriptor):
            raise RecordError(
                f"another command writes to {folder} now: wait for it, or give another --output"
            )
        yield folder
    finally:
        free_lock(descriptor)
        os.close(descriptor)


def take_lock(descriptor: int) -> bool:
    """Take the lock of an open file; False while another process holds it."""
    try:
        return lock_descriptor(descriptor, blocking=False)
    except OSError:
        return True


def free_lock(descriptor: int) -> None:
    """Free a lock, if there is one; closing would not do, as processes forked meanwhile have it."""
    with suppress(OSError):
        unlock_descriptor(descriptor)
