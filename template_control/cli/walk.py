"""``template-control walk``: a robot follows the SLIP template."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from rich.table import Table

from template_control import view
from template_control.cli.output import INTERRUPTED, progress_bar
from template_control.cli.robot_options import add_robot_options, robot_from
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Planner
from template_control.embedding.robot_route import robot_route
from template_control.embedding.robot_template import default_gait, paper_gait, template_for
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.quiet import stdout_to_stderr
from template_control.robot.planar_biped import PlanarBiped
from template_control.run.options import SimulationOptions
from template_control.run.record import Record
from template_control.run.simulation import perturbed_start, simulate
from template_control.run.summary import summarise
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.gaits.mean_speed import gait_for_speed
from template_control.slip.gaits.walking_family import walking_gait
from template_control.slip.scenario.scenario import load_scenario
from template_control.storage import writable
from template_control.terminal import plain_console

_STEPS = 50
_LONG = 200  # steps beyond which samples are thinned


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Walk a robot in PyBullet or on an ideal plant: a planner on the SLIP template chooses"
        " each step, a whole-body QP makes the robot follow it. Ends with a table, and a folder"
        " with the run (run.npz) and figures. Exit status: 0, 1 after a fall, 2 for bad input,"
        " 130 after Ctrl-C (what was walked by then is saved)."
    )
    parser.formatter_class = argparse.ArgumentDefaultsHelpFormatter
    add_robot_options(parser)
    parser.add_argument(
        "--scenario",
        type=Path,
        metavar="TOML",
        help="a speed profile to walk, as template-control slip takes it, instead of one gait; it"
        " ends with the profile, or after --steps",
    )
    parser.add_argument(
        "--steps",
        type=int,
        help=f"steps to walk, VLO to VLO; {_STEPS} where no scenario says when to stop",
    )
    parser.add_argument(
        "--gait",
        choices=("walk", "paper"),
        default="walk",
        help="walk: the robot's own, for most touchdown angle 66 deg and 1.1 m/s at VLO;"
        " paper: the equilibrium of Section IV-D, 0.9818 m and 826 J; both are given for l0 = 1 m"
        " and 80 kg and scaled to the robot",
    )
    parser.add_argument(
        "--speed",
        type=float,
        metavar="M/S",
        help="mean forward speed of the gait instead of the walk gait's own",
    )
    parser.add_argument(
        "--planner",
        choices=("lqr", "modified"),
        default="lqr",
        help="lqr: LQR on the VLO state with an offset estimate; modified: the paper's"
        " modified walking controller, equation (38)",
    )
    parser.add_argument(
        "--map",
        choices=("paper", "improved", "exact"),
        default="exact",
        help="return map that the modified planner tries its steps on",
    )
    parser.add_argument(
        "--plant",
        choices=("pybullet", "ideal"),
        default="pybullet",
        help="ideal: rigid contacts that stick, no friction; --friction is then the"
        " controller's cone only",
    )
    parser.add_argument(
        "--friction", type=float, default=0.7, help="Coulomb friction between feet and ground"
    )
    parser.add_argument(
        "--mass-scale",
        type=float,
        default=1.0,
        help="masses of the simulated robot over those the controller knows",
    )
    parser.add_argument(
        "--torque-scale", type=float, default=1.0, help="share of the URDF's torque limits to use"
    )
    parser.add_argument(
        "--seed",
        type=int,
        help="perturb the initial state by up to 5 %% in speed and 2 cm in height, drawn with"
        " this seed; without it the walk starts on the gait",
    )
    parser.add_argument(
        "--output", type=Path, default=Path("runs/walk"), help="folder for run.npz and figures"
    )
    parser.add_argument(
        "--record-every",
        type=int,
        metavar="N",
        help=f"keep every n-th sample in run.npz; by default 1 up to {_LONG} steps, then 5",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the table as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")


def run(options: argparse.Namespace) -> int:
    """Walk as told; returns 0, 1 after a fall, 130 after Ctrl-C."""
    _check(options)
    folder = writable(options.output)
    robot = robot_from(options)
    route = None
    if options.scenario is not None:
        route = robot_route(robot, load_scenario(options.scenario))
        gait = walking_gait(route.parameters, float(route.start[0]))
    else:
        gait = _gait(options, robot)
        options.steps = options.steps or _STEPS
    planner: Planner = LqrPlanner(gait)
    if options.planner == "modified":
        planner = ModifiedPlanner(gait, ModifiedOptions(map_kind=MapKind[options.map.upper()]))
    every = options.record_every or (1 if (options.steps or 0) <= _LONG else 5)
    simulation = SimulationOptions(
        steps=options.steps,
        plant=IdealOptions(mass_scale=options.mass_scale)
        if options.plant == "ideal"
        else PlantOptions(friction=options.friction, mass_scale=options.mass_scale),
        embedding=EmbeddingOptions(friction=options.friction, torque_scale=options.torque_scale),
        start=None if options.seed is None else perturbed_start(gait, options.seed),
        record_every=every,
    )
    console = plain_console(stderr=True)
    with stdout_to_stderr():
        with progress_bar(console, "walking", options.steps) as advance:
            record = simulate(
                robot, route or planner, simulation, advance, planners={gait.stride: planner}
            )
        path = record.save(folder / "run.npz")
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


def _check(options: argparse.Namespace) -> None:
    """Ranges of the numbers a user gives.

    Raises:
        ParameterError: naming the option and its range.
    """
    for name, low, high in (
        ("steps", 1, 1_000_000),
        ("friction", 0.05, 5.0),
        ("mass_scale", 0.5, 2.0),
        ("torque_scale", 0.01, 10.0),
        ("speed", 0.01, 10.0),
        ("record_every", 1, 1_000_000),
        ("seed", 0, 2**63),
    ):
        value = getattr(options, name)
        if value is None:
            continue
        if not (math.isfinite(value) and low <= value <= high):
            flag = "--" + name.replace("_", "-")
            raise ParameterError(f"{flag} is {value:g}: give a number from {low:g} to {high:g}")
    if options.speed is not None and options.gait != "walk":
        raise ParameterError(f"--speed does not go with --gait {options.gait}: leave one out")
    if options.scenario is not None:
        for flag, given in (
            ("--speed", options.speed is not None),
            ("--gait", options.gait != "walk"),
            ("--seed", options.seed is not None),
        ):
            if given:
                raise ParameterError(f"{flag} does not go with --scenario: leave one out")


def _gait(options: argparse.Namespace, robot: PlanarBiped) -> WalkingGait:
    if options.gait == "paper":
        return paper_gait(template_for(robot))
    if options.speed is not None:
        return gait_for_speed(template_for(robot), options.speed)
    return default_gait(robot)


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
