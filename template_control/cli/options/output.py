"""The options that say where a run is kept and how it is told."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from template_control.checks import option_types as values
from template_control.storage import writing


def add_output_options(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add ``--output``, ``--json`` and ``--no-figures``.

    Args:
        parser: of the command.
        folder: where runs go if nothing else is said.
    """
    parser.add_argument(
        "--output",
        type=values.path,
        default=Path(folder),
        help=f"folder for run.npz, run.toml and figures, {folder} if not given; a run that is"
        " there is replaced, and the command says so",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the table as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")


@contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """Keep a folder for a run; says on stderr if a run in it will be replaced.

    Args:
        folder: as asked for.

    Yields:
        The folder; see :func:`~template_control.storage.writing`.

    Raises:
        RecordError: if nothing can be written there, or another command writes there now.
    """
    with writing(folder):
        if (folder / "run.npz").exists():
            print(
                f"template-control: the run in {folder} will be replaced; --output keeps both",
                file=sys.stderr,
            )
        yield folder
