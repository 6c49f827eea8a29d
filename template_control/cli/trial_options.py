"""Common parts of the commands that make trials."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from matplotlib.figure import Figure

from template_control import terminal
from template_control.checks import option_types as values
from template_control.checks.ranges import Range
from template_control.cli.interrupts import INTERRUPTED
from template_control.cli.notices import notice
from template_control.plant.c_library import stdout_to_stderr
from template_control.plant.plant import plant_name
from template_control.run.experiment import Experiment
from template_control.run.specs import GaitSpec
from template_control.storage import Files
from template_control.sweep.executor import workers
from template_control.terminal import table
from template_control.view.style import figure_style, save_figure

T = TypeVar("T")

_MOST = 1000


def add_trial_options(parser: argparse.ArgumentParser, about: str) -> None:
    """Add ``--workers``, ``--output``, ``--json`` and ``--markdown``; ``about`` is the output's."""
    parser.add_argument(
        "--workers",
        type=values.whole(Range(1, _MOST)),
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes that run trials",
    )
    parser.add_argument("--output", type=values.path, help=about)
    printed = parser.add_mutually_exclusive_group()
    values.add_json(printed, "JSON")
    printed.add_argument(
        "--markdown", action="store_true", help="print the table as Markdown on stdout"
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


@dataclass(frozen=True)
class Report:
    """Report of trials: a table, with lines below it in Markdown; and a table of further details.

    ``data`` are for ``--json``, ``figure`` is drawn into the file ``name`` of the folder.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    data: dict[str, Any]
    figure: Callable[[], Figure]
    name: str
    lines: Sequence[str] = ()
    details: tuple[str, Sequence[str], Sequence[Sequence[str]]] | None = None
    note: str = ""

    def markdown(self) -> str:
        """The table as Markdown."""
        rows = [self.columns, ["---" for _ in self.columns], *self.rows]
        table = ["| " + " | ".join(row) + " |" for row in rows]
        return "\n".join([f"{self.title}:", "", *table, *self.lines])


def report_trials(
    options: argparse.Namespace,
    folder: Path,
    trials: Callable[[Executor], T],
    report: Callable[[T, Files], Report],
) -> int:
    """Make trials on worker processes and report on them; the exit status."""
    try:
        with workers(options.workers) as pool, stdout_to_stderr():
            found = trials(pool)
    except KeyboardInterrupt:
        notice(f"interrupted; finished trials are in {folder}, the same command goes on from there")
        return INTERRUPTED
    files = Files()
    made = report(found, files)
    figure = files.write(lambda: _draw(made.figure, folder / made.name))
    data = {**made.data, "figure": None if figure is None else str(figure)}
    shown = [table(made.title, made.columns, made.rows, left=len(made.columns))]
    if made.details is not None:
        shown.append(table(*made.details, left=len(made.details[1])))
    lines = filter(None, (made.note, "" if figure is None else f"figure: {figure}"))
    if options.markdown:
        print(made.markdown())
    else:
        terminal.report(options.json, data, *shown, lines=lines)
    files.raise_pending()
    return 0


def _draw(figure: Callable[[], Figure], path: Path) -> Path:
    with figure_style():
        return save_figure(figure(), path)
