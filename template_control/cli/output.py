"""Where commands write, and how they show that they work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from template_control.errors import RecordError


def writable(folder: Path) -> Path:
    """The folder, made if need be.

    Raises:
        RecordError: if nothing can be written there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RecordError(
            f"cannot write to {folder}: {error.strerror}; give another --output"
        ) from None
    return folder


@contextmanager
def progress_bar(console: Console, text: str, total: float) -> Iterator[Any]:
    """A progress bar; yields the function that sets how much is done."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)
