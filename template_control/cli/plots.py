"""``template-control plots``: every figure of a recorded run."""

from __future__ import annotations

import argparse

from template_control import view
from template_control.checks import option_types as values
from template_control.run.record import load_record
from template_control.storage import writing


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Draw a run: stick diagram, centre of mass, torques, ground forces, phase portrait,"
        " tracking errors, energies, VLO states. Works on fallen and interrupted runs too."
        " Exit status: 0, 2 for bad input."
    )
    parser.add_argument("run_file", type=values.path, metavar="RUN", help="run.npz of a walk")
    parser.add_argument(
        "--output",
        type=values.path,
        metavar="DIR",
        help="folder for the figures; by default the run's",
    )


def run(options: argparse.Namespace) -> int:
    """Draw and name the files."""
    record = load_record(options.run_file)
    folder = options.run_file.parent if options.output is None else options.output
    with writing(folder):
        for path in view.save_figures(record, folder):
            print(path)
    return 0
