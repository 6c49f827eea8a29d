"""Robot and ground as MuJoCo's MJCF, written from the Pinocchio model.

MuJoCo refuses links without mass, so the massless slides of the base become joints of the trunk:
joints of one body act one after another, as a chain does.
"""

from __future__ import annotations

from math import cos, sin
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
from template_control.robot.sole import sole_balls
from template_control.robot.terms import PLANAR_DOF

FOOT = "foot"
TRUNK = "trunk"
"""Beginnings of the names of shapes that touch the ground."""

_MASSLESS = 1e-12  # of the robot's mass
_HELD = 0.9999  # MuJoCo's largest impedance
_CORNER = 1e-3  # radius of the balls at the trunk's corners [m]
_ROOT = 1  # Pinocchio's index of the free flyer


def mjcf(robot: Biped, world: PlantOptions, contact_time: float) -> str:
    """The model as MuJoCo reads it; ``contact_time`` is the contacts' time constant [s].

    The joints have the names of Pinocchio's, the feet's spheres are ``foot0`` and ``foot1``, of
    soles ``foot0_0`` to ``foot1_3``, and the trunk's body and shapes begin with ``trunk``. Feet and
    a planar robot's trunk meet the ground; the other links, and the robot itself, do not.
    """
    root = Element("mujoco", model="plant")
    _add(root, "compiler", angle="radian", autolimits="true")
    option = _add(
        root,
        "option",
        timestep=repr(world.time_step),
        gravity=_text((0.0, 0.0, -robot.gravity)),
        cone="elliptic",  # the friction cone as it is, no pyramid in it
    )
    # A state that is no number any more is the controller's to refuse, not to be put back.
    _add(option, "flag", autoreset="disable")
    # A joint's stop gives as little as the ground.
    _add(_add(root, "default"), "joint", solreflimit=_text((contact_time, 1.0)))
    ground = _add(root, "worldbody")
    _add_ground(ground, world, contact_time)
    # MuJoCo weighs a contact's give by the robot's pose with all joints at their `ref`.
    add_robot = _add_planar if isinstance(robot, PlanarBiped) else _add_floating
    bodies = add_robot(ground, robot, world)
    for i, foot in enumerate(robot.feet):
        frame = robot.model.frames[foot_frame(robot.model, foot)]
        balls = {f"{FOOT}{i}": (frame.placement.translation, robot.foot_radius)}
        if robot.patches:
            found = sole_balls(robot.urdf, robot.model, foot)
            balls = {f"{FOOT}{i}_{k}": ball for k, ball in enumerate(found)}
        for name, (centre, radius) in balls.items():
            _add_ball(bodies[frame.parentJoint], name, _text(centre), radius)
    if isinstance(robot, PlanarBiped):
        for i, (x, z) in enumerate(trunk_corners(robot).T):
            centre = _text(np.array((x, 0.0, z)) @ robot.trunk_axes)
            _add_ball(bodies[PLANAR_DOF], f"{TRUNK}{i}", centre, _CORNER)
    return ElementTree.tostring(root, encoding="unicode")


def _add(parent: Element, tag: str, **attributes: str) -> Element:
    """A new element of ``parent``."""
    return ElementTree.SubElement(parent, tag, attributes)


def _text(values: ArrayLike) -> str:
    """Numbers as they are written in MJCF."""
    return " ".join(map(repr, np.asarray(values, dtype=float).tolist()))


def _add_ground(parent: Element, world: PlantOptions, contact_time: float) -> None:
    """A plane, and the pieces of ground that stand out of it."""
    how = {
        "priority": "1",  # the ground's friction and give count, not the robot's
        "condim": "3",
        "solref": _text((contact_time, 1.0)),
        "contype": "1",
        "conaffinity": "0",
    }
    height, stand_out = pieces(world.ground)
    slides = _text((world.friction, 0.0, 0.0))
    place = _text((0.0, 0.0, height))
    _add(parent, "geom", type="plane", size="0 0 1", pos=place, friction=slides, **how)
    for piece in stand_out:
        own = world.friction if piece.friction is None else piece.friction
        box = {
            "type": "box",
            "size": _text(piece.half_sides),
            "pos": _text(piece.centre),
            "quat": _text((cos(0.5 * piece.pitch), 0.0, sin(0.5 * piece.pitch), 0.0)),
            "friction": _text((own, 0.0, 0.0)),
        }
        _add(parent, "geom", **box, **how)


