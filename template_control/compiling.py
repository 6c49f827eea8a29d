"""What is said while functions are compiled, the first time after a change of the code."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

_LOG = logging.getLogger("template_control")
_QUIET = 1.0  # [s] of compiling that nobody is told of
_USUAL = 95  # functions that are compiled before a first walk, one for each type of its arguments
_ROUNDING = 5.0  # [s] of the time that is foretold


class Teller:
    """Counts the functions this process compiles, and tells of them once they take long.

    Attributes:
        console: where to; with None only the logger "template_control" is told, level INFO.
        done: functions compiled.
        kept: those of them that were written to the cache.
    """

    def __init__(self) -> None:
        self.console: Console | None = None
        self.done = self.kept = 0
        self._hands = 1
        self._others: Callable[[], int] = lambda: 0
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
        self.done += 1
        self._pause()

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """While this lasts, the process waits for what another one compiles."""
        self.begin()
        try:
            yield
        finally:
            self._pause()

    @contextmanager
    def helped(self, hands: int, others: Callable[[], int]) -> Iterator[None]:
        """While this lasts, other processes compile too.

        Args:
            hands: processes that compile, this one included.
            others: gives the number of functions that the others have compiled.
        """
        self._hands, self._others = hands, others
        try:
            yield
        finally:
            self.done += others()
            self._hands, self._others = 1, lambda: 0

    def look(self) -> None:
        """Tell how far it is, if it takes long."""
        spent = self._before + (time.monotonic() - self._begin if self._depth else 0.0)
        if spent > _QUIET:
            self._tell(spent)

    def _pause(self) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._before += time.monotonic() - self._begin
        self.look()

    def clear(self) -> None:
        """Take the line away again, where it was in a terminal."""
        if self._text and self.console is not None and self.console.is_terminal:
            self.console.print(" " * (self.console.width - 1), end="\r")

    def _tell(self, spent: float) -> None:
        done = max(self.done + self._others(), 1)
        share = min(done / _USUAL, 1.0)
        first = not self._text
        if first:
            expected = _ROUNDING * max(round(spent / share / self._hands / _ROUNDING), 1)
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
