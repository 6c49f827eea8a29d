"""What the commands that make trials have in common."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from template_control.checks.option_types import SPEED, number, whole
from template_control.checks.ranges import Range
from template_control.cli.interrupts import INTERRUPTED
from template_control.robustness.subject import ENGINES, Subject
from template_control.view.style import save_figure

_MOST = 1000


def add_gait(parser: argparse.ArgumentParser, speed: str) -> None:
    """Add ``--gait`` and ``--speed``.

    Args:
        parser: of the command.
        speed: what the speed is of.
    """
    parser.add_argument("--gait", choices=("walk", "run"), default="walk", help="what it keeps")
    parser.add_argument("--speed", type=number(SPEED), metavar="M/S", help=speed)


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add ``--plant``.

    Args:
        parser: of the command.
    """
    parser.add_argument(
        "--plant", choices=tuple(ENGINES), default=Subject.plant, help="physics engine"
    )


def add_printed(parser: argparse.ArgumentParser) -> None:
    """Add ``--json`` and ``--markdown``."""
    printed = parser.add_mutually_exclusive_group()
    printed.add_argument(
        "--json", action="store_true", help="print JSON, and nothing else, on stdout"
    )
    printed.add_argument(
        "--markdown", action="store_true", help="print the table as Markdown on stdout"
    )


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``."""
    parser.add_argument(
        "--workers",
        type=whole(Range(1, _MOST)),
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes that run trials",
    )


def kept(folder: Path) -> int:
    """Say after Ctrl-C where the finished trials are; returns the command's exit status.

    Args:
        folder: of the trials.
    """
    print(
        f"template-control: interrupted; finished trials are in {folder}, the same command"
        " goes on from there",
        file=sys.stderr,
    )
    return INTERRUPTED


def draw(figure: Callable[[], Figure], path: Path) -> Path:
    """Draw a figure of trials, and write it.

    Args:
        figure: makes it.
        path: of the file.

    Raises:
        RecordError: if the file cannot be written.
    """
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        return save_figure(figure(), path)
