"""What is said while functions are compiled, the first time after a change of the code."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console

_LOG = logging.getLogger("template_control")
_QUIET = 1.0  # [s] of compiling that nobody is told of
_USUAL = 70  # functions that a first walk compiles, one for each type of its arguments
_ROUNDING = 5.0  # [s] of the time that is foretold


class Teller:
    """Counts the functions this process compiles, and tells of them once they take long.

    Attributes:
        console: where to; with None only the logger "template_control" is told, level INFO.
        done: functions compiled.
    """

    def __init__(self) -> None:
        self.console: Console | None = None
        self.done = 0
        self._text = ""
        self._depth = 0
        self._begin = self._before = 0.0

    def begin(self) -> None:
        """A function begins to be compiled, perhaps within another."""
        if self._depth == 0:
            self._begin = time.monotonic()
        self._depth += 1

    def end(self) -> None:
        """The function begun last is compiled, or has failed to be."""
        self._depth -= 1
        self.done += 1
        spent = self._before + time.monotonic() - self._begin
        if self._depth == 0:
            self._before = spent
        if spent > _QUIET:
            self._tell(spent)

    def clear(self) -> None:
        """Take the line away again, where it was in a terminal."""
        if self._text and self.console is not None and self.console.is_terminal:
            self.console.print(" " * (self.console.width - 1), end="\r")

    def _tell(self, spent: float) -> None:
        share = min(self.done / _USUAL, 1.0)
        first = not self._text
        if first:
            expected = _ROUNDING * max(round(spent / share / _ROUNDING), 1)
            self._text = f"compiling once, about {expected:.0f} s"
            _LOG.info(self._text)
        if self.console is None:
            return
        if self.console.is_terminal:
            # In place, but no live display: the command may be showing one of its own.
            self.console.print(f"{self._text}: {share:4.0%}", end="\r", highlight=False)
        elif first:
            self.console.print(self._text, highlight=False)


TELLER = Teller()
"""The process's: it compiles a function once."""


@contextmanager
def compiling(console: Console) -> Iterator[None]:
    """While this lasts, ``console`` is told of compiling that takes more than a second.

    One line; in a terminal it shows the share that is done. Nothing where the cache is warm.

    Args:
        console: of the standard error, so that a command's output stays clean.
    """
    TELLER.console = console
    try:
        yield
    finally:
        TELLER.clear()
        TELLER.console = None
