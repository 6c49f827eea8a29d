"""``template-control plots``: every figure of a recorded run."""

from __future__ import annotations

import argparse

from template_control import view
from template_control.checks import option_types as values
from template_control.checks.ranges import Range
from template_control.errors import ParameterError
from template_control.run.record import load_record
from template_control.slip.scenario.run import ScenarioRecord
from template_control.storage import writing
from template_control.view.figures import FIGURES, FORMATS, FREE_FIGURES, figures_of
from template_control.view.scenario_figures import ROUTE_FIGURES
from template_control.view.style import DPI, Look

_DOTS = Range(20, 1200)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Draw a run: stick diagram, centre of mass, torques, ground forces, phase portrait,"
        " tracking errors, energies, VLO states; of a scenario that `go` has made, also the robot"
        " beside its template. Works on fallen and interrupted runs too."
        " Exit status: 0, 2 for bad input."
    )
    parser.add_argument("run_file", type=values.path, metavar="RUN", help="run.npz of a walk")
    parser.add_argument(
        "--output",
        type=values.path,
        metavar="DIR",
        help="folder for the figures; by default the run's",
    )
    known = ", ".join(dict.fromkeys((*FIGURES, *FREE_FIGURES, *ROUTE_FIGURES)))
    parser.add_argument("--figures", metavar="NAMES", help=f"some of {known}; by default all")
    parser.add_argument("--format", choices=FORMATS, default="png", help="by default png")
    parser.add_argument("--dpi", type=values.whole(_DOTS), default=DPI, help=f"by default {DPI}")
    for name, what in (("start", "from here"), ("end", "up to here")):
        parser.add_argument(
            f"--{name}",
            type=values.number(Range()),
            metavar="S",
            help=f"show {what} [s]; negative values count from the run's end. By default each"
            " figure shows what the run is about",
        )
    parser.add_argument("--no-title", action="store_true", help="no title inside, for a paper")


def run(options: argparse.Namespace) -> int:
    """Draw and name the files."""
    record = load_record(options.run_file)
    folder = options.run_file.parent if options.output is None else options.output
    look = Look(options.start, options.end, not options.no_title)
    beside = options.run_file.parent / "template.npz"
    of_route = ROUTE_FIGURES if beside.is_file() else ()
    known = [*figures_of(record), *of_route]
    names = known if options.figures is None else options.figures.split(",")
    for name in names:
        if name not in known:
            raise ParameterError(
                f"there is no figure {name!r} of this run: give some of {', '.join(known)}"
            )
    drawn = {"dpi": options.dpi, "look": look, "file_format": options.format}
    with writing(folder):
        own = [name for name in names if name not in ROUTE_FIGURES]
        paths = view.save_figures(record, folder, figures=own, **drawn)
        if set(names) & set(of_route):
            template = ScenarioRecord.load(beside)
            made = view.save_route_figures(record, template, folder, **drawn)
            paths += [path for path in made if path.stem in names]
        for path in paths:
            print(path)
    return 0
