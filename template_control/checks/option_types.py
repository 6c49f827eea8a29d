"""Options that commands share, and the types of values: numbers in a range, and paths."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from template_control.checks.ranges import Range
from template_control.checks.typed import parsed

SPEED = Range(0.01, 10.0)
"""Of a gait that is asked for [m/s]; whether there is one is decided later."""
SEED = Range(0, 2**63 - 1)
MANY = Range(1, 1_000_000)  # of things that are simulated or drawn one by one


def number(within: Range) -> Callable[[str], float]:
    """The ``type`` of an option that is a number in a range, in the unit that the user types."""
    return partial(parsed, hint=Annotated[float, within])


def whole(within: Range) -> Callable[[str], int]:
    """Reader of a whole number; see :func:`number`."""
    return partial(parsed, hint=Annotated[int, within])


def path(text: str) -> Path:
    """Path that a user typed; the empty one, which would be the current folder, is refused."""
    if not text.strip():
        raise argparse.ArgumentTypeError("is empty: give a path, such as . for this folder")
    return Path(text)


def add_json(parser: Any, what: str = "the table as JSON") -> None:
    """Add ``--json``, which prints ``what`` alone."""
    words = f"print {what}, and nothing else, on stdout"
    parser.add_argument("--json", action="store_true", help=words)


def add_folder(parser: argparse.ArgumentParser, folder: str, about: str) -> None:
    """Add ``--output``, by default ``folder``, and ``--no-figures``."""
    parser.add_argument("--output", type=path, default=Path(folder), help=about)
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")
