"""``template-control go``: a robot goes through a scenario, the template beside it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from template_control import view
from template_control.checks import option_types as values
from template_control.cli.interrupts import INTERRUPTED
from template_control.cli.report import (
    failures_text,
    nearest_text,
    run_and_keep,
    speed_text,
)
from template_control.cli.run_options import add_config, add_robot_options, add_strict, prepared
from template_control.cli.world_options import (
    add_catch_option,
    add_disturbance_options,
    add_length_options,
    add_output_options,
    add_world_options,
)
from template_control.errors import ParameterError
from template_control.run.record import Record
from template_control.run.summary import OTHERS, STRIDES, summarise
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.terminal import plain_console

NO_STANDS = "the template cannot stand: it leaves out the stands, and begins in a walk"
_FROM_THE_RUN = (
    "robot", "fell", "fall_reason", "duration", "speed_error_rms", "accepted_speed",
    "nearest_speed_taken", "joint_torque", "joint_speed", "saturated_share", "qp_failures",
    "qp_failed_share",
    "real_time_factor",
)  # fmt: skip


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Take a robot through a scenario (TOML): a speed profile with gait switches, in PyBullet or"
        " on an ideal plant. The same scenario is simulated on the robot's template, and shown"
        " beside it. Ends with a table, and a folder with the runs (run.npz, template.npz), what"
        " repeats it (run.toml) and figures. Exit status: 0, 1 after a fall, 2 for bad input, 130"
        " after Ctrl-C (what was done by then is saved)."
    )
    parser.add_argument(
        "scenario",
        nargs="?",
        type=values.path,
        metavar="FILE",
        help="the scenario, such as examples/example_one.toml; not needed with --config",
    )
    add_config(parser)
    add_robot_options(parser)
    add_strict(parser)
    add_world_options(parser)
    add_disturbance_options(parser)
    add_catch_option(parser)
    add_length_options(parser)
    add_output_options(parser, "runs/go")


def run(options: argparse.Namespace) -> int:
    """Go as told; returns 0, 1 after a fall, 130 after Ctrl-C."""
    config, ready = prepared(options)
    if ready.route is None:
        raise ParameterError("no scenario is given: name a file, such as examples/example_one.toml")
    if ready.route.scenario.stands:
        plain_console(stderr=True).print(NO_STANDS)
    with plain_console(stderr=True).status("the template"):
        template = simulate_scenario(ready.route.scenario)

    def more(record: Record, folder: Path) -> None:
        template.save(folder / "template.npz")
        if not options.no_figures:
            view.save_route_figures(record, template, folder)

    kept = run_and_keep(options, config, ready, "going", more)
    figures = summarise_route(kept.record, template, kept.path)
    if options.json:
        print(json.dumps(figures))
    else:
        _print(figures)
    if kept.interrupted():
        return INTERRUPTED
    return 1 if kept.record.fell else 0


def summarise_route(record: Record, template: ScenarioRecord, path: str | None) -> dict[str, Any]:
    """Figures of a robot's way through a scenario, and of its template's, SI units.

    Args:
        record: the robot's run.
        template: the same scenario on the robot's template.
        path: where the run was saved; None if it was not.
    """
    run = summarise(record, path)
    error = template.section_state[1:, 0] - template.wanted_speed
    return {
        **{name: run[name] for name in _FROM_THE_RUN},
        "completed": bool(record.arrived),
        "top_speed": float(record.section_state[:, 0].max()),
        "strides": {
            **{name: run["strides"].get(name, 0) for name in STRIDES.values()},
            **{name: run["strides"][name] for name in OTHERS.values() if name in run["strides"]},
        },
        "template": {
            "completed": template.completed,
            "top_speed": float(template.section_state[:, 0].max()),
            "speed_error_rms": float(np.sqrt(np.mean(error**2))) if error.size else None,
        },
        "record": path,
    }


def _print(figures: dict[str, Any]) -> None:
    table = Table(title=f"{figures['robot']} and its template")
    for name in ("", "robot", "template"):
        table.add_column(name, justify="right" if name else "left")
    other = figures["template"]
    words = {True: "as planned", False: "no"}
    ended = figures["fall_reason"] or words[figures["completed"]]
    table.add_row("completed", ended, words[other["completed"]])
    for name, key, unit in (
        ("top speed at a section", "top_speed", "m/s"),
        ("speed less the wanted, RMS", "speed_error_rms", "m/s"),
    ):
        values = (figures[key], other[key])
        table.add_row(name, *("" if x is None else f"{x:.3f} {unit}" for x in values))
    accepted = figures["accepted_speed"]
    if accepted["strides"]:
        table.add_row("change of speed reduced", nearest_text(accepted))
        table.add_row("speed less the accepted, RMS", f"{accepted['error_rms']:.3f} m/s")
    nearest = figures["nearest_speed_taken"]
    if nearest["strides"]:
        table.add_row("nearest speed taken", nearest_text(nearest))
    table.add_row("duration", f"{figures['duration']:.2f} s")
    for name, count in figures["strides"].items():
        table.add_row(f"strides, {name}", f"{count}")
    for joint, torque in figures["joint_torque"].items():
        speed = speed_text(figures["joint_speed"][joint])
        table.add_row(f"{joint}, peak", f"{torque['peak']:.0f} of {torque['limit']:g} N m, {speed}")
    table.add_row("ticks with a torque at its limit", f"{100 * figures['saturated_share']:.2f} %")
    table.add_row("QP failures", failures_text(figures))
    table.add_row("record", figures["record"] or "not saved")
    plain_console().print(table)
