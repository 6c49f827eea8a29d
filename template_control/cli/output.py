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
    """A progress bar; yields the function that sets how much is done.

    Args:
        console: where it is shown.
        text: what is going on.
        total: how much there is to do, None where nobody knows.
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
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)
