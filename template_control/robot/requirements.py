"""What a URDF must have to be a planar biped of this library."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.errors import RobotError

BASE_DOF = 3
_BASE = ("JointModelPX", "JointModelPZ", "JointModelRY")
UNLIMITED = 1e20  # Pinocchio writes an absent limit as inf or as 1.8e308
_CLOSE = 1e-4  # [m]


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
    if tuple(kinds[:BASE_DOF]) != _BASE:
        first = list(zip(names, kinds, strict=True))[:BASE_DOF]
        raise RobotError(
            f"{path} is not planar: its first joints are {first},"
            " and must be prismatic x, prismatic z, revolute y; of a 3D robot, name the hips and"
            " knees as sagittal_joints"
        )
    hinged = all(joint.nq == joint.nv == 1 for joint in model.joints[1:])
    axes = pin.computeJointJacobians(model, model.createData(), pin.neutral(model))[4]
    for i, joint in enumerate(model.joints[1:]):
        lateral = not hinged or abs(abs(axes[i]) - 1.0) < 1e-6
        if i >= BASE_DOF and not (joint.nq == joint.nv == 1 and lateral):
            raise RobotError(
                f"{path} is not planar: joint {names[i]!r} is {kinds[i]},"
                " and must be revolute about y (with limits, not continuous)"
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
    for hip in hips:
        place = model.jointPlacements[hip].translation
        if np.hypot(place[0], place[2]) > _CLOSE:
            raise RobotError(
                f"{path}: hip {model.names[hip]!r} is {place.round(4).tolist()} m from the base's"
                " pitch joint: place the trunk's origin between the hips"
            )


def foot_radius_of(path: Path, urdf: str, model: pin.Model, feet: Sequence[str]) -> float:
    """Radius of the feet's spheres [m].

    Args:
        path: of the URDF, for the message.
        urdf: its text, in which the collision shapes are.
        model: of the robot, made from this text.
        feet: names of the two foot links.

    Raises:
        RobotError: if a foot has no sphere about its link's origin, or the radii differ.
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
        frame = model.getFrameId(foot)
        spheres = [
            g
            for g in geometry.geometryObjects
            if g.parentFrame == frame and hasattr(g.geometry, "radius")
        ]
        if len(spheres) != 1:
            raise RobotError(f"{path}: foot link {foot!r} must have one sphere as collision shape")
        centre = model.frames[frame].placement.actInv(spheres[0].placement).translation
        if np.hypot(centre[0], centre[2]) > _CLOSE:
            raise RobotError(
                f"{path}: the sphere of foot link {foot!r} is {centre.round(4).tolist()} m from the"
                " link's origin: put the origin into its centre"
            )
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
        if not model.existFrame(foot):
            links = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
            raise RobotError(f"{path} has no foot link {foot!r}: its links are {links}")


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
