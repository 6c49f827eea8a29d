"""Soles: the rectangle on which a flat foot stands, found from its shapes or given."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive, Triple
from template_control.errors import RobotError
from template_control.robot.legs import (
    add_foot_frame,
    foot_frame,
    leg_hinges,
    leg_joints,
    straight_legs,
)
from template_control.robot.urdf import collision_shapes, named
from template_control.robot.urdf_edits import vector_text

_LEVEL = 2e-3  # points of a foot less than this above its lowest one belong to its sole [m]
_SMALLEST = 0.01  # half side of a sole [m]
_BENT = np.array([-0.2, 0.4, -0.2])  # of hip, knee and ankle [rad]: a walk's in the mean
_RIM = 64  # points of a cylinder's edge
_BALL = 5e-3  # radius of the spheres put at the corners of a sole [m]


@dataclass(frozen=True)
class Sole(Checked):
    """Sole of the left foot; the right foot's is its mirror image.

    Axes are the trunk's where all joints are at 0: x forward, y to the left, z up.

    Attributes:
        centre: of the rectangle, from the origin of the foot's link [m].
        half_sides: half of its length and of its width [m].
    """

    centre: Triple
    half_sides: tuple[Positive, Positive]


class Patch(NamedTuple):
    """Sole of one foot, as a contact of the robot."""

    # Of the toe in the frame of the foot's joint, with axes that are the trunk's where all joints
    # are at 0. The toe is the point of the sole that the template's toe stands for.
    placement: pin.SE3
    centre: Array  # (2,) x and y of the rectangle's centre from the toe [m]
    half_sides: Array  # (2,) of the rectangle [m]


def find_soles(path: Path, urdf: str, model: pin.Model, feet: Sequence[str]) -> list[Sole]:
    """Soles of all feet, from their collision shapes: rectangles around their lowest points.

    Spheres and capsules touch with the lowest points of their spheres; boxes, meshes and cylinders
    with their corners.
    """
    data, found = model.createData(), []
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    shapes = collision_shapes(path, urdf, model, "`sole`, or another shape").geometryObjects
    for foot in feet:
        frame = foot_frame(model, foot)
        points = [
            data.oMi[shape.parentJoint].act(shape.placement.act(point)) - (0.0, 0.0, radius)
            for shape in shapes
            if shape.parentFrame == frame
            for point, radius in _points(shape.geometry)
        ]
        if not points:
            raise RobotError(
                f"{path}: foot link {foot!r} has no collision shape that a sole could be found"
                " from: give `sole`"
            )
        low = np.array(points) - data.oMf[frame].translation
        low = low[low[:, 2] < low[:, 2].min() + _LEVEL]
        ends = low.min(axis=0), low.max(axis=0)
        half = 0.5 * (ends[1] - ends[0])[:2]
        if half.min() < _SMALLEST:
            raise RobotError(
                f"{path}: the lowest points of foot link {foot!r} are no rectangle to stand on, of"
                f" {2.0 * half[0]:.3g} m times {2.0 * half[1]:.3g} m: give `sole`, or load it"
                " without flat_feet"
            )
        centre = 0.5 * (ends[0] + ends[1])
        centre[2] = ends[0][2]
        found.append(Sole(centre, (float(half[0]), float(half[1]))))
    return found


def mirrored(sole: Sole) -> list[Sole]:
    """The soles of the left and the right foot."""
    return [sole, Sole(sole.centre * (1.0, -1.0, 1.0), sole.half_sides)]


def _points(body: object) -> list[tuple[Array, float]]:
    """Points of a shape in its own frame [m], each with the radius of a sphere about it [m]."""
    if isinstance(body, pin.hppfcl.BVHModelBase):
        return [(body.vertex(i), 0.0) for i in range(body.num_vertices)]
    if isinstance(body, pin.hppfcl.Box):
        return [(np.array(signs) * body.halfSide, 0.0) for signs in product((-1.0, 1.0), repeat=3)]
    if isinstance(body, pin.hppfcl.Sphere):
        return [(np.zeros(3), float(body.radius))]
    if isinstance(body, pin.hppfcl.Capsule | pin.hppfcl.Cylinder):  # about their z
        ends = [np.array((0.0, 0.0, side * body.halfLength)) for side in (-1.0, 1.0)]
        if isinstance(body, pin.hppfcl.Capsule):
            return [(end, float(body.radius)) for end in ends]
        turns = np.linspace(0.0, 2.0 * np.pi, _RIM, endpoint=False)
        rim = np.column_stack((np.cos(turns), np.sin(turns), 0.0 * turns)) * body.radius
        return [(end + point, 0.0) for end in ends for point in rim]
    return []


def with_balls(urdf: str, model: pin.Model, feet: Sequence[str], soles: Sequence[Sole]) -> str:
    """The text of a URDF whose feet stand on spheres alone: its own, or one at each corner.

    Engines then have four points of contact for each foot, which are where the sole's corners are.
    """
    robot = ET.fromstring(urdf)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    links = named(robot, "link")
    for foot, sole in zip(feet, soles, strict=True):
        link = links[foot]
        shapes = link.findall("collision")
        if shapes and all(shape.find("geometry/sphere") is not None for shape in shapes):
            continue
        for shape in shapes:
            link.remove(shape)
        turn = data.oMf[foot_frame(model, foot)].rotation.T
        for x, y in product((-1.0, 1.0), repeat=2):
            corner = sole.centre + np.array((x, y, _BALL)) * (*sole.half_sides, 1.0)
            collision = ET.SubElement(link, "collision")
            ET.SubElement(collision, "origin", xyz=vector_text(turn @ corner))
            ET.SubElement(ET.SubElement(collision, "geometry"), "sphere", radius=f"{_BALL:g}")
    return ET.tostring(robot, encoding="unicode")


def foot_balls(urdf: str, model: pin.Model, foot: str) -> list[tuple[Array, float]]:
    """Centres in the frame of a foot's joint [m] and radii [m] of the spheres it stands on."""
    geometry = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION)
    link = int(model.getFrameId(foot, pin.FrameType.BODY))
    return [
        (shape.placement.translation.copy(), float(shape.geometry.radius))
        for shape in geometry.geometryObjects
        if shape.parentFrame == link and hasattr(shape.geometry, "radius")
    ]


