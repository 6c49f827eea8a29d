"""Legs and feet: joints and frames, lengths, and the angles at which legs hang straight down.

Only the joints' axes and the feet's points count, not the frames of the links nor the zeros of
the angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import atan2, cos, hypot, pi, sqrt
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from template_control.arrays import Array

HINGES = 2  # hip and knee, the last joints of a leg with a point foot
_PARALLEL = 1e-6  # 1 - cosine of the angle between two axes
_CENTRE = " sphere's centre"  # ends a frame's name
_EXACT = 1e-13  # of an axis' direction
_ITERATIONS = 30
_QUARTERS = (0.0, 0.5 * pi, pi, -0.5 * pi)  # where the search for a lateral hip begins [rad]


class StraightLegs(NamedTuple):
    """Legs that hang straight down from an upright trunk."""

    q: Array  # (nq,) configuration, with each hinge's angle next to the middle of its range
    # From the hip's axis to the foot, with a knee as straight as its range lets it be, of the leg
    # that reaches least [m].
    reach: float
    axes: Array  # (3, nv) directions of the joints' axes in the world, in q


def is_lateral(axis: Array) -> bool:
    """True if an axis (3,) is the lateral one, y, in either direction."""
    return bool(abs(abs(axis[1]) - 1.0) <= _PARALLEL)


def leg_hinges(model: pin.Model, leg: Sequence[int], flat: bool = False) -> tuple[int, ...]:
    """Pinocchio's joints that swing and bend a leg: hip and knee, its last two.

    Of a leg with a flat foot those about the lateral axis where all joints are at 0: hip, knee and
    ankle, among joints about other axes in any order.
    """
    if not flat:
        return tuple(leg[-HINGES:])
    axes = pin.computeJointJacobians(model, model.createData(), pin.neutral(model))[3:]
    return tuple(j for j in leg if is_lateral(axes[:, model.idx_vs[j]]))


def straight_legs(
    model: pin.Model, feet: Sequence[str], base_joints: int, flat: bool = False
) -> StraightLegs:
    """The configuration with straight legs, from a model whose neutral trunk is upright.

    The last two joints of a leg are hip and knee. Those above the hip are turned until its axis is
    lateral, if they can. A leg with a ``flat`` foot has hip, knee and ankle as :func:`leg_hinges`
    finds them, ends at its ankle, and stands on its sole, which is level where all joints are at 0.
    """
    data, q, legs = model.createData(), pin.neutral(model), leg_joints(model, feet, base_joints)
    if flat:
        for joint in set(range(2, model.njoints)).difference(*legs):
            place = model.idx_qs[joint]
            stops = model.lowerPositionLimit[place], model.upperPositionLimit[place]
            q[place] = min(max(0.0, stops[0]), stops[1])
    else:
        for leg in legs:
            _turn_lateral(model, data, q, leg)
    axes = np.array(pin.computeJointJacobians(model, data, q)[3:])
    pin.updateFramePlacements(model, data)
    reaches = []
    for leg, foot in zip(legs, feet, strict=True):
        hip, knee, *ankle = leg_hinges(model, leg, flat)
        thigh = data.oMi[knee].translation - data.oMi[hip].translation
        end = data.oMi[ankle[0]] if ankle else data.oMf[foot_frame(model, foot)]
        shank = end.translation - data.oMi[knee].translation
        upper, lower = hypot(thigh[0], thigh[2]), hypot(shank[0], shank[2])
        lean = atan2(-thigh[0], -thigh[2])
        bend = atan2(-shank[0], -shank[2]) - lean
        for joint, angle in ((hip, lean), (knee, bend)):
            sign = np.sign(axes[1, model.idx_vs[joint]])
            place = model.idx_qs[joint]
            q[place] = _in_range(model, joint, q[place] - sign * angle)
        for joint in ankle:
            q[model.idx_qs[joint]] += np.sign(axes[1, model.idx_vs[joint]]) * (lean + bend)
        low, high = model.lowerPositionLimit[place], model.upperPositionLimit[place]
        bend = float(max(low - q[place], q[place] - high, 0.0))  # the knee's, at the least
        folded = sqrt(upper**2 + lower**2 + 2.0 * upper * lower * cos(bend))
        reaches.append(folded if bend > 0.0 else upper + lower)
    return StraightLegs(q, min(reaches), np.array(pin.computeJointJacobians(model, data, q)[3:]))


def middle(model: pin.Model, joint: int) -> float:
    """Middle of a hinge's range [rad], 0 if it has none."""
    place = model.idx_qs[joint]
    half = 0.5 * model.lowerPositionLimit[place] + 0.5 * model.upperPositionLimit[place]
    return float(half) if np.isfinite(half) else 0.0


