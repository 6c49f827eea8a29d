"""Terms of the equations of motion that Pinocchio has computed, gathered in one call.

Pinocchio works in space and its arrays are read one at a time from Python, which takes ten
times as long as computing them. It keeps them in place, so views are taken once
(:func:`sources`), and compiled code reads all of them: of a planar robot the sagittal part, of a
floating-base one all in its heading frame, which is the world's, turned about the vertical and
shifted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.robot.legs import carrying

PLANAR_DOF = 3
"""Degrees of freedom of a planar robot's base: x, z and pitch."""

FLOATING_DOF = 6
"""Degrees of freedom of a floating base."""

LEGS = 2
"""Legs of the template, each a group of a robot's contacts."""

PATCH = 6
"""Rows of a contact that is a patch: those of its point, and its angular velocity."""

MOST_CONTACTS = 8
"""Contacts that a robot may have: room for as many is in the memory that compiled code shares."""

MOST_SPARE = 32
"""Joints that a robot may have which place no foot, for the same reason."""

UP = 2
"""Index of the vertical direction; 0 is forward, 1 to the left."""

_F, _I = np.float64, np.int64

ROBOT_DATA = np.dtype(
    [
        # -- constant --
        ("mass", _F),  # of the whole robot [kg]
        ("gravity", _F),  # [m/s^2]
        ("foot_radius", _F),  # of the foot spheres [m]
        ("leg_length", _F),  # from hip to the foot sphere's centre with a straight knee [m]
        ("toe_ahead", _F),  # of the ankle, of flat feet; 0 of point feet [m]
        ("ankle_height", _F),  # over a sole, of flat feet; 0 of point feet [m]
        ("hip_side", _F, (LEGS,)),  # y of a flat foot below its hip, from the hips' middle [m]
        ("leg_lean", _F),  # to a side with a level sole: tangent of the angle; inf of point feet
        ("sway", _F),  # speed of the CoM to the left over that with the momentum; 1 of point feet
        ("contacts", _I),  # number of points that may touch the ground
        ("members", _I, (LEGS,)),  # number of contacts in the group of each template leg
        ("group", _I, (LEGS, MOST_CONTACTS)),  # which
        ("sole_centre", _F, (MOST_CONTACTS, 2)),  # of each patch from its toe, in its axes [m]
        ("sole_half", _F, (MOST_CONTACTS, 2)),  # half sides of each patch [m]
        ("spare", _I),  # number of spare joints
        ("spare_joint", _I, (MOST_SPARE,)),  # their indices among the actuated joints
        ("spare_angle", _F, (MOST_SPARE,)),  # where they rest [rad]
        # -- at the last update: forward, left, up; a planar robot's left is 0 --
        ("com", _F, (3,)),  # centre of mass [m]
        ("com_velocity", _F, (3,)),  # [m/s]
        ("com_bias", _F, (3,)),  # dJ/dt v of its Jacobian [m/s^2]
        ("momentum", _F, (3,)),  # angular, about the CoM, by axis: pitch is 1 [N m s]
        ("momentum_bias", _F, (3,)),  # dA/dt v of its matrix [N m]
        ("contact_position", _F, (MOST_CONTACTS, 3)),  # lowest points of the spheres [m]
        # Of the material points there, and the angular velocities of patches [m/s, rad/s].
        ("contact_velocity", _F, (MOST_CONTACTS, PATCH)),
        # dJ/dt v of their Jacobians, of points rolling [m/s^2, rad/s^2].
        ("contact_bias", _F, (MOST_CONTACTS, PATCH)),
        ("contact_axes", _F, (MOST_CONTACTS, 3, 3)),  # of each patch, in columns
        ("foot_position", _F, (LEGS, 3)),  # of each template leg: the mean of its contacts [m]
        ("foot_velocity", _F, (LEGS, 3)),  # the same [m/s]
        # Roll and pitch of the trunk in the heading frame, and its yaw from where it is to face.
        ("attitude", _F, (3,)),  # [rad]
        # From the heading to where the trunk is to face, to the left [rad]. A planar robot's trunk
        # faces the world's x, and the robot goes there or, with half a turn, the other way.
        ("facing", _F),
        ("turning", _F, (3,)),  # angular velocity of the trunk, by axis [rad/s]
        ("hips", _F, (3,)),  # the point the legs hang from [m]
        ("hip_speed", _F),  # its forward velocity [m/s]
        ("fastest", _F),  # largest share of its limit that a joint's speed has
        ("soonest_stop", _F),  # shortest time to a joint's stop at its speed [s]; inf: none moves
    ],
    align=True,
)
"""State of a robot in its sagittal or heading frame, for compiled code and Python alike."""


