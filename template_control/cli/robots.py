"""``template-control robots``: the robots that come with the library."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from template_control.checks import option_types as values
from template_control.robot.library import ROBOTS, SHIPPED, load_floating_robot, load_robot
from template_control.robot.template import default_gait
from template_control.slip.automaton.vocabulary import Slot
from template_control.terminal import report, table


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = "The shipped robots: mass, legs, limits, scaled template and default gait."
    values.add_json(parser, "the list as JSON")


def run(options: argparse.Namespace) -> int:
    """List them."""
    rows = [_describe(name) for name in SHIPPED]
    columns = ("robot", "mass", "leg", "hip, knee limit", "l0", "k0", "default gait")
    lines = (f"- {row['robot']}: {row['about']}" for row in rows)
    report(options.json, rows, table("robots", columns, map(_row, rows)), lines=lines)
    return 0


def _row(robot: dict[str, Any]) -> tuple[str, ...]:
    gait, template, (hip, knee) = robot["gait"], robot["template"], robot["hip_knee_torque"]
    return (
        robot["robot"],
        f"{robot['mass']:.4g} kg",
        f"{robot['leg_length']:.3g} m",
        f"{hip:g}, {knee:g} N m",
        f"{template['rest_length']:.3f} m",
        f"{template['leg_stiffness'] / 1e3:.3g} kN/m",
        f"{gait['touchdown_angle_deg']:.0f} deg, {gait['mean_speed']:.2f} m/s",
    )


def _describe(name: str) -> dict[str, Any]:
    """A robot in SI units (angles where named so in degrees)."""
    robot = load_robot(name) if name in ROBOTS else load_floating_robot(name)
    gait = default_gait(robot)
    p = gait.parameters
    return {
        "robot": name,
        "about": SHIPPED[name],
        "mass": robot.mass,
        "leg_length": robot.leg_length,
        "joints": list(robot.joint_names),
        "hip_knee_torque": robot.torque_limit[list(robot.hinges[0][:2])].tolist(),
        "torque_limit": robot.torque_limit.tolist(),
        "velocity_limit": robot.velocity_limit.tolist(),
        "template": {"rest_length": p.rest_length, "leg_stiffness": p.leg_stiffness},
        "gait": {
            "touchdown_angle_deg": float(np.degrees(gait.controls[Slot.TOUCHDOWN_ANGLE])),
            "vlo_speed": float(gait.vlo[0]),
            "mean_speed": gait.mean_speed,
        },
    }
