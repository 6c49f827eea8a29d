"""``template-control walk``: a robot follows the SLIP template."""

from __future__ import annotations

import argparse
import json

from template_control.cli.interrupts import INTERRUPTED
from template_control.cli.report import print_table, run_and_keep
from template_control.cli.run_options import (
    add_config,
    add_gait_options,
    add_planner_options,
    add_robot_options,
    add_stand_options,
    add_strict,
    prepared,
)
from template_control.cli.world_options import (
    add_catch_option,
    add_course_options,
    add_disturbance_options,
    add_length_options,
    add_output_options,
    add_world_options,
)
from template_control.errors import ScenarioError
from template_control.run.config import PreparedRun, RunConfig
from template_control.run.summary import summarise


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Walk a robot in PyBullet or on an ideal plant: a planner on the SLIP template chooses"
        " each step, a whole-body QP makes the robot follow it. Ends with a table, and a folder"
        " with the run (run.npz), what repeats it (run.toml) and figures. Exit status: 0, 1 after"
        " a fall, 2 for bad input or a file that cannot be written, 130 after Ctrl-C (what was"
        " walked by then is saved, without figures)."
    )
    add_config(parser)
    add_robot_options(parser)
    add_course_options(parser)
    add_gait_options(parser)
    add_stand_options(parser)
    add_planner_options(parser)
    add_strict(parser)
    add_world_options(parser)
    add_disturbance_options(parser)
    add_catch_option(parser)
    add_length_options(parser)
    add_output_options(parser, "runs/walk")


def run(options: argparse.Namespace) -> int:
    """Walk as told; returns 0, 1 after a fall, 130 after Ctrl-C."""
    config, ready = prepared(options)
    for number, segment in enumerate(config.scenario.segments if config.scenario else (), 1):
        if segment.gait == "run":
            raise ScenarioError(
                f"segment {number} is to {segment.gait}: give the scenario to template-control go"
            )
    return report(options, config, ready, "walking")


def report(options: argparse.Namespace, config: RunConfig, ready: PreparedRun, doing: str) -> int:
    """Do a run, keep it and tell it.

    Args:
        options: as parsed: where it is kept, how it is told.
        config: the run.
        ready: what it is made of.
        doing: what the progress bar says.

    Returns:
        The exit status.
    """
    kept = run_and_keep(options, config, ready, doing)
    figures = summarise(kept.record, kept.path)
    if options.json:
        print(json.dumps(figures))
    else:
        print_table(figures)
    if kept.interrupted():
        return INTERRUPTED
    return 1 if kept.record.fell else 0
