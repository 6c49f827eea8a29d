"""Compiled code made ready before it is needed, by as many processes as there are cores.

A *part* is a function without arguments that calls compiled ones. Whoever needs parts that the
cache lacks starts helpers, one for each further core; each process takes the next part that
nobody has taken, and all find the machine code in the shared cache. The same goes for processes
that start at the same time by themselves, as those of a test run.
"""

from __future__ import annotations

import gc
import importlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

import numba
from numba.core.registry import cpu_target

from template_control.code_cache.source_stamp import stamp
from template_control.compiled import cache_folder, lock_folder, packages_of, uncollected
from template_control.compiling import TELLER
from template_control.file_lock import LOCKS, FileLock

Part = Callable[[], object]

_LOOK_AGAIN = 0.02  # [s]
_PATIENCE = 300.0  # [s] in which nobody finishes a part: then this process does them all
_READY: set[Part] = set()


def ready(parts: Sequence[Part]) -> None:
    """Have all compiled that ``parts`` call; afterwards calling it compiles and loads nothing.

    What one part takes from another is best compiled by that one: let it stand first. Else long
    parts stand before short ones.

    Args:
        parts: functions of modules, which a helper can import.
    """
    wanted = [part for part in parts if part not in _READY]
    if not wanted:
        return
    with uncollected():
        _share_out([part for part in wanted if cache_folder(packages_of(part))])
        for part in wanted:
            part()
            _READY.add(part)


def _share_out(parts: Sequence[Part]) -> None:
    """Return when all are done, by this process or by others."""
    missing = [part for part in parts if not _done(part)]
    if not missing:
        return
    folders = {cache_folder(packages_of(part)) for part in missing}

    def others() -> int:
        return sum(_functions(folder) for folder in folders if folder) - TELLER.kept

    before = others()
    with _helpers(missing) as helpers, TELLER.helped(1 + helpers, lambda: others() - before):
        late = time.monotonic() + _PATIENCE
        while missing and time.monotonic() < late:
            taken = next((part for part in missing if _take(part)), None)
            left = [part for part in missing if part is not taken and not _done(part)]
            if len(left) < len(missing):
                late = time.monotonic() + _PATIENCE
            else:
                with TELLER.waiting():
                    time.sleep(_LOOK_AGAIN)
            missing = left


def _functions(folder: Path) -> int:
    """How many are kept in a cache folder."""
    with os.scandir(folder) as found:
        return sum(entry.name.endswith(".nbc") for entry in found)


@cache
def _mark() -> str:
    """What Numba's cache tells machine code apart by, besides the sources."""
    code = cpu_target.target_context.codegen().magic_tuple()
    content = repr((numba.__version__, sys.implementation.cache_tag, code))
    return sha256(content.encode()).hexdigest()[:8]


def _place(part: Part, name: str) -> Path:
    """A file beside the locks of what a part compiles."""
    return lock_folder(cache_folder(packages_of(part)) or Path()) / name


def _done(part: Part) -> bool:
    return _place(part, f"{_name(part)}.{_mark()}").exists()


def _take(part: Part) -> bool:
    """Run a part that is neither done nor taken; False if it is either."""
    lock = FileLock(_place(part, _name(part)))
    if _done(part) or not lock.take():
        return False
    try:
        if _done(part):
            return False
        part()
        if stamp(packages_of(part)).holds:
            with suppress(OSError):  # then the next process does it again
                _place(part, f"{_name(part)}.{_mark()}").touch()
    finally:
        lock.release()
    return True


@contextmanager
def _helpers(parts: Sequence[Part]) -> Iterator[int]:
    """Processes that take parts, as many as there are cores for; gives their number."""
    helpers: list[subprocess.Popen[bytes]] = []
    try:
        for number in range(min(_cores(), len(parts)) - 1):
            # Processes that start together have no more helpers in all.
            helper = _helper(FileLock(_place(parts[0], f"helper-{number}")), parts)
            if helper is not None:
                helpers.append(helper)
        yield len(helpers)
    finally:
        for helper in helpers:
            with helper:
                helper.kill()  # it has nothing left to do, or is not wanted any more


def _cores() -> int:
    """That this process may use for helpers too."""
    if not LOCKS or getattr(sys, "frozen", False) or "python" not in Path(sys.executable).name:
        return 1  # nobody could tell what is taken; or there is no interpreter to start
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def _helper(slot: FileLock, parts: Sequence[Part]) -> subprocess.Popen[bytes] | None:
    """A process that finds modules where this one does; None where there shall be no more."""
    if not slot.take():
        return None
    try:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, *map(_name, parts)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            pass_fds=[slot.fileno()],
        )
    except (OSError, ValueError):
        return None
    finally:
        slot.hand_over()


def _name(part: Part) -> str:
    return f"{part.__module__}:{part.__qualname__}"


def _end_with_the_parent() -> None:
    """End this process, whatever it does, as soon as its standard input is closed."""
    sys.stdin.buffer.read()
    os._exit(0)


def _help(names: Sequence[str]) -> None:
    """Take the parts of these names that nobody has taken."""
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    gc.disable()  # this process ends before it is worth it
    for name in names:
        module, _, function = name.partition(":")
        _take(getattr(importlib.import_module(module), function))


if __name__ == "__main__":
    _help(sys.argv[1:])
