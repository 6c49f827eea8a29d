"""``template-control walk``: a robot follows the SLIP template."""

from __future__ import annotations

import argparse
import json

from rich.console import Console

from template_control import view
from template_control.cli.options.config import add_config, prepared
from template_control.cli.options.gait import add_gait_options, add_planner_options
from template_control.cli.options.output import add_output_options, output_folder
from template_control.cli.options.robot import add_robot_options
from template_control.cli.options.world import (
    add_disturbance_options,
    add_length_options,
    add_world_options,
)
from template_control.cli.output import INTERRUPTED, progress_bar
from template_control.cli.run_table import print_table
from template_control.plant.quiet import stdout_to_stderr
from template_control.run.config import Ready, RunConfig
from template_control.run.summary import summarise


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Walk a robot in PyBullet or on an ideal plant: a planner on the SLIP template chooses"
        " each step, a whole-body QP makes the robot follow it. Ends with a table, and a folder"
        " with the run (run.npz), what repeats it (run.toml) and figures. Exit status: 0, 1 after"
        " a fall, 2 for bad input, 130 after Ctrl-C (what was walked by then is saved)."
    )
    add_config(parser)
    add_robot_options(parser)
    add_gait_options(parser)
    add_planner_options(parser)
    add_world_options(parser)
    add_disturbance_options(parser)
    add_length_options(parser)
    add_output_options(parser, "runs/walk")


def run(options: argparse.Namespace) -> int:
    """Walk as told; returns 0, 1 after a fall, 130 after Ctrl-C."""
    return report(options, *prepared(options), "walking")


def report(options: argparse.Namespace, config: RunConfig, ready: Ready, doing: str) -> int:
    """Do a run, keep it and tell it.

    Args:
        options: as parsed: where it is kept, how it is told.
        config: the run.
        ready: what it is made of.
        doing: what the progress bar says.

    Returns:
        The exit status.
    """
    folder = output_folder(options.output)
    console = Console(stderr=True)
    with stdout_to_stderr():
        with progress_bar(console, doing, config.simulation.steps) as advance:
            record = ready.run(config.simulation, advance)
        path = record.save(folder / "run.npz")
        config.save(folder / "run.toml")
        if not options.no_figures:
            view.save_figures(record, folder)
    figures = summarise(record, str(path))
    if options.json:
        print(json.dumps(figures))
    else:
        print_table(figures, record)
    if record.metadata["interrupted"]:
        return INTERRUPTED
    return 1 if record.fell else 0
