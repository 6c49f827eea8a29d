"""``template-control walk``: a robot follows the SLIP template."""

from __future__ import annotations

import argparse
import json
from typing import Any

from rich.table import Table

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
from template_control.plant.quiet import stdout_to_stderr
from template_control.run.record import Record
from template_control.run.summary import summarise
from template_control.terminal import plain_console


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
    config, ready = prepared(options)
    folder = output_folder(options.output)
    console = plain_console(stderr=True)
    with stdout_to_stderr():
        with progress_bar(console, "walking", config.simulation.steps) as advance:
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


def print_table(figures: dict[str, Any], record: Record) -> None:
    """The summary as a table on standard output.

    Args:
        figures: of the run, from :func:`~template_control.run.summary.summarise`.
        record: the run; it knows whether Ctrl-C ended it.
    """
    table = Table(title=f"{figures['robot']}, gait {figures['gait']}", show_header=False)
    table.add_column()
    table.add_column(justify="right")

    def row(name: str, text: str) -> None:
        table.add_row(name, text)

    row("steps", f"{figures['steps']}")
    row("falls", "0" if not figures["fell"] else f"1: {figures['fall_reason']}")
    row("duration", f"{figures['duration']:.2f} s")
    row("mean speed", f"{figures['mean_speed']:.3f} m/s")
    for name, key in (("VLO target", "vlo_target"), ("VLO, last 50 steps", "vlo_mean_last_50")):
        z = figures[key]
        if z is not None:
            row(
                name,
                f"{z['speed']:.4f} m/s  {z['height']:.4f} m  {z['vertical_speed']:+.4f} m/s",
            )
    if figures["speed_error_rms"] is not None:
        row("speed at VLO less the target, RMS", f"{figures['speed_error_rms']:.4f} m/s")
    rms, worst = figures["com_error_rms"], figures["com_error_max"]
    for axis in ("x", "y"):
        row(
            f"CoM error in {axis}, RMS / max",
            f"{1e3 * rms[axis]:.2f} / {1e3 * worst[axis]:.2f} mm",
        )
    for joint, torque in figures["joint_torque"].items():
        row(
            f"{joint} torque, peak / RMS of limit",
            f"{torque['peak']:.3g} / {torque['rms']:.3g} of {torque['limit']:g} N m",
        )
    row("ticks with a torque at its limit", f"{100 * figures['saturated_share']:.2f} %")
    row("QP failures", f"{figures['qp_failures']}")
    row("steps off the planner's own law", f"{figures['steps_not_nominal']}")
    for name, key in (
        ("control tick", "control_tick_seconds"),
        ("QP solve", "qp_solve_seconds"),
        ("plan", "plan_seconds"),
    ):
        t = figures[key]
        row(f"{name}, median / p99", f"{1e6 * t['median']:.0f} / {1e6 * t['p99']:.0f} us")
    row("real-time factor", f"{figures['real_time_factor']:.1f}")
    row("record", figures["record"])
    plain_console().print(table)
    if record.metadata["interrupted"]:
        plain_console().print("interrupted: the run up to here is saved")
