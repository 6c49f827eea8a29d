"""A lock between processes: who compiles what, and who may write."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

try:
    import fcntl as _fcntl
except ImportError:  # not on Windows; there every process works alone
    _fcntl = None  # type: ignore[assignment]
_flock: Any = _fcntl

_LOOK_AGAIN = 0.02  # [s]
_PATIENCE = 300.0  # [s] for one lock: its holder may be stopped, as in a debugger

LOCKS = _flock is not None
"""Whether processes can see one another's locks here."""


class FileLock:
    """Held by one process at most; the system frees it when its holder ends, however it ends.

    Where the system or the folder has no locks, everybody gets them at once: work is then done
    twice, and nobody waits for ever.

    Args:
        path: of a folder or a file, which is made if need be, with its folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: int | None = None

    def take(self) -> bool:
        """Get the lock; False if another has it."""
        if not LOCKS:
            return True
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            way = os.O_RDONLY if self.path.is_dir() else os.O_RDWR | os.O_CREAT
            file = os.open(self.path, way, 0o666)
        except OSError:
            return True
        try:
            _flock.flock(file, _flock.LOCK_EX | _flock.LOCK_NB)
        except OSError as error:
            os.close(file)
            return not isinstance(error, BlockingIOError)
        self._file = file
        return True

    def wait(self, meanwhile: Callable[[], None] | None = None) -> bool:
        """Get the lock once it is free; False if its holder keeps it for minutes.

        Args:
            meanwhile: called again and again.
        """
        late = time.monotonic() + _PATIENCE
        while not self.take():
            if time.monotonic() > late:
                return False
            if meanwhile is not None:
                meanwhile()
            time.sleep(_LOOK_AGAIN)
        return True

    def release(self) -> None:
        """Let others have it; nothing happens where it is not held."""
        if self._file is not None:
            # A process forked meanwhile has this file too: closing alone would not free it.
            _flock.flock(self._file, _flock.LOCK_UN)
            os.close(self._file)
            self._file = None

    def hand_over(self) -> None:
        """Leave the lock to the child that has inherited :meth:`fileno`."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def fileno(self) -> int:
        """Descriptor of the file, for a child to inherit.

        Raises:
            ValueError: if the lock is not held.
        """
        if self._file is None:
            raise ValueError(f"{self.path} is not locked by this process")
        return self._file


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of ``path``, after waiting for it.

    Args:
        path: see :class:`FileLock`.
    """
    lock = FileLock(path)
    lock.wait()
    try:
        yield
    finally:
        lock.release()
