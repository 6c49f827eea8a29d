"""How commands show that they work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""


@contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Any]:
    """Show a progress bar while a ``with`` block runs.

    Args:
        console: where the bar is drawn.
        text: what is going on, in front of the bar.
        total: amount at which the bar is full, in the caller's unit; None where nobody knows.

    Yields:
        The function that sets how much is done, in the same unit.
    """
    # Here, because whoever only asks for help should not wait for it.
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)
