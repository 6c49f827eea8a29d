"""Terminal output: text as it is, whatever is in it, and progress bars."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from rich.progress import Progress

T = TypeVar("T")

_UNBOUNDED = 10_000  # columns: no line of a table is cut or wrapped in a file or a pipe


def plain_console(stderr: bool = False) -> Console:
    """A console that takes no text, such as a user's name of a robot, for markup or emoji."""
    console = Console(stderr=stderr, markup=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _UNBOUNDED
    return console


def table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1, **look: Any
) -> Table:
    """A table, its first ``left`` columns aligned to the left; ``look`` is of rich's ``Table``.

    It folds a word rather than leave its end out, however narrow the terminal is.
    """
    made = Table(title=title, **look)
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i < left else "right", overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def figures_table(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """A table of figures, each with its name."""
    return table(title, ("", ""), rows, show_header=False)


def show(*tables: Table, lines: Iterable[str] = ()) -> None:
    """Print tables and, below them, lines on standard output."""
    console = plain_console()
    for shown in tables:
        console.print(shown)
    for line in lines:
        console.print(line, highlight=False)


def report(as_json: bool, data: Any, *tables: Table, lines: Iterable[str] = ()) -> None:
    """Print data as one JSON object, or :func:`show` tables and lines."""
    if as_json:
        print(json.dumps(data))
    else:
        show(*tables, lines=lines)


def bar(console: Console, note: str = "", **options: Any) -> Progress:
    """Progress bar of tasks that are counted; ``options`` are :class:`rich.progress.Progress`'s.

    ``note`` is rich's format of a text after the count, such as ``{task.fields[failed]} failed``.
    """
    # Here, so that nobody who only asks for help waits for it.
    from rich import progress

    return progress.Progress(
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        *([progress.TextColumn(note)] if note else []),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
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
