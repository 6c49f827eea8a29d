"""``template-control plots``: every figure of a recorded run."""

from __future__ import annotations

import argparse
from pathlib import Path

from template_control.checks import option_types as values
from template_control.checks.ranges import Range
from template_control.run.record import Record, load_record
from template_control.slip.scenario.run import ScenarioRecord
from template_control.storage import writing
from template_control.view.figures import FIGURES, FREE_FIGURES, SOLE_FIGURES, save_figures
from template_control.view.scenario_figures import ROUTE_FIGURES
from template_control.view.style import DPI, FORMATS, Look

TEMPLATE = "template.npz"
"""File of the template's run that goes with a robot's run through a scenario."""

_DOTS = Range(20, 1200)
_KNOWN = tuple(dict.fromkeys((*FIGURES, *FREE_FIGURES, *SOLE_FIGURES, *ROUTE_FIGURES)))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Draw a run: stick diagram, centre of mass, torques, ground forces, phase portrait,"
        " tracking errors, energies, VLO states; of a scenario that `go` has made, also the robot"
        " and its template. Works on fallen and interrupted runs too."
        " Exit status: 0, 2 for bad input."
    )
    parser.add_argument("run_file", type=values.path, metavar="RUN", help="run.npz of a walk")
    parser.add_argument(
        "--output",
        type=values.path,
        metavar="DIR",
        help="folder for the figures; by default the run's",
    )
    add_figure_options(parser)


def add_figure_options(parser: argparse.ArgumentParser) -> None:
    """Add what a command that draws a run's figures takes."""
    group = parser.add_argument_group("figures")
    group.add_argument(
        "--figures",
        type=_names,
        metavar="NAMES",
        help=f"some of {', '.join(_KNOWN)}; by default all that the run has",
    )
    group.add_argument("--format", choices=FORMATS, default="png", help="by default png")
    group.add_argument("--dpi", type=values.whole(_DOTS), default=DPI, help=f"by default {DPI}")
    for name, what in (("start", "from here"), ("end", "up to here")):
        group.add_argument(
            f"--{name}",
            type=values.number(Range()),
            metavar="S",
            help=f"show {what} [s]; negative values count from the run's end. By default each"
            " figure shows what the run is about",
        )
    group.add_argument("--no-title", action="store_true", help="no title inside, for a paper")


def _names(text: str) -> list[str]:
    """Names of figures, of which a run may have some only."""
    names = text.split(",")
    for name in names:
        if name not in _KNOWN:
            raise argparse.ArgumentTypeError(
                f"is {name!r}: give a list, with commas, of {', '.join(_KNOWN)}"
            )
    return names


def draw(
    options: argparse.Namespace, record: Record, folder: Path, template: ScenarioRecord | None
) -> list[Path]:
    """Draw a run's figures, and its template's in the same scenario, as the options say."""
    look = Look(options.start, options.end, not options.no_title)
    how = {"dpi": options.dpi, "look": look, "file_format": options.format}
    return save_figures(record, folder, figures=options.figures, template=template, **how)


def run(options: argparse.Namespace) -> int:
    """Draw and name the files."""
    record = load_record(options.run_file)
    folder = options.run_file.parent if options.output is None else options.output
    file = options.run_file.parent / TEMPLATE
    template = ScenarioRecord.load(file) if file.is_file() else None
    with writing(folder):
        for path in draw(options, record, folder, template):
            print(path)
    return 0
