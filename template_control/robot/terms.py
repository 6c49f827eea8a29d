"""Terms of the equations of motion that Pinocchio has computed, gathered in one call.

Pinocchio works in space and its arrays are read one at a time from Python, which takes ten
times as long as computing them. It keeps them in place, so views are taken once
(:func:`planar_sources`, :func:`floating_sources`), and compiled code reads all of them: of a planar
robot the sagittal part, of a floating-base one all in its heading frame, which is the world's,
turned about the vertical and shifted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.robot.legs import carrying

Array = NDArray[np.float64]

PLANAR_DOF = 3
"""Degrees of freedom of a planar robot's base: x, z and pitch."""

FLOATING_DOF = 6
"""Degrees of freedom of a floating base."""

PlanarSources = tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]
"""Views into Pinocchio's data: of the whole robot, of its feet, and what does not change.

Plain tuples: a compiled function is called with a named one in twice the time.
"""

FloatingSources = tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]
"""Views into Pinocchio's data: vectors, matrices, the feet's centres; and what is constant."""


@compiled
def joint_reserve(q: Array, speeds: Array, limits: Array, ranges: Array) -> tuple[float, float]:
    """Largest share of its limit that a joint's speed has, and the soonest arrival at a stop [s].

    The latter is 0 of a joint that is at its stop, inf where none moves. ``q`` ends in the nu
    angles; ``speeds``, ``limits`` (nu,) [rad/s]; ``ranges`` (nu, 2) [rad].
    """
    fastest, soonest = 0.0, np.inf
    first = q.shape[0] - speeds.shape[0]
    for k in range(speeds.shape[0]):
        speed = speeds[k]
        fastest = max(fastest, abs(speed) / limits[k])
        down, up = q[first + k] - ranges[k, 0], ranges[k, 1] - q[first + k]
        if down <= 0.0 or up <= 0.0:
            soonest = 0.0
        elif speed > 0.0:
            soonest = min(soonest, up / speed)
        elif speed < 0.0:
            soonest = min(soonest, -down / speed)
    return fastest, soonest


class PlanarTerms(NamedTuple):
    """Arrays that :func:`gather_planar` overwrites; those of a :class:`~.planar_biped.PlanarBiped`.

    Attributes:
        com, com_velocity, com_bias: (2,) [m, m/s, m/s^2].
        com_jacobian: (2, nv).
        angular_momentum_jacobian: (nv,).
        foot_position: (2, 2) [m].
        foot_jacobian: (2, 2, nv).
        foot_bias: (2, 2) [m/s^2].
        joint_velocity: (nv - 3,) [rad/s].
    """

    com: Array
    com_velocity: Array
    com_bias: Array
    com_jacobian: Array
    angular_momentum_jacobian: Array
    foot_position: Array
    foot_jacobian: Array
    foot_bias: Array
    joint_velocity: Array

    @classmethod
    def zeros(cls, nv: int) -> PlanarTerms:
        """All zero."""
        shapes = ((2,), (2,), (2,), (2, nv), (nv,), (2, 2), (2, 2, nv), (2, 2), (nv - PLANAR_DOF,))
        return cls(*(np.zeros(shape) for shape in shapes))


def planar_sources(
    model: pin.Model,
    data: Any,
    frames: tuple[int, ...],
    radius: float,
    limits: tuple[Array, Array],
) -> PlanarSources:
    """Views that :func:`gather_planar` reads; ``limits``: (nu,) [rad/s], (nu, 2) stops [rad]."""
    whole = (data.com[0], data.vcom[0], data.acom[0], data.hg.vector, data.nle, data.g)
    jacobians = (data.Jcom, data.Ag, data.J)
    feet = tuple(data.oMf[frame].translation for frame in frames)
    constants = (carrying(model, frames), np.array([radius]), *limits)
    return (*whole, *jacobians), feet, constants


