"""Compilation ahead of use, by as many processes as there are cores."""

from __future__ import annotations

import gc
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from pkgutil import resolve_name
from typing import NamedTuple

from template_control.compiled import cache_folder
from template_control.terminal import plain_console

ANNOUNCEMENT = "compiling once"
"""Of a compilation, on the standard error."""
_LOG = logging.getLogger("template_control")
_MOST_PROCESSES = 4  # more would wait for the longest part
_NOTICE = 1.0  # [s] of compilation that is not announced
_LOOK_AGAIN = 0.05  # [s]


class Part(NamedTuple):
    """Compiled functions that are made ready together.

    ``run``, a function of a module, calls them with arguments of the types they are used with;
    ``seconds`` is how long compiling took on the machine where all were measured [s].
    """

    run: Callable[[], object]
    seconds: float

    @property
    def name(self) -> str:
        """``module:function``."""
        return f"{self.run.__module__}:{self.run.__qualname__}"

    @property
    def done(self) -> bool:
        """True if a process has compiled it and kept the machine code."""
        folder = cache_folder()
        return folder is not None and self._mark(folder).exists()

    def compile(self) -> None:
        """Compile it, or load what is kept."""
        self.run()
        folder = cache_folder()
        if folder is not None:
            with suppress(OSError):  # then the next process does it again
                self._mark(folder).touch()

    def _mark(self, folder: Path) -> Path:
        return folder / f"{self.name.replace(':', '.')}.ready"


_READY: set[Part] = set()


def ready(parts: Sequence[Part]) -> None:
    """Have all compiled that ``parts`` call: afterwards a call of it compiles and loads nothing.

    What is called by another part comes after that one. Announces on the standard error what takes
    longer than a second, once.
    """
    wanted = [part for part in parts if part not in _READY]
    missing = [part for part in wanted if not part.done]
    collects = gc.isenabled()
    gc.disable()  # Numba's many objects would cost Python's collector a fifth of the time
    try:
        _compile(missing)
        for part in wanted:
            part.compile()
            _READY.add(part)
    finally:
        if collects:
            gc.enable()


class _Report:
    """One line on the standard error: what is compiled, and how long it will still take."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts = parts
        self._console = plain_console(stderr=True)
        self._begin = time.monotonic()
        self._whole = sum(part.seconds for part in parts)
        self._shown = False

    def show(self) -> None:
        """Show the share that is done; in a file or pipe once."""
        if self._whole < _NOTICE or (self._shown and not self._console.is_terminal):
            return
        if not self._shown:
            _LOG.info("compiling %d parts of the library once", len(self._parts))
        self._shown = True
        done = sum(part.seconds for part in self._parts if part.done)
        text = ANNOUNCEMENT
        if done:
            left = (time.monotonic() - self._begin) * (self._whole / done - 1.0)
            text += f": {done / self._whole:.0%}, about {left:.0f} s left"
        if self._console.is_terminal:
            # In place, but no live display: a command may show one of its own.
            self._console.print(f"{text:60}", end="\r", highlight=False)
        else:
            self._console.print(text, highlight=False)

    def clear(self) -> None:
        """Remove the line, where it was in a terminal."""
        if self._shown and self._console.is_terminal:
            self._console.print(" " * 60, end="\r")


def _compile(parts: Sequence[Part]) -> None:
    """Compile parts, each in one of several processes; this one compiles the first of them."""
    report = _Report(parts)
    report.show()
    own, *others = _shares(parts, _processes())
    helpers = [_helper(share) for share in others]
    try:
        for part in own:
            part.compile()
            report.show()
        while any(helper.poll() is None for helper in helpers):
            time.sleep(_LOOK_AGAIN)
            report.show()
    finally:
        for helper in helpers:
            with helper:
                helper.kill()  # it has nothing left to do, or is not wanted any more
        report.clear()


def _shares(parts: Sequence[Part], count: int) -> list[list[Part]]:
    """The parts, in their order, in shares that take about as long as one another."""
    shares: list[list[Part]] = [[]]
    whole = sum(part.seconds for part in parts)
    begun = 0.0
    for part in parts:
        if shares[-1] and begun + part.seconds / 2 > whole * len(shares) / count:
            shares.append([])
        shares[-1].append(part)
        begun += part.seconds
    return shares


def _processes() -> int:
    """Processes that may compile side by side."""
    if cache_folder() is None or getattr(sys, "frozen", False):
        return 1  # they could not hand over what they compile; or there is no interpreter
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    return min(cores, _MOST_PROCESSES)


def _helper(parts: Sequence[Part]) -> subprocess.Popen[bytes]:
    """A process that compiles parts, from the same modules as this one."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", __name__, *(part.name for part in parts)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )


def _end_with_the_parent() -> None:
    """End this process as soon as its standard input is closed."""
    sys.stdin.buffer.read()
    os._exit(0)


def _help(names: Sequence[str]) -> None:
    """Compile the parts of these names."""
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    gc.disable()  # this process ends before it is worth it
    for name in names:
        Part(resolve_name(name), 0.0).compile()


if __name__ == "__main__":
    _help(sys.argv[1:])
