"""What a URDF must have to be a free biped of this library."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.errors import RobotError
from template_control.robot.biped import foot_frame, leg_joints
from template_control.robot.free.free_terms import BASE_DOF
from template_control.robot.legs import HINGES, straight_legs
from template_control.robot.requirements import UNLIMITED, check_feet, check_legs_apart

_ROOT = 1  # Pinocchio's index of the free flyer
_LEAST, _MOST = 3, 4  # joints of a leg
_CLOSE = 1e-6


def set_limits(robot: ET.Element, torque: float, velocity: float) -> None:
    """Give all moving joints other limits.

    Args:
        robot: the root element of a URDF; changed.
        torque: the largest [N m].
        velocity: the largest [rad/s].
    """
    for joint in robot.findall("joint"):
        if joint.get("type") != "fixed":
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", lower="-10", upper="10")
            limit.set("effort", f"{torque:.12g}")
            limit.set("velocity", f"{velocity:.12g}")


def set_ranges(
    path: Path, robot: ET.Element, feet: Sequence[str], ranges: Sequence[tuple[float, float]]
) -> None:
    """Give the joints of both legs other ranges.

    Args:
        path: of the URDF, for the message.
        robot: its root element, whose moving joints have limits; changed.
        feet: names of the two foot links.
        ranges: of a leg's joints, from the trunk to the knee [rad].

    Raises:
        RobotError: if a leg has another number of joints.
    """
    carriers = {_link(joint, "child"): joint for joint in robot.findall("joint")}
    for foot in feet:
        leg, link = [], foot
        while link in carriers:
            joint = carriers.pop(link)
            link = _link(joint, "parent")
            if joint.get("type") != "fixed":
                leg.append(joint)
        if len(leg) != len(ranges):
            raise RobotError(
                f"{path}: {len(leg)} joints move foot {foot!r}, and {len(ranges)} ranges are given:"
                " give one for each joint of a leg"
            )
        for joint, (lower, upper) in zip(reversed(leg), ranges, strict=True):
            for limit in joint.findall("limit"):
                limit.set("lower", f"{lower:.12g}")
                limit.set("upper", f"{upper:.12g}")


def _link(joint: ET.Element, end: str) -> str:
    """Name of the link at an end of a joint."""
    found = joint.find(end)
    return "" if found is None else str(found.get("link"))


def check_free(path: Path, model: pin.Model, feet: Sequence[str]) -> None:
    """Check that the robot is a biped whose legs can place their feet anywhere.

    Args:
        path: of the URDF, for the message.
        model: of the robot, with a free flyer.
        feet: names of the two foot links.

    Raises:
        RobotError: naming the foot or the joint that is otherwise.
    """
    check_feet(path, model, feet)
    for joint, name in list(zip(model.joints, model.names, strict=True))[2:]:
        if joint.nq != 1 or joint.nv != 1:
            raise RobotError(
                f"{path}: joint {name!r} is {joint.shortname()}, and must be revolute with limits"
            )
    legs = leg_joints(model, feet, 1)
    check_legs_apart(path, feet, legs)
    if model.inertias[_ROOT].mass <= 0.0:
        raise RobotError(
            f"{path}: the root link weighs nothing, and so does what is fixed to it: give the trunk"
            " an <inertial> with its mass"
        )
    for leg, foot in zip(legs, feet, strict=True):
        if not _LEAST <= len(leg) <= _MOST:
            raise RobotError(
                f"{path}: {len(leg)} joints move foot {foot!r}: three or four are needed, the last"
                " two of them hip and knee about the lateral axis"
            )
    axes = straight_legs(model, legs, [foot_frame(model, foot) for foot in feet]).axes
    for leg, foot in zip(legs, feet, strict=True):
        for joint in leg[-HINGES:]:
            if abs(abs(axes[1, model.idx_vs[joint]]) - 1.0) > _CLOSE:
                raise RobotError(
                    f"{path}: joint {model.names[joint]!r} of foot {foot!r} does not turn about the"
                    " lateral axis y, as hip and knee must, the last two joints of a leg"
                )
    if len(legs[0]) + len(legs[1]) != model.nv - BASE_DOF:
        others = [n for j, n in enumerate(model.names) if j > 1 and j not in (*legs[0], *legs[1])]
        raise RobotError(
            f"{path}: joints {others} are in no leg: make them fixed, or name them in `locked`"
        )
    for kind, limits in (("effort", model.effortLimit), ("velocity", model.velocityLimit)):
        for joint in (*legs[0], *legs[1]):
            limit = limits[model.idx_vs[joint]]
            if not 0.0 < limit < UNLIMITED or not np.isfinite(limit):
                raise RobotError(
                    f"{path}: joint {model.names[joint]!r} has {kind} {limit}: give its limit"
                )
