"""The options that say which robot: shared by the commands that walk one."""

from __future__ import annotations

import argparse

from template_control.errors import ParameterError
from template_control.robot.library import ROBOTS, load_robot
from template_control.robot.planar_biped import PlanarBiped


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Add ``--robot``."""
    parser.add_argument(
        "--robot",
        default="five-link",
        metavar="NAME|URDF",
        help=f"a shipped robot ({', '.join(ROBOTS)}) or the path of a planar URDF",
    )


def add_robot_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--robot`` and what a URDF of one's own may need."""
    add_robot(parser)
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
        "--foot-radius",
        type=float,
        metavar="M",
        help="of a 3D URDF: radius of the spheres put into its feet",
    )


def robot_from(options: argparse.Namespace) -> PlanarBiped:
    """The robot that was asked for.

    Raises:
        RobotError: if there is no such robot.
        ParameterError: if options for a URDF of one's own come with a shipped robot, or lack
            another that they need.
    """
    own = {
        "feet": options.feet,
        "sagittal_joints": options.sagittal_joints,
        "foot_radius": options.foot_radius,
    }
    given = {name: value for name, value in own.items() if value is not None}
    if not given:
        return load_robot(options.robot)
    if options.robot in ROBOTS:
        flags = ", ".join("--" + name.replace("_", "-") for name in given)
        raise ParameterError(f"{flags} go with a URDF, not with {options.robot}: leave them out")
    if options.foot_radius is not None and options.sagittal_joints is None:
        raise ParameterError(
            "--foot-radius goes with --sagittal-joints: give both, or change the URDF's feet"
        )
    return PlanarBiped.from_urdf(options.robot, **given)
