"""Common parts of the commands that make trials."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from template_control.checks.option_types import whole
from template_control.checks.ranges import Range
from template_control.cli.interrupts import INTERRUPTED
from template_control.plant.plant import plant_name
from template_control.run.experiment import Experiment
from template_control.run.specs import GaitSpec
from template_control.view.style import save_figure

_MOST = 1000


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


def folder_of(options: argparse.Namespace, experiment: Experiment, root: str, robot: str) -> Path:
    """The folder for trials: as asked for, or in ``root`` by robot, base, gait and engine."""
    parts = [robot]
    if experiment.free:
        parts.append("free")
    gait = experiment.motion
    if isinstance(gait, GaitSpec) and gait.name != "walk":
        parts.append(gait.name)
    if plant_name(experiment.world) != plant_name(Experiment().world):
        parts.append(plant_name(experiment.world))
    return Path(options.output or Path(root) / "-".join(parts))


def kept(folder: Path) -> int:
    """Say after Ctrl-C where the finished trials are; returns the command's exit status."""
    print(
        f"template-control: interrupted; finished trials are in {folder}, the same command"
        " goes on from there",
        file=sys.stderr,
    )
    return INTERRUPTED


def draw(figure: Callable[[], Figure], path: Path) -> Path:
    """Draw a figure of trials, and write it."""
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        return save_figure(figure(), path)
