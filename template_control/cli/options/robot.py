"""The options that say which robot: shared by the commands that walk one."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from template_control.checks import typed
from template_control.checks.option_types import number
from template_control.checks.ranges import Range
from template_control.robot.library import FLOATING_ROBOTS, ROBOTS
from template_control.run.specs import RobotSpec

_DEFAULT = RobotSpec().model
_TURN = Range(-6.3, 6.3)  # [rad] about once around: degrees are not taken for it


def add_robot_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--robot`` and what a URDF of one's own may need."""
    parser.add_argument(
        "--robot",
        metavar="NAME|URDF",
        help=f"a shipped robot ({', '.join(ROBOTS)}) or the path of a planar URDF; {_DEFAULT} if"
        " not given",
    )
    parser.add_argument(
        "--free",
        action="store_const",
        const=True,
        help=f"nothing holds the robot: it walks in space, as {', '.join(FLOATING_ROBOTS)} can, and"
        " 3D URDFs of two legs with hip ab- and adduction",
    )
    own = parser.add_argument_group("a URDF of your own")
    own.add_argument(
        "--feet",
        nargs=2,
        metavar=("LEFT", "RIGHT"),
        help="its foot links; left_foot and right_foot if not given",
    )
    own.add_argument(
        "--sagittal-joints",
        nargs=4,
        metavar="JOINT",
        help="of a 3D URDF: hips and knees; the other joints are locked, the base is held in"
        " the sagittal plane",
    )
    own.add_argument(
        "--locked",
        nargs="+",
        metavar="JOINT=RAD",
        help="of a 3D URDF: angles of locked joints; in its plane a robot's other joints are locked"
        " at 0",
    )
    own.add_argument(
        "--foot-radius",
        type=number(Range(0.0, 1.0, above=True)),
        metavar="M",
        help="of a 3D URDF: radius of the spheres put into its feet",
    )
    own.add_argument(
        "--foot-offset",
        type=number(Range(-1.0, 1.0)),
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="of these spheres' centres from the foot links' origins, in the links' axes [m]",
    )
    own.add_argument(
        "--lossless",
        action="store_const",
        const=True,
        help="leave out the damping and friction of the URDF's joints",
    )


def robot_choice(options: argparse.Namespace, base: RobotSpec) -> RobotSpec:
    """The robot that was asked for.

    Args:
        options: as parsed.
        base: what holds where an option was not given. It describes one robot: with another
            ``--robot`` nothing of it is kept.
    """
    given: dict[str, Any] = {}
    if options.robot is not None:
        base = RobotSpec()
        given["model"] = _model(options.robot)
    for name in ("feet", "sagittal_joints", "foot_offset"):
        if getattr(options, name) is not None:
            given[name] = tuple(getattr(options, name))
    if options.foot_radius is not None:
        given["foot_radius"] = options.foot_radius
    for name in ("free", "lossless"):
        if getattr(options, name) is not None:
            given[name] = True
    if options.locked is not None:
        texts = typed.entries("--locked", options.locked, "JOINT=ANGLE with the angle in rad")
        given["locked"] = {
            joint: typed.number(f"--locked {joint}", text, Annotated[float, _TURN])
            for joint, text in texts.items()
        }
    return replace(base, **given)


def _model(robot: str) -> str:
    """A path is made absolute, so that what is written down does not depend on the folder."""
    own = robot not in ROBOTS and ("/" in robot or robot.endswith(".urdf"))
    return str(Path(robot).absolute()) if own else robot