def _in_range(model: pin.Model, joint: int, angle: float) -> float:
    """The same angle [rad], by full turns next to the middle of the range."""
    turns = round((middle(model, joint) - angle) / (2.0 * pi))
    return angle + 2.0 * pi * turns


def _turn_lateral(model: pin.Model, data: pin.Data, q: Array, leg: Sequence[int]) -> None:
    """Turn the joints above a hip until its axis is lateral; q is overwritten if they can.

    Of several ways, the one next to the middles of their ranges is taken.
    """
    upper, hip = leg[:-HINGES], leg[-HINGES]
    places = [model.idx_qs[joint] for joint in upper]
    columns = [model.idx_vs[joint] for joint in upper]
    middles = np.array([middle(model, joint) for joint in upper])
    best, found = np.inf, q
    for start in product(_QUARTERS, repeat=len(upper)):
        tried = q.copy()
        tried[places] = start
        for _ in range(_ITERATIONS):
            axes = pin.computeJointJacobians(model, data, tried)[3:]
            axis = axes[:, model.idx_vs[hip]]
            error = axis[[0, 2]]
            if np.abs(error).max() < _EXACT:
                break
            slope = np.cross(axes[:, columns].T, axis).T[[0, 2]]
            tried[places] -= np.linalg.lstsq(slope, error, rcond=1e-9)[0]
        else:
            continue
        for place, joint in zip(places, upper, strict=True):
            tried[place] = _in_range(model, joint, tried[place])
        away = float(np.abs(tried[places] - middles).max(initial=0.0))
        if away < best - 1e-6:
            best, found = away, tried
    q[:] = found


def foot_frame(model: pin.Model, foot: str) -> int:
    """Pinocchio's frame at the centre of a foot's sphere, or of its link where none was added."""
    centre = foot + _CENTRE
    if model.existFrame(centre, pin.FrameType.OP_FRAME):
        return int(model.getFrameId(centre, pin.FrameType.OP_FRAME))
    return int(model.getFrameId(foot, pin.FrameType.BODY))


def add_foot_frame(model: pin.Model, foot: str, placement: pin.SE3) -> None:
    """Add the frame that :func:`foot_frame` finds, placed in its moving joint's frame."""
    frame = foot_frame(model, foot)
    joint = model.frames[frame].parentJoint
    kind = pin.FrameType.OP_FRAME
    model.addFrame(pin.Frame(foot + _CENTRE, joint, frame, placement, kind))


def leg_joints(model: pin.Model, feet: Sequence[str], base_joints: int) -> list[list[int]]:
    """Pinocchio's joints that move each foot and not the base, from the hip on."""
    parents = (model.frames[foot_frame(model, foot)].parentJoint for foot in feet)
    return [[j for j in model.supports[parent] if j > base_joints] for parent in parents]


def carrying(model: pin.Model, frames: Sequence[int]) -> Array:
    """(n, nv) of n feet: 1 where a velocity moves the foot, else 0."""
    carries = np.zeros((len(frames), model.nv))
    for row, frame in zip(carries, frames, strict=True):
        for joint in model.supports[model.frames[frame].parentJoint]:
            first = model.idx_vs[joint]
            row[first : first + model.nvs[joint]] = 1.0
    return carries