class Jacobians(NamedTuple):
    """Matrices of the model at its last update, which Pinocchio or :func:`gather_planar` writes."""

    mass_matrix: Array  # (nv, nv) M(q)
    nonlinear_effects: Array  # (nv,) C(q, v) v + g(q), and the joints' damping [N, N m]
    com: Array  # (d, nv) maps v to the CoM's velocity, d the directions
    momentum: Array  # (1, nv) or (3, nv) angular momentum about the CoM: pitch, or all axes
    contact: Array  # (n, d, nv) maps v to each contact's velocity; (n, 6, nv) of patches
    turning: Array  # (0, nv) or (3, nv) angular velocity of a floating trunk; its bias is 0
    joints: Array  # (2, nu) angles and velocities of the actuated joints [rad, rad/s]

    @classmethod
    def zeros(
        cls, data: Any, directions: int, base_dof: int, contacts: int, rows: int
    ) -> Jacobians:
        """All zero but for what Pinocchio writes; ``rows`` are those of a contact."""
        nv, axes = len(data.nle), 3 if directions > UP else 1
        shapes = ((directions, nv), (axes, nv), (contacts, rows, nv), (axes // 3 * 3, nv))
        found = [np.zeros(shape) for shape in (*shapes, (2, nv - base_dof))]
        return cls(data.M, data.nle, *found)


def sources(model: pin.Model, data: Any, frames: tuple[int, ...], limits: Array) -> tuple[Any, ...]:
    """Views that :func:`gather_planar` reads in Pinocchio's data, which every update writes.

    The sixth are those of :func:`move_point`: place, rotation, velocity and acceleration of each
    contact's joint, and place and rotation of the contact's frame on it. ``limits`` (4, nu) are the
    joints' largest speeds, lower and upper stops, damping [rad/s, rad, N m s/rad].
    """
    whole = (data.com[0], data.vcom[0], data.acom[0], data.hg.vector, data.g)
    bodies = [(model.frames[frame].parentJoint, model.frames[frame].placement) for frame in frames]
    points = (
        tuple(data.oMi[joint].translation for joint, _ in bodies),
        tuple(data.oMi[joint].rotation for joint, _ in bodies),
        tuple(data.v[joint].vector for joint, _ in bodies),
        tuple(data.a[joint].vector for joint, _ in bodies),
        np.array([placement.translation for _, placement in bodies]).reshape(-1, 3),
        np.array([placement.rotation for _, placement in bodies]).reshape(-1, 3, 3),
    )
    return (*whole, points, data.Jcom, data.Ag, data.J, carrying(model, frames), limits)


@compiled
def turned(rotation: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector times a rotation (3, 3), summed up in Pinocchio's order: both are the same bits."""
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z,
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z,
        rotation[2, 0] * x + (rotation[2, 1] * y + rotation[2, 2] * z),
    )


@compiled
def move_point(points: Any, i: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Where the frame of contact ``i`` is (3), and its classical acceleration dJ/dt v (6).

    With the joint's place p and rotation R in the world, its velocity (v, w) and acceleration
    dJ/dt v = (a, b) in its own axes, and the frame's origin r in them:

        p + R r,    R (a + b x r) + R w x R (v + w x r),    R b

    Both are in the world's axes, the acceleration linear, then angular.
    """
    origin, rotation, v, a, r = points[0][i], points[1][i], points[2][i], points[3][i], points[4][i]
    x, y, z = turned(rotation, r[0], r[1], r[2])
    vx, vy, vz = turned(
        rotation,
        v[0] + (v[4] * r[2] - v[5] * r[1]),
        v[1] + (v[5] * r[0] - v[3] * r[2]),
        v[2] + (v[3] * r[1] - v[4] * r[0]),
    )
    wx, wy, wz = turned(rotation, v[3], v[4], v[5])
    ax, ay, az = turned(
        rotation,
        a[0] + (a[4] * r[2] - a[5] * r[1]),
        a[1] + (a[5] * r[0] - a[3] * r[2]),
        a[2] + (a[3] * r[1] - a[4] * r[0]),
    )
    place = x + origin[0], y + origin[1], z + origin[2]
    moving = ax + (wy * vz - wz * vy), ay + (wz * vx - wx * vz), az + (wx * vy - wy * vx)
    return place, (*moving, *turned(rotation, a[3], a[4], a[5]))


@compiled
def joint_reserve(q: Array, speeds: Array, limits: Array) -> tuple[float, float]:
    """Largest share of its limit that a joint's speed has, and the soonest arrival at a stop [s].

    The latter is 0 of a joint that is at its stop, inf where none moves. ``q`` ends in the angles.
    """
    fastest, soonest = 0.0, np.inf
    first = q.shape[0] - speeds.shape[0]
    for k in range(speeds.shape[0]):
        speed = speeds[k]
        fastest = max(fastest, abs(speed) / limits[0, k])
        down, up = q[first + k] - limits[1, k], limits[2, k] - q[first + k]
        if down <= 0.0 or up <= 0.0:
            soonest = 0.0
        elif speed > 0.0:
            soonest = min(soonest, up / speed)
        elif speed < 0.0:
            soonest = min(soonest, -down / speed)
    return fastest, soonest


@compiled
def gather_joints(
    q: Array, v: Array, limits: Array, state: Any, effects: Array, joints: Array
) -> bool:
    """Write the joints' state and reserve, and add their damping; whether all is finite."""
    finite, nu, nv = True, joints.shape[1], v.shape[0]
    for k in range(q.shape[0]):
        finite = finite and np.isfinite(q[k])
    for k in range(nv):
        finite = finite and np.isfinite(v[k])
    for k in range(nu):
        joints[0, k], joints[1, k] = q[q.shape[0] - nu + k], v[nv - nu + k]
        if limits[3, k] != 0.0:
            effects[nv - nu + k] += limits[3, k] * v[nv - nu + k]
    state.fastest, state.soonest_stop = joint_reserve(q, joints[1], limits)
    return finite


@compiled
def _level(frame: Array, x: float, y: float) -> tuple[float, float]:
    """A horizontal vector of the world in a robot's ``heading_frame``."""
    return frame[2] * x + frame[3] * y, frame[2] * y - frame[3] * x


@compiled
def onward(facing: float) -> float:
    """1 of a robot that goes where its trunk faces; -1 of one that goes backward."""
    return 1.0 if np.cos(facing) > 0.0 else -1.0


@compiled
def gather_planar(kept: Any, q: Array, v: Array) -> bool:
    """Write the planar terms at the state that Pinocchio has last computed; True if it is finite.

    They are of the frame whose x points where the robot goes, as ``facing`` of the data says: the
    world's, or that turned by half a turn about the vertical. ``kept`` are the views of
    :func:`sources`, ``ROBOT_DATA`` and most of :class:`Jacobians`, which are overwritten.
    """
    views, data, out = kept.value
    centre, speed, pull, momentum, weight, points = views[:6]
    com_jacobian, centroidal, jacobian, carries, limits = views[6:]
    effects, jcom, jspin, contact, _, joints = out
    s = data[0]
    finite, on = gather_joints(q, v, limits, s, effects, joints), onward(s.facing)
    s.com[0], s.com[UP] = on * centre[0], centre[2]
    s.com_velocity[0], s.com_velocity[UP] = on * speed[0], speed[2]
    s.com_bias[0], s.com_bias[UP] = on * pull[0], pull[2]
    for k in range(q.shape[0]):
        jcom[0, k], jcom[1, k] = on * com_jacobian[0, k], com_jacobian[2, k]
        jspin[0, k] = on * centroidal[4, k]
    r, moving = s.foot_radius, np.empty(2)
    for i in range(contact.shape[0]):
        (x, _, z), drift = move_point(points, i)
        s.contact_position[i, 0], s.contact_position[i, UP] = on * x, z - r
        for k in range(q.shape[0]):
            turn = jacobian[4, k]
            # Rolling without slip: the material point below the sphere's centre is at rest.
            contact[i, 0, k] = on * (jacobian[0, k] + turn * z - r * turn) * carries[i, k]
            contact[i, 1, k] = (jacobian[2, k] - turn * x) * carries[i, k]
        s.contact_bias[i, 0] = on * (drift[0] - r * drift[4])
        s.contact_bias[i, UP] = drift[2]
        np.dot(contact[i], v, moving)
        s.contact_velocity[i, 0], s.contact_velocity[i, UP] = moving[0], moving[1]
    _gather_feet(s)
    # The base coordinates' rows of C v are the rates of linear momentum and of the angular
    # momentum about the base at zero acceleration; move the latter to the CoM.
    force_x = effects[0] - weight[0]
    force_z = effects[1] - weight[1]
    moment = effects[PLANAR_DOF - 1] - weight[PLANAR_DOF - 1]
    s.momentum[1] = on * momentum[4]
    turning = moment - (s.com[UP] - q[1]) * force_x + (centre[0] - q[0]) * force_z
    s.momentum_bias[1] = on * turning
    s.attitude[1], s.turning[1] = on * q[PLANAR_DOF - 1], on * v[PLANAR_DOF - 1]
    s.hips[0], s.hips[UP], s.hip_speed = on * q[0], q[1], on * v[0]
    return finite


@compiled
def _gather_feet(s: Any) -> None:
    """Write the means over the groups of contacts; a leg without any stays at the origin."""
    for leg in range(LEGS):
        members = s.members[leg]
        if members == 0:
            continue
        for k in range(3):
            place, speed = 0.0, 0.0
            for i in range(members):
                contact = s.group[leg, i]
                place += s.contact_position[contact, k]
                speed += s.contact_velocity[contact, k]
            s.foot_position[leg, k], s.foot_velocity[leg, k] = place / members, speed / members


@compiled
def gather_floating(kept: Any, q: Array, v: Array) -> bool:
    """Write the terms at the state that Pinocchio has last computed, in the heading frame.

    As :func:`gather_planar`; ``kept`` has last the robot's ``heading_frame``,
    views of the trunk's rotation to the world, of the places in the world and axes of each hip's
    joint, and a point of each hip's axis in the plane in which the leg swings [m].
    """
    views, data, out, base = kept.value
    centre, speed, _, momentum, weight, points = views[:6]
    jcom_world, centroidal, jacobian, carries, limits = views[6:]
    effects, jcom, jspin, contact, jturning, joints = out
    frame, trunk = base
    rotation, st, nv = trunk[0], data[0], v.shape[0]
    finite = gather_joints(q, v, limits, st, effects, joints)
    r = st.foot_radius
    st.com[0], st.com[1] = _level(frame, centre[0] - frame[0], centre[1] - frame[1])
    st.com_velocity[0], st.com_velocity[1] = _level(frame, speed[0], speed[1])
    st.momentum[0], st.momentum[1] = _level(frame, momentum[3], momentum[4])
    st.com[2], st.com_velocity[2], st.momentum[2] = centre[2], speed[2], momentum[5]
    for k in range(nv):
        jcom[0, k], jcom[1, k] = _level(frame, jcom_world[0, k], jcom_world[1, k])
        jspin[0, k], jspin[1, k] = _level(frame, centroidal[3, k], centroidal[4, k])
        jcom[2, k], jspin[2, k] = jcom_world[2, k], centroidal[5, k]
    # Of the free flyer the rows of C v are, in the trunk's axes, the rates of linear momentum and
    # of the angular momentum about the base at zero acceleration; move the latter to the CoM.
    force, moment = np.zeros(3), np.zeros(3)
    for i in range(3):
        for k in range(3):
            force[i] += rotation[i, k] * (effects[k] - weight[k])
            moment[i] += rotation[i, k] * (effects[3 + k] - weight[3 + k])
    ax, ay, az = centre[0] - q[0], centre[1] - q[1], centre[2] - q[2]
    moment[0] -= ay * force[2] - az * force[1]
    moment[1] -= az * force[0] - ax * force[2]
    moment[2] -= ax * force[1] - ay * force[0]
    st.momentum_bias[0], st.momentum_bias[1] = _level(frame, moment[0], moment[1])
    st.momentum_bias[2] = moment[2]
    force[0], force[1] = _level(frame, force[0], force[1])
    for i in range(3):
        st.com_bias[i] = force[i] / st.mass
    patches = contact.shape[1] == PATCH
    for i in range(contact.shape[0]):
        (px, py, pz), drift = move_point(points, i)
        at, speeds = st.contact_position[i], st.contact_velocity[i]
        at[0], at[1] = _level(frame, px - frame[0], py - frame[1])
        at[2] = pz - r
        speeds[:] = 0.0
        for k in range(nv):
            if carries[i, k] == 0.0:
                continue
            wx, wy, wz = jacobian[3, k], jacobian[4, k], jacobian[5, k]
            # Rolling without slip: the material point below the sphere's centre is at rest.
            jx = jacobian[0, k] + wy * (pz - r) - wz * py
            jy = jacobian[1, k] + wz * px - wx * (pz - r)
            contact[i, 0, k], contact[i, 1, k] = _level(frame, jx, jy)
            contact[i, 2, k] = jacobian[2, k] + wx * py - wy * px
            if patches:
                contact[i, 3, k], contact[i, 4, k] = _level(frame, wx, wy)
                contact[i, 5, k] = wz
            for row in range(contact.shape[1]):
                speeds[row] += contact[i, row, k] * v[k]
        bias = st.contact_bias[i]
        bias[0], bias[1] = _level(frame, drift[0] - r * drift[4], drift[1] + r * drift[3])
        bias[2] = drift[2]
        if patches:
            _gather_patch(st, i, drift, frame, points)
    _gather_feet(st)
    for k in range(3):
        jturning[0, 3 + k], jturning[1, 3 + k] = _level(frame, rotation[0, k], rotation[1, k])
        jturning[2, 3 + k] = rotation[2, k]
    for i in range(3):
        st.turning[i] = 0.0
        for k in range(3):
            st.turning[i] += jturning[i, 3 + k] * v[3 + k]
    _gather_trunk(q, v, st, frame, trunk)
    return finite


@compiled
def _gather_patch(s: Any, patch: int, drift: tuple[float, ...], frame: Array, points: Any) -> None:
    """Write the angular drift of a patch, and its axes."""
    own, axes, bias = points[5][patch], s.contact_axes[patch], s.contact_bias[patch]
    bias[3], bias[4] = _level(frame, drift[3], drift[4])
    bias[5] = drift[5]
    for k in range(3):
        x, y, axes[2, k] = turned(points[1][patch], own[0, k], own[1, k], own[2, k])
        axes[0, k], axes[1, k] = _level(frame, x, y)


@compiled
def _gather_trunk(q: Array, v: Array, state: Any, frame: Array, trunk: tuple[Any, ...]) -> None:
    """Write how the trunk stands, and where its hips are."""
    rotation, places, axes, points = trunk
    ahead, left = _level(frame, rotation[0, 2], rotation[1, 2])
    state.attitude[0] = np.arctan2(-left, rotation[2, 2])
    state.attitude[1] = np.arctan2(ahead, rotation[2, 2])
    ahead, left = _level(frame, rotation[0, 0], rotation[1, 0])
    c2, s2 = np.cos(state.facing), np.sin(state.facing)
    state.attitude[2] = np.arctan2(c2 * left - s2 * ahead, c2 * ahead + s2 * left)
    middle = np.zeros(3)
    for i in range(len(places)):
        place, point = places[i], turned(axes[i], points[i, 0], points[i, 1], points[i, 2])
        for k in range(3):
            middle[k] += place[k] + point[k]
    for k in range(3):
        middle[k] /= len(places)
    hips = state.hips
    hips[0], hips[1] = _level(frame, middle[0] - frame[0], middle[1] - frame[1])
    hips[2] = middle[2]
    # The hips move with the trunk, whose origin is elsewhere.
    moving = turned(rotation, v[0], v[1], v[2])
    level = _level(frame, moving[0], moving[1])[0] + state.turning[1] * (middle[2] - q[2])
    state.hip_speed = level - state.turning[2] * frame[4]
