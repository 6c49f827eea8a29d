"""Robot and ground as MuJoCo's MJCF, written from the Pinocchio model.

MuJoCo refuses links without mass, so the massless slides of the base become joints of the trunk:
joints of one body act one after another, as a chain does.
"""

from __future__ import annotations

from functools import reduce
from math import cos, sin
from operator import mul
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from template_control.arrays import Array
from template_control.plant.agreement import trunk_corners
from template_control.plant.bullet import PlantOptions
from template_control.plant.terrain import pieces
from template_control.robot.biped import Biped
from template_control.robot.legs import foot_frame
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.requirements import UNLIMITED
from template_control.robot.sole import foot_balls
from template_control.robot.terms import PLANAR_DOF

FOOT = "foot"
TRUNK = "trunk"
"""Beginnings of the names of shapes that touch the ground."""

_MASSLESS = 1e-12  # of the robot's mass
_HELD = 0.9999  # MuJoCo's largest impedance
_CORNER = 1e-3  # radius of the balls at the trunk's corners [m]


def mjcf(robot: Biped, world: PlantOptions, contact_time: float) -> str:
    """The model as MuJoCo reads it; ``contact_time`` is the contacts' time constant [s].

    The joints have the names of Pinocchio's, the feet's spheres are ``foot0_0``, ``foot1_0`` and so
    on, and the trunk's body and shapes begin with ``trunk``. Feet and a planar robot's trunk meet
    the ground; the other links, and the robot itself, do not.
    """
    root = Element("mujoco", model="plant")
    _add(root, "compiler", angle="radian", autolimits="true")
    option = _add(
        root,
        "option",
        timestep=world.time_step,
        gravity=(0.0, 0.0, -robot.gravity),
        cone="elliptic",  # the friction cone as it is, no pyramid in it
    )
    # A state that is no number any more is the controller's to refuse, not to be put back.
    _add(option, "flag", autoreset="disable")
    # A joint's stop gives as little as the ground.
    _add(_add(root, "default"), "joint", solreflimit=(contact_time, 1.0))
    ground = _add(root, "worldbody")
    _add_ground(ground, world, contact_time)
    # MuJoCo weighs a contact's give by the robot's pose with all joints at their `ref`.
    bodies = _add_bodies(ground, robot, world)
    for i, foot in enumerate(robot.feet):
        joint = robot.model.frames[foot_frame(robot.model, foot)].parentJoint
        for k, (centre, radius) in enumerate(foot_balls(robot.urdf, robot.model, foot)):
            _add_ball(bodies[joint], f"{FOOT}{i}_{k}", centre, radius)
    if isinstance(robot, PlanarBiped):
        for i, (x, z) in enumerate(trunk_corners(robot)):
            centre = np.array((x, 0.0, z)) @ robot.trunk_axes
            _add_ball(bodies[PLANAR_DOF], f"{TRUNK}{i}", centre, _CORNER)
    return ElementTree.tostring(root, encoding="unicode")


def _add(parent: Element, tag: str, **attributes: ArrayLike) -> Element:
    """A new element of ``parent``, with texts and numbers as attributes."""
    element = ElementTree.SubElement(parent, tag)
    for name, value in attributes.items():
        if not isinstance(value, str):
            value = " ".join(map(repr, np.asarray(value, dtype=float).ravel().tolist()))
        element.set(name, value)
    return element


def _add_ground(parent: Element, world: PlantOptions, contact_time: float) -> None:
    """A plane, and the pieces of ground that stand out of it."""
    how: dict[str, ArrayLike] = {
        "priority": "1",  # the ground's friction and give count, not the robot's
        "condim": "3",
        "solref": (contact_time, 1.0),
        "contype": "1",
        "conaffinity": "0",
    }
    height, stand_out = pieces(world.ground)
    slides = world.friction, 0.0, 0.0
    _add(parent, "geom", type="plane", size="0 0 1", pos=(0, 0, height), friction=slides, **how)
    for piece in stand_out:
        own = world.friction if piece.friction is None else piece.friction
        box: dict[str, ArrayLike] = {
            "type": "box",
            "size": piece.half_sides,
            "pos": piece.centre,
            "quat": (cos(0.5 * piece.pitch), 0.0, sin(0.5 * piece.pitch), 0.0),
            "friction": (own, 0.0, 0.0),
        }
        _add(parent, "geom", **box, **how)


