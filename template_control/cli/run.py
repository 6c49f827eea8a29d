"""``template-control run``: a robot follows the SLIP template with flights."""

from __future__ import annotations

import argparse

from template_control.cli.run_options import (
    add_config,
    add_robot_options,
    add_running_options,
    prepared,
)
from template_control.cli.walk import report
from template_control.cli.world_options import (
    add_disturbance_options,
    add_length_options,
    add_output_options,
    add_world_options,
)
from template_control.run.config import RunConfig
from template_control.run.specs import GaitSpec


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Run a robot in PyBullet or on an ideal plant: a planner on the SLIP template chooses each"
        " stride from apex to apex, a whole-body QP makes the robot follow it. Ends with a table,"
        " and a folder with the run (run.npz), what repeats it (run.toml) and figures. Exit"
        " status: 0, 1 after a fall, 2 for bad input, 130 after Ctrl-C (what was run by then is"
        " saved)."
    )
    add_config(parser)
    add_robot_options(parser)
    add_running_options(parser)
    add_world_options(parser)
    add_disturbance_options(parser)
    add_length_options(parser)
    add_output_options(parser, "runs/run")


def run(options: argparse.Namespace) -> int:
    """Run as told; returns 0, 1 after a fall, 130 after Ctrl-C."""
    default = RunConfig(gait=GaitSpec("run"))
    return report(options, *prepared(options, default), "running")
