"""The sagittal part of what Pinocchio computes, gathered in one call.

Pinocchio works in space and its arrays are read one at a time from Python, which takes ten
times as long as computing them. It keeps them in place, so :func:`sources` takes views once,
and :func:`gather` reads all of them in compiled code.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.robot.biped import carrying
from template_control.robot.joint_reserve import joint_reserve
from template_control.robot.requirements import BASE_DOF

Array = NDArray[np.float64]


class PlanarTerms(NamedTuple):
    """Arrays that :func:`gather` overwrites; those of a :class:`~.planar_biped.PlanarBiped`.

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
        """All zero.

        Args:
            nv: degrees of freedom.
        """
        shapes = ((2,), (2,), (2,), (2, nv), (nv,), (2, 2), (2, 2, nv), (2, 2), (nv - BASE_DOF,))
        return cls(*(np.zeros(shape) for shape in shapes))


Sources = tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]
"""Views into Pinocchio's data: of the whole robot, of its feet, and what does not change.

Plain tuples: a compiled function is called with a named one in twice the time.
"""


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
    whole = (data.com[0], data.vcom[0], data.acom[0], data.hg.vector, data.nle, data.g)
    jacobians = (data.Jcom, data.Ag, data.J)
    feet = tuple(data.oMf[frame].translation for frame in frames)
    constants = (carrying(model, frames), np.array([radius]), *limits)
    return (*whole, *jacobians), feet, constants


@compiled
def gather(
    views: Sources, q: Array, v: Array, drift: tuple[Array, Array], out: tuple[Array, ...]
) -> tuple[bool, float, float, float, float]:
    """Write the planar terms at the state that Pinocchio has last computed.

    Args:
        views: from :func:`sources`.
        q, v: (nv,) the state.
        drift: of each foot's frame the (6,) classical acceleration dJ/dt v, linear then angular,
            in the world's axes [m/s^2, rad/s^2].
        out: the arrays of :class:`PlanarTerms`, overwritten.

    Returns:
        Whether the state is finite; the angular momentum about the CoM, forward pitch
        positive [kg m^2/s], and its Jacobian's time derivative times v [N m]; what
        :func:`~.joint_reserve.joint_reserve` returns.
    """
    whole, feet, (carries, radius, limit, stops) = views
    centre, speed, pull, momentum, effects, weight, com_jacobian, centroidal, jacobian = whole
    com, com_velocity, com_bias, jcom, jl, foot_position, foot_jacobian, foot_bias, turning = out
    finite = True
    for k in range(q.shape[0]):
        finite = finite and np.isfinite(q[k]) and np.isfinite(v[k])
    for k in range(limit.shape[0]):
        turning[k] = v[BASE_DOF + k]
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
    moment = effects[BASE_DOF - 1] - weight[BASE_DOF - 1]
    rate = moment - (com[1] - q[1]) * force_x + (com[0] - q[0]) * force_z
    return finite, momentum[4], rate, fastest, soonest
