"""The options that say where a run is kept and how it is told."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from template_control.storage import writable


def add_output_options(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add ``--output``, ``--json`` and ``--no-figures``.

    Args:
        parser: of the command.
        folder: where runs go if nothing else is said.
    """
    parser.add_argument(
        "--output",
        type=Path,
        default=Path(folder),
        help=f"folder for run.npz, run.toml and figures, {folder} if not given; a run that is"
        " there is replaced, and the command says so",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the table as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")


def output_folder(folder: Path) -> Path:
    """The folder, made if need be; says on stderr if a run in it will be replaced.

    Args:
        folder: as asked for.

    Raises:
        RecordError: if nothing can be written there.
    """
    writable(folder)
    if (folder / "run.npz").exists():
        print(
            f"template-control: the run in {folder} will be replaced; --output keeps both",
            file=sys.stderr,
        )
    return folder
