"""What Pinocchio computes of a free biped, gathered in its heading frame in one call.

The heading frame is the world's, turned about the vertical and shifted. As in
:mod:`template_control.robot.planar_terms`, views into Pinocchio's data are taken once.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.robot.biped import carrying
from template_control.robot.joint_reserve import joint_reserve

Array = NDArray[np.float64]

BASE_DOF = 6


class FreeTerms(NamedTuple):
    """Arrays that :func:`gather` overwrites, in the heading frame: x forward, y left, z up.

    Attributes:
        com, com_velocity, com_bias: (3,) [m, m/s, m/s^2].
        com_jacobian: (3, nv).
        momentum: (3,) angular, about the CoM [N m s].
        momentum_jacobian: (3, nv).
        momentum_bias: (3,) [N m].
        foot: (2, 3) lowest points of the feet [m].
        foot_jacobian: (2, 3, nv).
        foot_bias: (2, 3) [m/s^2].
        turning: (3,) angular velocity of the trunk [rad/s].
        turning_jacobian: (3, nv); its bias is 0.
        joint_velocity: (nv - 6,) [rad/s].
    """

    com: Array
    com_velocity: Array
    com_bias: Array
    com_jacobian: Array
    momentum: Array
    momentum_jacobian: Array
    momentum_bias: Array
    foot: Array
    foot_jacobian: Array
    foot_bias: Array
    turning: Array
    turning_jacobian: Array
    joint_velocity: Array

    @classmethod
    def zeros(cls, nv: int) -> FreeTerms:
        """All zero.

        Args:
            nv: degrees of freedom.
        """
        three, rows = (3,), (3, nv)
        shapes: tuple[tuple[int, ...], ...] = (three, three, three, rows, three, rows, three)
        shapes = (*shapes, (2, 3), (2, 3, nv), (2, 3), three, rows, (nv - BASE_DOF,))
        return cls(*(np.zeros(shape) for shape in shapes))


Sources = tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]
"""Views into Pinocchio's data: vectors, matrices, the feet's centres; and what is constant."""


def sources(
    model: pin.Model,
    data: Any,
    frames: tuple[int, ...],
    radius: float,
    limits: tuple[Array, Array],
) -> Sources:
    """Views of what :func:`gather` reads.

    Args:
        model: the robot's.
        data: written by Pinocchio at every update.
        frames: of the two feet.
        radius: of the foot spheres [m].
        limits: of the joints, (nu,) speeds [rad/s] and (nu, 2) stops [rad].
    """
    vectors = (data.com[0], data.vcom[0], data.hg.vector, data.nle, data.g)
    matrices = (data.Jcom, data.Ag, data.J, data.oMi[1].rotation)
    feet = tuple(data.oMf[frame].translation for frame in frames)
    sizes = np.array([radius, pin.computeTotalMass(model)])
    constants = (carrying(model, frames), sizes, *limits)
    return vectors, matrices, feet, constants


@compiled
def gather(
    views: Sources,
    q: Array,
    v: Array,
    drift: tuple[Array, Array],
    frame: Array,
    out: tuple[Array, ...],
) -> tuple[bool, float, float]:
    """Write the terms at the state that Pinocchio has last computed.

    Args:
        views: from :func:`sources`.
        q: (nq,) the configuration.
        v: (nv,) the velocity.
        drift: of each foot's frame the (6,) classical acceleration dJ/dt v, linear then angular,
            in the world's axes [m/s^2, rad/s^2].
        frame: (4,) of the heading frame: x and y of its origin in the world [m], cosine and sine of
            the heading.
        out: the arrays of :class:`FreeTerms`, overwritten.

    Returns:
        Whether the state is finite; what
        :func:`~template_control.robot.joint_reserve.joint_reserve` returns.
    """
    vectors, matrices, feet, (carries, constants, limit, stops) = views
    centre, speed, momentum, effects, weight = vectors
    jcom_world, centroidal, jacobian, rotation = matrices
    com, com_velocity, com_bias, jcom, spin, jspin, spin_bias = out[:7]
    foot_position, foot_jacobian, foot_bias, turning, jturning, joint_velocity = out[7:]
    finite, nv = True, v.shape[0]
    for k in range(q.shape[0]):
        finite = finite and np.isfinite(q[k])
    for k in range(nv):
        finite = finite and np.isfinite(v[k])
    for k in range(limit.shape[0]):
        joint_velocity[k] = v[BASE_DOF + k]
    fastest, soonest = joint_reserve(q, joint_velocity, limit, stops)
    c, s, r, mass = frame[2], frame[3], constants[0], constants[1]
    x, y = centre[0] - frame[0], centre[1] - frame[1]
    com[0], com[1], com[2] = c * x + s * y, c * y - s * x, centre[2]
    com_velocity[0], com_velocity[1] = c * speed[0] + s * speed[1], c * speed[1] - s * speed[0]
    com_velocity[2] = speed[2]
    spin[0], spin[1] = c * momentum[3] + s * momentum[4], c * momentum[4] - s * momentum[3]
    spin[2] = momentum[5]
    for k in range(nv):
        jcom[0, k] = c * jcom_world[0, k] + s * jcom_world[1, k]
        jcom[1, k] = c * jcom_world[1, k] - s * jcom_world[0, k]
        jcom[2, k] = jcom_world[2, k]
        jspin[0, k] = c * centroidal[3, k] + s * centroidal[4, k]
        jspin[1, k] = c * centroidal[4, k] - s * centroidal[3, k]
        jspin[2, k] = centroidal[5, k]
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
    com_bias[0] = (c * force[0] + s * force[1]) / mass
    com_bias[1] = (c * force[1] - s * force[0]) / mass
    com_bias[2] = force[2] / mass
    spin_bias[0], spin_bias[1] = c * moment[0] + s * moment[1], c * moment[1] - s * moment[0]
    spin_bias[2] = moment[2]
    for i in range(2):
        px, py, pz = feet[i][0], feet[i][1], feet[i][2]
        x, y = px - frame[0], py - frame[1]
        foot_position[i, 0], foot_position[i, 1] = c * x + s * y, c * y - s * x
        foot_position[i, 2] = pz - r
        for k in range(nv):
            wx, wy, wz = jacobian[3, k], jacobian[4, k], jacobian[5, k]
            # Rolling without slip: the material point below the sphere's centre is at rest.
            jx = (jacobian[0, k] + wy * (pz - r) - wz * py) * carries[i, k]
            jy = (jacobian[1, k] + wz * px - wx * (pz - r)) * carries[i, k]
            foot_jacobian[i, 0, k], foot_jacobian[i, 1, k] = c * jx + s * jy, c * jy - s * jx
            foot_jacobian[i, 2, k] = (jacobian[2, k] + wx * py - wy * px) * carries[i, k]
        bx, by = drift[i][0] - r * drift[i][4], drift[i][1] + r * drift[i][3]
        foot_bias[i, 0], foot_bias[i, 1] = c * bx + s * by, c * by - s * bx
        foot_bias[i, 2] = drift[i][2]
    for k in range(3):
        jturning[0, 3 + k] = c * rotation[0, k] + s * rotation[1, k]
        jturning[1, 3 + k] = c * rotation[1, k] - s * rotation[0, k]
        jturning[2, 3 + k] = rotation[2, k]
    for i in range(3):
        turning[i] = 0.0
        for k in range(3):
            turning[i] += jturning[i, 3 + k] * v[3 + k]
    return finite, fastest, soonest