def add_soles(model: pin.Model, feet: Sequence[str], soles: Sequence[Sole]) -> tuple[Patch, ...]:
    """Add frames at the toes to a model; the contacts that stand there.

    The toe is as far ahead of the ankle as the CoM is of the hips on slightly bent legs, but on the
    sole: the robot's weight then is over its toe where the trunk is upright over the ankle.
    """
    legs = leg_joints(model, feet, 1)
    straight, data = straight_legs(model, feet, 1, flat=True), model.createData()
    hinges, q = [leg_hinges(model, leg, flat=True) for leg in legs], straight.q.copy()
    for leg in hinges:
        signs = np.sign(straight.axes[1, [model.idx_vs[joint] for joint in leg]])
        q[[model.idx_qs[joint] for joint in leg]] += signs * _BENT
    ahead = pin.centerOfMass(model, data, q)[0]
    ahead -= np.mean([data.oMi[hip].translation[0] for hip, *_ in hinges])
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    found = []
    for foot, sole, (*_, ankle) in zip(feet, soles, hinges, strict=True):
        frame = foot_frame(model, foot)
        joint = data.oMi[model.frames[frame].parentJoint]
        middle = data.oMf[frame].translation + sole.centre
        half = np.array(sole.half_sides)
        back = float(np.clip(middle[0] - data.oMi[ankle].translation[0] - ahead, -half[0], half[0]))
        toe = pin.SE3(np.eye(3), middle - (back, 0.0, 0.0))
        placement = joint.actInv(toe)
        add_foot_frame(model, foot, placement)
        found.append(Patch(placement, np.array([back, 0.0]), half))
    return tuple(found)