def _add_planar(ground: Element, robot: Biped, world: PlantOptions) -> dict[int, Element]:
    """One body, by Pinocchio's joint, for each link that has mass, with all joints above it."""
    model = robot.model
    axes = _axes(model)
    data, neutral = model.createData(), robot.neutral()
    pin.forwardKinematics(model, data, neutral)
    bodies: dict[int, Element] = {0: ground}
    waiting: dict[int, list[int]] = {0: []}  # joints above a link, which has no body of its own
    for joint in range(1, model.njoints):
        parent = model.parents[joint]
        chain = [*waiting.get(parent, []), joint]
        if model.inertias[joint].mass <= _MASSLESS * robot.mass:
            waiting[joint], bodies[joint] = chain, bodies[parent]
            continue
        pose = pin.SE3.Identity()
        for above in chain:
            pose = pose * data.liMi[above]
        name = TRUNK if joint == PLANAR_DOF else model.names[joint] + " link"
        body = _add(bodies[parent], "body", name=name, **_place(pose))
        here = pose.inverse()
        for above in chain:
            here = here * data.liMi[above]
            ref, hinge = float(neutral[above - 1]), above - 1 - PLANAR_DOF
            own = _hinge(robot, hinge, world.time_step) if hinge >= 0 else {}
            _add_joint(body, model, above, here, axes[:, above - 1], ref=ref, own=own)
        # The robot turns about the axis of its hinges only, where any rotation leaves the inertia
        # as it is. MuJoCo refuses the flat inertias of a planar model, whose other two axes have
        # none.
        axis, inertia = axes[3:, joint - 1], model.inertias[joint]
        about_y = _text((world.mass_scale * (axis @ inertia.inertia @ axis),) * 3)
        _add_inertia(body, inertia, world.mass_scale, diaginertia=about_y)
        bodies[joint] = body
    return bodies


def _add_floating(ground: Element, robot: Biped, world: PlantOptions) -> dict[int, Element]:
    """As :func:`_add_planar`, for a floating base."""
    model = robot.model
    data, neutral = model.createData(), robot.neutral()
    axes = pin.computeJointJacobians(model, data, neutral)
    bodies = {0: ground}
    for joint in range(_ROOT, model.njoints):
        name = TRUNK if joint == _ROOT else f"{model.names[joint]} link"
        body = _add(bodies[model.parents[joint]], "body", name=name, **_place(data.liMi[joint]))
        if joint == _ROOT:
            _add(body, "freejoint", name=TRUNK)
        else:
            axis = data.oMi[joint].rotation.T @ axes[3:, model.idx_vs[joint]]
            about = {"axis": _text(axis), "ref": repr(float(neutral[model.idx_qs[joint]]))}
            about |= _hinge(robot, joint - 1 - _ROOT, world.time_step)
            _add(body, "joint", name=model.names[joint], type="hinge", **about)
        i = world.mass_scale * model.inertias[joint].inertia
        moments = _text((i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]))
        _add_inertia(body, model.inertias[joint], world.mass_scale, fullinertia=moments)
        bodies[joint] = body
    return bodies


def _axes(model: pin.Model) -> Array:
    """(6, joints) linear and angular axis of each joint in its own frame."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    columns = [
        pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)[:, joint - 1]
        for joint in range(1, model.njoints)
    ]
    return np.array(columns).T


def _place(pose: pin.SE3) -> dict[str, str]:
    """Attributes that put an element somewhere in its parent."""
    x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
    return {"pos": _text(pose.translation), "quat": _text((w, x, y, z))}


def _add_joint(
    body: Element,
    model: pin.Model,
    joint: int,
    here: pin.SE3,
    axis: Array,
    *,
    ref: float,
    own: dict[str, str],
) -> None:
    """A joint of a body; ``here`` is its frame in the body's where its angle is ``ref``."""
    hinge = bool(np.any(axis[3:]))
    about = {
        "name": model.names[joint],
        "type": "hinge" if hinge else "slide",
        "axis": _text(here.rotation @ (axis[3:] if hinge else axis[:3])),
        "pos": _text(here.translation),
        "ref": repr(ref),
    }
    _add(body, "joint", **about, **own)


def _hinge(robot: Biped, joint: int, time_step: float) -> dict[str, str]:
    """Stops, damping and friction of a joint that has them; ``joint``: among the actuated ones."""
    found, stops = {}, robot.joint_range[joint]
    if np.abs(stops).max() < UNLIMITED:
        found["range"] = _text(stops)
    damping, friction = robot.joint_damping[joint], robot.joint_friction[joint]
    if damping > 0.0:
        found["damping"] = repr(float(damping))
    if friction > 0.0:
        found["frictionloss"] = repr(float(friction))
        # As stiff as MuJoCo allows: by default a joint that friction holds creeps.
        found["solreffriction"] = _text((2.0 * time_step, 1.0))
        found["solimpfriction"] = _text((_HELD, _HELD, 1e-3, 0.5, 2.0))
    return found


def _add_inertia(body: Element, inertia: pin.Inertia, scale: float, **moments: str) -> None:
    mass, place = repr(float(scale * inertia.mass)), _text(inertia.lever)
    _add(body, "inertial", mass=mass, pos=place, **moments)


def _add_ball(body: Element, name: str, centre: str, radius: float) -> None:
    """A sphere that meets the ground; ``centre`` as :func:`_text` writes it."""
    _add(
        body,
        "geom",
        name=name,
        type="sphere",
        size=repr(float(radius)),
        pos=centre,
        contype="0",
        conaffinity="1",
    )
