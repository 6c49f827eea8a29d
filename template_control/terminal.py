"""Terminal output: text as it is, whatever is in it, and progress bars."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from rich import table
from rich.console import Console

if TYPE_CHECKING:
    from rich.progress import Progress

T = TypeVar("T")

_UNBOUNDED = 10_000  # columns: no line of a table is cut or wrapped in a file or a pipe


def plain_console(stderr: bool = False) -> Console:
    """A console that takes no text for markup or emoji.

    The names of robots, scenarios and files are a user's: ``[/b]`` or ``:bus:`` is no order.
    """
    console = Console(stderr=stderr, markup=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _UNBOUNDED
    return console


class Table(table.Table):
    """A table that folds a word rather than leave its end out, however narrow the terminal is."""

    def add_column(self, *arguments: Any, **options: Any) -> None:
        """As :meth:`rich.table.Table.add_column`."""
        super().add_column(*arguments, **{"overflow": "fold", **options})


def bar(console: Console, note: str = "", **options: Any) -> Progress:
    """Progress bar of tasks that are counted; ``options`` are :class:`rich.progress.Progress`'s.

    ``note`` is rich's format of a text after the count, such as ``{task.fields[failed]} failed``.
    """
    # Here, so that nobody who only asks for help waits for it.
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        *([TextColumn(note)] if note else []),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        **options,
    )


def counted(items: Iterable[T], total: int, text: str) -> Iterator[T]:
    """The items, once, with a progress bar on standard error; ``text`` is in front of it."""
    with bar(plain_console(stderr=True), transient=True) as progress:
        yield from progress.track(items, total=total, description=text)


@contextmanager
def progress_bar(text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """Progress bar on standard error for as long as a ``with`` block lasts.

    It gives the function that sets how much of ``total`` is done; None where the total is not
    known.
    """
    with bar(plain_console(stderr=True)) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)
