"""What a URDF must have to be a planar biped of this library."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.errors import RobotError
from template_control.robot.biped import add_foot_frame, foot_frame

Array = NDArray[np.float64]

BASE_DOF = 3
UNLIMITED = 1e20  # Pinocchio writes an absent limit as inf or as 1.8e308
_CLOSE = 1e-4  # [m]
_PARALLEL = 1e-6  # 1 - cosine of the angle between two axes


def check_planar(path: Path, model: pin.Model) -> None:
    """Check that base and legs are those of a planar biped with hips and knees.

    Args:
        path: of the URDF, for the message.
        model: of the robot.

    Raises:
        RobotError: naming the joint that is otherwise, or has no limit of torque or speed.
    """
    kinds = [joint.shortname() for joint in model.joints][1:]
    names = list(model.names)[1:]
    hinged = [joint.nq == joint.nv == 1 for joint in model.joints[1:]]
    columns = pin.computeJointJacobians(model, model.createData(), pin.neutral(model))
    base = np.eye(6)[[0, 2, 4]].T  # in the world's axes, the pitch joint at its origin
    given = columns[:, :BASE_DOF]
    if not all(hinged[:BASE_DOF]) or given.shape != base.shape or not _near(given[3:], base[3:]):
        first = list(zip(names, kinds, strict=True))[:BASE_DOF]
        raise RobotError(
            f"{path} is not planar: its first joints are {first},"
            " and must be prismatic x, prismatic z, revolute y; of a 3D robot, name the hips and"
            " knees as sagittal_joints"
        )
    for name, turns, joint in zip(names, hinged, model.joints[1:], strict=True):
        if name in names[:BASE_DOF]:
            continue
        axis = columns[:, joint.idx_v]
        if not turns or abs(abs(axis[4]) - 1.0) > _PARALLEL:
            raise RobotError(
                f"{path} is not planar: joint {name!r} is {joint.shortname()},"
                " and must be revolute about y (with limits, not continuous)"
            )
    if not _near(given, base):
        raise RobotError(
            f"{path}: joint {names[2]!r}, the base's pitch, is not at the world's origin with all"
            " joints at 0, or a slide is not along the world's x or z: give the base's joints no"
            " offset"
        )
    if model.nv != BASE_DOF + 4:
        raise RobotError(
            f"{path}: {model.nv - BASE_DOF} hinges in its legs: a hip and a knee each is what is"
            " controlled; name these four as sagittal_joints"
        )
    limits = np.array(model.effortLimit[BASE_DOF:])
    for name, limit in zip(names[BASE_DOF:], limits, strict=True):
        if not 0.0 < limit < UNLIMITED:
            raise RobotError(f"{path}: joint {name!r} has effort {limit}: give its torque limit")
    speeds = np.array(model.velocityLimit[BASE_DOF:])
    for name, limit in zip(names[BASE_DOF:], speeds, strict=True):
        if not 0.0 < limit < UNLIMITED:
            raise RobotError(
                f"{path}: joint {name!r} has velocity {limit}: give the speed [rad/s] that it can"
                " have"
            )


def check_hips(path: Path, model: pin.Model, hips: Sequence[int]) -> None:
    """Check that the trunk turns about the hips: the height of one is the other's.

    Args:
        path: of the URDF, for the message.
        model: of the robot.
        hips: indices of the two hip joints.

    Raises:
        RobotError: naming the hip that is elsewhere.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    for hip in hips:
        place = data.oMi[hip].translation - data.oMi[BASE_DOF].translation
        if np.hypot(place[0], place[2]) > _CLOSE:
            raise RobotError(
                f"{path}: hip {model.names[hip]!r} is {place.round(4).tolist()} m from the base's"
                " pitch joint: place the trunk's origin between the hips"
            )


def add_feet(path: Path, urdf: str, model: pin.Model, feet: Sequence[str]) -> float:
    """Add frames at the centres of the feet's spheres.

    Args:
        path: of the URDF, for the message.
        urdf: its text, in which the collision shapes are.
        model: of the robot, made from this text; changed.
        feet: names of the two foot links.

    Returns:
        Radius of the spheres [m].

    Raises:
        RobotError: if a foot has not one sphere, or the radii differ.
    """
    try:
        geometry = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise RobotError(
            f"{path}: a collision mesh cannot be read ({str(error).strip().splitlines()[0]}): give"
            " another, or a box, cylinder or sphere"
        ) from None
    radii = set()
    for foot in feet:
        frame = foot_frame(model, foot)
        spheres = [
            g
            for g in geometry.geometryObjects
            if g.parentFrame == frame and hasattr(g.geometry, "radius")
        ]
        if len(spheres) != 1:
            raise RobotError(f"{path}: foot link {foot!r} must have one sphere as collision shape")
        add_foot_frame(model, foot, spheres[0].placement)
        radii.add(float(spheres[0].geometry.radius))
    if len(radii) != 1:
        raise RobotError(f"{path}: the feet have different radii {sorted(radii)}")
    return radii.pop()


def check_feet(path: Path, model: pin.Model, feet: Sequence[str]) -> None:
    """Check that two feet are named, and are there.

    Args:
        path: of the URDF, for the message.
        model: of the robot.
        feet: names of the foot links.

    Raises:
        RobotError: naming the foot that is not.
    """
    if len(feet) != 2:
        raise RobotError(f"{len(feet)} feet were named for {path}: a biped has two")
    for foot in feet:
        if not model.existFrame(foot, pin.FrameType.BODY):
            links = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
            raise RobotError(f"{path} has no foot link {foot!r}: its links are {links}")


def _near(given: Array, wanted: Array) -> bool:
    return bool(np.abs(given - wanted).max() <= _CLOSE)


def check_legs_apart(path: Path, feet: Sequence[str], legs: Sequence[Sequence[int]]) -> None:
    """Check that each foot has a leg of its own.

    Args:
        path: of the URDF, for the message.
        feet: names of the two foot links.
        legs: joints of each.

    Raises:
        RobotError: if they share a joint.
    """
    if set(legs[0]) & set(legs[1]):
        raise RobotError(f"{path}: feet {list(feet)} hang on the same leg: name one of each")