@compiled
def gather_planar(
    views: PlanarSources, q: Array, v: Array, drift: tuple[Array, Array], out: tuple[Array, ...]
) -> tuple[bool, float, float, float, float]:
    """Write the planar terms at the state that Pinocchio has last computed.

    Args:
        views: from :func:`planar_sources`.
        q, v: (nv,) the state.
        drift: of each foot's frame the (6,) classical acceleration dJ/dt v, linear then angular,
            in the world's axes [m/s^2, rad/s^2].
        out: the arrays of :class:`PlanarTerms`, overwritten.

    Returns:
        Whether the state is finite; the angular momentum about the CoM, forward pitch
        positive [kg m^2/s], and its Jacobian's time derivative times v [N m]; what
        :func:`joint_reserve` returns.
    """
    whole, feet, (carries, radius, limit, stops) = views
    centre, speed, pull, momentum, effects, weight, com_jacobian, centroidal, jacobian = whole
    com, com_velocity, com_bias, jcom, jl, foot_position, foot_jacobian, foot_bias, turning = out
    finite = True
    for k in range(q.shape[0]):
        finite = finite and np.isfinite(q[k]) and np.isfinite(v[k])
    for k in range(limit.shape[0]):
        turning[k] = v[PLANAR_DOF + k]
    fastest, soonest = joint_reserve(q, turning, limit, stops)
    com[0], com[1] = centre[0], centre[2]
    com_velocity[0], com_velocity[1] = speed[0], speed[2]
    com_bias[0], com_bias[1] = pull[0], pull[2]
    for k in range(q.shape[0]):
        jcom[0, k], jcom[1, k] = com_jacobian[0, k], com_jacobian[2, k]
        jl[k] = centroidal[4, k]
    r = radius[0]
    for i in range(2):
        x, z = feet[i][0], feet[i][2]
        foot_position[i, 0], foot_position[i, 1] = x, z - r
        for k in range(q.shape[0]):
            turn = jacobian[4, k]
            # Rolling without slip: the material point below the sphere's centre is at rest.
            foot_jacobian[i, 0, k] = (jacobian[0, k] + turn * z - r * turn) * carries[i, k]
            foot_jacobian[i, 1, k] = (jacobian[2, k] - turn * x) * carries[i, k]
        foot_bias[i, 0] = drift[i][0] - r * drift[i][4]
        foot_bias[i, 1] = drift[i][2]
    # The base coordinates' rows of C v are the rates of linear momentum and of the angular
    # momentum about the base at zero acceleration; move the latter to the CoM.
    force_x = effects[0] - weight[0]
    force_z = effects[1] - weight[1]
    moment = effects[PLANAR_DOF - 1] - weight[PLANAR_DOF - 1]
    rate = moment - (com[1] - q[1]) * force_x + (com[0] - q[0]) * force_z
    return finite, momentum[4], rate, fastest, soonest


class FloatingTerms(NamedTuple):
    """Arrays that :func:`gather_floating` overwrites, in the heading frame, x forward and y left.

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
    def zeros(cls, nv: int) -> FloatingTerms:
        """All zero."""
        three, rows = (3,), (3, nv)
        shapes: tuple[tuple[int, ...], ...] = (three, three, three, rows, three, rows, three)
        shapes = (*shapes, (2, 3), (2, 3, nv), (2, 3), three, rows, (nv - FLOATING_DOF,))
        return cls(*(np.zeros(shape) for shape in shapes))


def floating_sources(
    model: pin.Model,
    data: Any,
    frames: tuple[int, ...],
    radius: float,
    limits: tuple[Array, Array],
) -> FloatingSources:
    """Views of what :func:`gather_floating` reads; ``limits`` as for :func:`planar_sources`."""
    vectors = (data.com[0], data.vcom[0], data.hg.vector, data.nle, data.g)
    matrices = (data.Jcom, data.Ag, data.J, data.oMi[1].rotation)
    feet = tuple(data.oMf[frame].translation for frame in frames)
    sizes = np.array([radius, pin.computeTotalMass(model)])
    constants = (carrying(model, frames), sizes, *limits)
    return vectors, matrices, feet, constants


@compiled
def gather_floating(
    views: FloatingSources,
    q: Array,
    v: Array,
    drift: tuple[Array, Array],
    frame: Array,
    out: tuple[Array, ...],
) -> tuple[bool, float, float]:
    """Write the terms at the state that Pinocchio has last computed.

    As :func:`gather_planar`; ``frame`` (4,) is the heading frame's: x and y of its origin in the
    world [m], cosine and sine of the heading. Returns whether the state is finite, and
    :func:`joint_reserve`'s two numbers.
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
        joint_velocity[k] = v[FLOATING_DOF + k]
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
