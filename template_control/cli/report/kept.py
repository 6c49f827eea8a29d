"""A run that a command does and keeps, whatever becomes of its files."""

from __future__ import annotations

import argparse
import logging
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from template_control import view
from template_control.cli.interrupts import stopped
from template_control.cli.options.output import output_folder
from template_control.cli.report.output import progress_bar
from template_control.errors import TemplateControlError
from template_control.plant.quiet import stdout_to_stderr
from template_control.run import failures
from template_control.run.config import PreparedRun, RunConfig
from template_control.run.record import Record, RunInterrupted, one_line, recorded
from template_control.storage import Files
from template_control.terminal import plain_console


@dataclass(frozen=True)
class Kept:
    """A run, and where it is.

    Attributes:
        record: the run.
        path: of its file; None if that could not be written.
        files: that were written, or not.
    """

    record: Record
    path: str | None
    files: Files

    def interrupted(self) -> bool:
        """Say what became of the files, once the table is printed; whether Ctrl-C ended the run.

        Raises:
            TemplateControlError: if a file could not be written.
            KeyboardInterrupt: if Ctrl-C came while files were written.
        """
        self.files.tell()
        if not self.record.metadata["interrupted"]:
            return False
        print(
            f"template-control: interrupted: the run up to here is in {self.path}", file=sys.stderr
        )
        return True


def run_and_keep(
    options: argparse.Namespace,
    config: RunConfig,
    ready: PreparedRun,
    doing: str,
    more: Callable[[Record, Path], Any] | None = None,
) -> Kept:
    """Do a run; write it, what repeats it, and its figures.

    Args:
        options: as parsed: where it is kept.
        config: the run.
        ready: what it is made of.
        doing: what the progress bar says.
        more: writes further files of the record into the folder; not after Ctrl-C.

    Raises:
        TemplateControlError: if a part of the user's own fails, or answers with nonsense; what was
            recorded until then is kept, and its traceback is printed if it is another error.
    """
    files = Files()
    with output_folder(options.output) as folder, stdout_to_stderr():
        try:
            with (
                progress_bar(plain_console(stderr=True), doing, config.simulation.steps) as advance,
                _failures_told(),
            ):
                record = ready.run(config.simulation, advance)
        except RunInterrupted as stop:
            record = stop.record
        except Exception as error:
            if stopped():  # what Ctrl-C ends may end with any error
                raise
            _give_up(error, config, folder)
        path = files.write(lambda: record.save(folder / "run.npz"))
        files.write(lambda: config.save(folder / "run.toml"))
        if not record.metadata["interrupted"]:
            if not options.no_figures:
                files.write(lambda: view.save_figures(record, folder))
            if more is not None:
                files.write(lambda: more(record, folder))
    return Kept(record, None if path is None else str(path), files)


class _Lines(logging.Handler):
    """Prints each message on a line of standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"template-control: {record.getMessage()}", file=sys.stderr)


@contextmanager
def _failures_told() -> Iterator[None]:
    """Tell on the terminal, at once, that a run's QP fails."""
    lines = _Lines(logging.WARNING)
    failures.LOG.addHandler(lines)
    try:
        yield
    finally:
        failures.LOG.removeHandler(lines)


def _give_up(error: Exception, config: RunConfig, folder: Path) -> NoReturn:
    """Keep what a run had recorded when an error ended it, and tell the error.

    Args:
        error: that is being handled. Of one that is not this library's the traceback is printed:
            it leads into the user's own code.
        config: the run.
        folder: for its files.
    """
    record, files = recorded(error), Files()
    line = one_line(error) if record is None else record.metadata["error"]
    if record is not None:
        path = files.write(lambda: record.save(folder / "run.npz"))
        files.write(lambda: config.save(folder / "run.toml"))
        if path is not None:
            line += f"; the run up to here is in {path}"
    if isinstance(error, TemplateControlError):
        raise type(error)(line) from None
    traceback.print_exception(error)
    raise TemplateControlError(line) from None
