"""Requirements of a URDF: what a planar or a floating-base biped of this library must have."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.errors import RobotError
from template_control.robot.legs import (
    HINGES,
    add_foot_frame,
    foot_frame,
    is_lateral,
    leg_hinges,
    leg_joints,
    straight_legs,
)
from template_control.robot.terms import LEGS, PLANAR_DOF
from template_control.robot.urdf import collision_shapes

UNLIMITED = 1e20  # Pinocchio writes an absent limit as inf or as 1.8e308
_TURNS, _DEGREES = 12.6, 360.0  # stops between two turns in radians and one in degrees
_CLOSE = 1e-4  # [m]
_ROOT = 1  # Pinocchio's index of the free flyer
_LEAST, _MOST = 3, 4  # joints of a floating-base robot's leg
_FLAT, _SWINGING = 6, 3  # joints of one with a flat foot, and those of them about y
# Mass over the cube of the leg's length [kg/m^3]: 20 of bolt, 110 of five-link; 100 times denser
# and lighter ones than those that are built, and a unit of g, cm or mm is out of it.
_DENSITY = (0.1, 2e4)


def _legs_apart(path: Path, model: pin.Model, feet: Sequence[str], base: int) -> list[list[int]]:
    """Joints of each foot's leg, beyond the base's; checks that feet and legs are there."""
    for foot in feet:
        if not model.existFrame(foot, pin.FrameType.BODY):
            links = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
            raise RobotError(f"{path} has no foot link {foot!r}: its links are {links}")
    legs = leg_joints(model, feet, base)
    for (one, leg), (other, another) in combinations(zip(feet, legs, strict=True), 2):
        if set(leg) & set(another):
            raise RobotError(f"{path}: feet {[one, other]} hang on the same leg: name one of each")
    return legs


def check_planar(path: Path, model: pin.Model, legs: int) -> None:
    """Check that base and legs are those of a planar biped with hips and knees, and have limits."""
    joints = [
        (name, joint.shortname()) for name, joint in zip(model.names, model.joints, strict=True)
    ]
    hinged = all(joint.nq == joint.nv == 1 for joint in model.joints[1 : PLANAR_DOF + 1])
    columns = pin.computeJointJacobians(model, model.createData(), pin.neutral(model))
    base = np.eye(6)[[0, 2, 4]].T  # in the world's axes, the pitch joint at its origin
    given = columns[:, :PLANAR_DOF]
    if not hinged or given.shape != base.shape or not _near(given[3:], base[3:]):
        raise RobotError(
            f"{path} is not planar: its first joints are {joints[1 : PLANAR_DOF + 1]},"
            " and must be prismatic x, prismatic z, revolute y; of a 3D robot, name the hips and"
            " knees as sagittal_joints"
        )
    own = slice(PLANAR_DOF + 1, None)
    for (name, kind), joint in zip(joints[own], model.joints[own], strict=True):
        if not joint.nq == joint.nv == 1 or not is_lateral(columns[3:, joint.idx_v]):
            raise RobotError(
                f"{path} is not planar: joint {name!r} is {kind},"
                " and must be revolute about y (with limits, not continuous)"
            )
    if not _near(given, base):
        raise RobotError(
            f"{path}: joint {joints[PLANAR_DOF][0]!r}, the base's pitch, is not at the world's"
            " origin with all joints at 0, or a slide is not along the world's x or z: give the"
            " base's joints no offset"
        )
    hinges = model.nv - PLANAR_DOF
    if legs not in (1, LEGS) or (legs == 1 and hinges == HINGES * LEGS):
        raise RobotError(f"{legs} feet were named for {path}: a biped has two, a monopod one")
    if hinges != HINGES * legs:
        raise RobotError(
            f"{path}: {hinges} hinges in its legs: a hip and a knee each is what is"
            f" controlled; name these {HINGES * legs} as sagittal_joints"
        )
    _check_limits(path, model, PLANAR_DOF + 1)
    for joint in range(PLANAR_DOF):  # the guide only holds the robot
        if model.damping[joint] > 0.0 or model.upperDryFrictionLimit[joint] > 0.0:
            raise RobotError(
                f"{path}: base joint {model.names[1 + joint]!r} has damping or friction: leave them"
                " out, as lossless does for all joints"
            )


def check_planar_legs(path: Path, model: pin.Model, feet: Sequence[str]) -> None:
    """Check that each foot has a hip and a knee of its own, and the trunk turns at the hips."""
    legs = _legs_apart(path, model, feet, PLANAR_DOF)
    for foot, leg in zip(feet, legs, strict=True):
        if not leg:
            raise RobotError(f"{path}: foot {foot!r} hangs on no leg: name the link at its end")
        if len(leg) != HINGES:
            raise RobotError(
                f"{path}: {len(leg)} joints move foot {foot!r}: name a hip and a knee of each leg"
            )
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    for hip, _ in legs:
        place = data.oMi[hip].translation - data.oMi[PLANAR_DOF].translation
        if np.hypot(place[0], place[2]) > _CLOSE:
            raise RobotError(
                f"{path}: hip {model.names[hip]!r} is {place.round(4).tolist()} m from the base's"
                " pitch joint: place the trunk's origin between the hips"
            )


def check_floating(path: Path, model: pin.Model, feet: Sequence[str], flat: bool) -> None:
    """Check that the legs of a robot with a free flyer place their feet, or turn ``flat`` ones."""
    if len(feet) not in (LEGS, 2 * LEGS):
        raise RobotError(
            f"{len(feet)} feet were named for {path}: a biped has two, a quadruped four"
        )
    legs = _legs_apart(path, model, feet, _ROOT)
    for joint, name in list(zip(model.joints, model.names, strict=True))[2:]:
        if joint.nq != 1 or joint.nv != 1:
            raise RobotError(
                f"{path}: joint {name!r} is {joint.shortname()}, and must be revolute with limits"
            )
    if model.inertias[_ROOT].mass <= 0.0:
        raise RobotError(
            f"{path}: the root link weighs nothing, and so does what is fixed to it: give the trunk"
            " an <inertial> with its mass"
        )
    if flat:
        _check_flat(path, model, feet, legs)
        _check_limits(path, model, _ROOT + 1)
        return
    most = _MOST if len(legs) == LEGS else _LEAST
    for leg, foot in zip(legs, feet, strict=True):
        if not _LEAST <= len(leg) <= most:
            raise RobotError(
                f"{path}: {len(leg)} joints move foot {foot!r}:"
                f" {'three or four' if most > _LEAST else 'three'} are needed, the last two of"
                " them hip and knee about the lateral axis"
            )
    axes = straight_legs(model, feet, _ROOT).axes
    for leg, foot in zip(legs, feet, strict=True):
        for joint in leg[-HINGES:]:
            if not is_lateral(axes[:, model.idx_vs[joint]]):
                raise RobotError(
                    f"{path}: joint {model.names[joint]!r} of foot {foot!r} does not turn about the"
                    " lateral axis y, as hip and knee must, the last two joints of a leg"
                )
    placing = {joint for leg in legs for joint in leg}
    others = [name for j, name in enumerate(model.names) if j > _ROOT and j not in placing]
    if others:
        raise RobotError(
            f"{path}: joints {others} are in no leg: make them fixed, or name them in `locked`"
        )
    _check_limits(path, model, _ROOT + 1)


def _check_flat(
    path: Path, model: pin.Model, feet: Sequence[str], legs: Sequence[Sequence[int]]
) -> None:
    """Check that legs with flat feet have hip, knee and ankle, and joints to turn a sole."""
    if len(feet) != LEGS:
        raise RobotError(f"{path}: {len(feet)} flat feet were named: a biped has two")
    for leg, foot in zip(legs, feet, strict=True):
        names = [model.names[joint] for joint in leg]
        if len(leg) != _FLAT:
            raise RobotError(
                f"{path}: {len(leg)} joints move flat foot {foot!r}, {names}: six are needed, by"
                " which a sole can be placed and turned"
            )
        hinges = [model.names[joint] for joint in leg_hinges(model, leg, flat=True)]
        if len(hinges) != _SWINGING:
            raise RobotError(
                f"{path}: with all joints at 0, {hinges} of flat foot {foot!r} turn about the"
                f" lateral axis y: three are needed, hip, knee and ankle, of {names}"
            )


def feet_of_legs(
    path: Path, model: pin.Model, feet: Sequence[str], groups: Sequence[Sequence[int]] | None
) -> tuple[tuple[int, ...], ...]:
    """The feet of each template leg, by their places in ``feet``: those given, if any.

    Else one each of a biped, and the diagonal pairs of a quadruped, first that of the left front.
    """
    if groups is not None:
        found = tuple(tuple(group) for group in groups)
        named = sorted(foot for group in found for foot in group)
        if len(found) != LEGS or named != list(range(len(feet))) or len({*map(len, found)}) > 1:
            raise RobotError(
                f"{path}: groups are {[list(group) for group in found]}: give two of as many feet,"
                f" each foot once, by the places 0 to {len(feet) - 1}"
            )
        return found
    if len(feet) == LEGS:
        return ((0,), (1,))
    data = model.createData()
    pin.framesForwardKinematics(model, data, straight_legs(model, feet, _ROOT).q)
    x, y = np.array([data.oMf[foot_frame(model, foot)].translation[:2] for foot in feet]).T
    first = np.flatnonzero((x > x.mean()) == (y > y.mean()))
    other = np.flatnonzero((x > x.mean()) != (y > y.mean()))
    if len(first) != len(other):
        raise RobotError(
            f"{path}: feet {list(feet)} are not at the corners of a rectangle: give groups"
        )
    return tuple(map(int, first)), tuple(map(int, other))


_LIMITS = {"effort": "its torque limit", "velocity": "the speed [rad/s] that it can have"}


def _check_limits(path: Path, model: pin.Model, first: int) -> None:
    """Check that the joints from ``first`` on have limits of torque and speed, stops in radians."""
    joints = range(first, model.njoints)
    for joint in joints:
        place = model.idx_qs[joint]
        low, high = model.lowerPositionLimit[place], model.upperPositionLimit[place]
        if _TURNS < max(abs(low), abs(high)) <= _DEGREES:
            raise RobotError(
                f"{path}: joint {model.names[joint]!r} goes from {low:g} to {high:g} rad, which"
                " look like degrees: give its limits in radians, or make it continuous"
            )
    for kind, limits in (("effort", model.effortLimit), ("velocity", model.velocityLimit)):
        for joint in joints:
            limit = limits[model.idx_vs[joint]]
            if not 0.0 < limit < UNLIMITED:
                raise RobotError(
                    f"{path}: joint {model.names[joint]!r} has {kind} {limit}: give {_LIMITS[kind]}"
                )


def _near(given: Array, wanted: Array) -> bool:
    return bool(np.abs(given - wanted).max() <= _CLOSE)


def add_feet(path: Path, urdf: str, model: pin.Model, feet: Sequence[str]) -> float:
    """Add frames at the centres of the feet's spheres to the model; their radius [m]."""
    mend = "another, or a box, cylinder or sphere"
    shapes = collision_shapes(path, urdf, model, mend).geometryObjects
    radii = set()
    for foot in feet:
        frame = foot_frame(model, foot)
        spheres = [g for g in shapes if g.parentFrame == frame and hasattr(g.geometry, "radius")]
        if len(spheres) != 1:
            raise RobotError(f"{path}: foot link {foot!r} must have one sphere as collision shape")
        add_foot_frame(model, foot, spheres[0].placement)
        radii.add(float(spheres[0].geometry.radius))
    if len(radii) != 1:
        raise RobotError(f"{path}: the feet have different radii {sorted(radii)}")
    return radii.pop()


def check_size(path: Path, mass: float, leg_length: float, foot_radius: float) -> None:
    """Check that mass [kg], legs [m] and feet's radius [m] could be those of one robot."""
    if 2.0 * foot_radius > leg_length:
        raise RobotError(
            f"{path}: feet of {foot_radius:.4g} m radius are larger than the legs, of"
            f" {leg_length:.4g} m: give a smaller radius"
        )
    low, high = _DENSITY
    if not low <= mass / leg_length**3 <= high:
        raise RobotError(
            f"{path}: a mass of {mass:.4g} kg and legs of {leg_length:.4g} m do not fit each other:"
            " write masses in kg and lengths in m, not in g or mm"
        )