def _add_bodies(ground: Element, robot: Biped, world: PlantOptions) -> dict[int, Element]:
    """One body, by Pinocchio's joint, for each link that has mass, with all joints above it."""
    model, planar = robot.model, isinstance(robot, PlanarBiped)
    data, neutral = model.createData(), robot.neutral()
    columns = pin.computeJointJacobians(model, data, neutral)
    bodies: dict[int, Element] = {0: ground}
    waiting: dict[int, list[int]] = {0: []}  # joints above a link, which has no body of its own
    for joint in range(1, model.njoints):
        parent, inertia = model.parents[joint], model.inertias[joint]
        chain = [*waiting.get(parent, []), joint]
        if inertia.mass <= _MASSLESS * robot.mass:
            waiting[joint], bodies[joint] = chain, bodies[parent]
            continue
        pose = reduce(mul, (data.liMi[above] for above in chain))
        name = TRUNK if joint == robot.base_joints else f"{model.names[joint]} link"
        bodies[joint] = body = _add(bodies[parent], "body", name=name, **_place(pose))
        if joint == robot.base_joints and not planar:
            chain = []
            _add(body, "freejoint", name=TRUNK)
        here = pose.inverse()
        for above in chain:
            here = here * data.liMi[above] if above < joint else pin.SE3.Identity()
            linear, angular = columns[:, model.idx_vs[above]].reshape(2, 3)
            kind, along = ("hinge", angular) if angular.any() else ("slide", linear)
            axis = data.oMi[above].rotation.T @ along
            about: dict[str, ArrayLike] = {
                "axis": here.rotation @ axis,
                "pos": here.translation,
                "ref": neutral[model.idx_qs[above]],
            }
            if above > robot.base_joints:
                about |= _hinge(robot, above - 1 - robot.base_joints, world.time_step)
            _add(body, "joint", name=model.names[above], type=kind, **about)
        # A planar robot turns about the axis of its hinges only, where any rotation leaves the
        # inertia as it is. MuJoCo refuses its flat inertias, whose other two axes have none.
        tensor = world.mass_scale * inertia.inertia
        moments = {"fullinertia": np.append(tensor.diagonal(), tensor[np.triu_indices(3, 1)])}
        if planar:
            about_axis = world.mass_scale * (axis @ inertia.inertia @ axis)
            moments = {"diaginertia": np.full(3, about_axis)}
        mass = world.mass_scale * inertia.mass
        _add(body, "inertial", mass=mass, pos=inertia.lever, **moments)
    return bodies


def _place(pose: pin.SE3) -> dict[str, ArrayLike]:
    """Attributes that put an element somewhere in its parent."""
    x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
    return {"pos": pose.translation, "quat": (w, x, y, z)}


def _hinge(robot: Biped, joint: int, time_step: float) -> dict[str, ArrayLike]:
    """Stops, damping and friction of a joint that has them; ``joint``: among the actuated ones."""
    found: dict[str, ArrayLike] = {}
    stops = robot.joint_range[joint]
    if np.abs(stops).max() < UNLIMITED:
        found["range"] = stops
    damping, friction = robot.joint_damping[joint], robot.joint_friction[joint]
    if damping > 0.0:
        found["damping"] = damping
    if friction > 0.0:
        found["frictionloss"] = friction
        # As stiff as MuJoCo allows: by default a joint that friction holds creeps.
        found["solreffriction"] = 2.0 * time_step, 1.0
        found["solimpfriction"] = _HELD, _HELD, 1e-3, 0.5, 2.0
    return found


def _add_ball(body: Element, name: str, centre: Array, radius: float) -> None:
    """A sphere that meets the ground."""
    how = {"contype": "0", "conaffinity": "1"}
    _add(body, "geom", name=name, type="sphere", size=radius, pos=centre, **how)
