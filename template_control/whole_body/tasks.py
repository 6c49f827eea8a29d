"""Tasks: what the robot's accelerations should be, with a weight each.

A task is a row T of a Jacobian, its bias dT/dt v and a desired acceleration; the QP
minimises the weighted squares of T a + bias - desired, as equation (45) with PD feedback
in ``desired``. The rows of a planar biped are fixed (:class:`Row`), so that assembling
them allocates nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from template_control.robot.planar_biped import PlanarBiped

Array = NDArray[np.float64]


class Row(IntEnum):
    """Task rows, in order: CoM, trunk pitch, swing foot."""

    COM_X = 0
    COM_Y = 1
    TRUNK = 2
    SWING_X = 3
    SWING_Y = 4


@dataclass(frozen=True)
class Gains:
    """PD gains of the tasks, equation (45).

    Attributes:
        com: (stiffness [1/s^2], damping [1/s]) of the CoM in x and y.
        trunk: of the trunk's pitch.
        swing: of the swing foot.
        reach: that hold the swing foot back where its leg is nearly straight.
    """

    com: tuple[float, float] = (60.0, 16.0)
    trunk: tuple[float, float] = (100.0, 20.0)
    swing: tuple[float, float] = (600.0, 45.0)
    reach: tuple[float, float] = (1e4, 200.0)


@dataclass(frozen=True)
class Weights:
    """Weights of the task rows and of the regularisers.

    Attributes:
        rows: (com_x, com_y, trunk, swing_x, swing_y) [s^4/m^2, s^4/rad^2].
        force: of the contact forces' distance from the template's, per (m g)^2.
        torque: of the joint torques, per squared limit.
    """

    rows: tuple[float, float, float, float, float]
    force: float = 1e-3
    torque: float = 1e-4


DOUBLE_STANCE_WEIGHTS = Weights((1.0, 3.0, 1.0, 0.0, 0.0))
# Height before the swing foot: near VLO its pull on the ground would need more normal force
# than the template has there.
SINGLE_STANCE_WEIGHTS = Weights((0.01, 10.0, 1.0, 1.0, 1.0))


class TaskStack:
    """Preallocated rows of all tasks.

    Attributes:
        jacobian: (5, nv) rows T.
        bias: (5,) dT/dt v.
        desired: (5,) wanted acceleration [m/s^2, rad/s^2].
    """

    def __init__(self, nv: int) -> None:
        self.jacobian = np.zeros((len(Row), nv))
        self.jacobian[Row.TRUNK, 2] = 1.0
        self.bias = np.zeros(len(Row))
        self.desired = np.zeros(len(Row))

    def read(self, robot: PlanarBiped, swing: int, height: float) -> None:
        """Copy the rows' Jacobians from the updated ``robot``; foot ``swing`` is in the air."""
        self.jacobian[: Row.TRUNK] = robot.com_jacobian
        self.jacobian[Row.COM_X] += robot.angular_momentum_jacobian / (robot.mass * height)
        self.jacobian[Row.SWING_X :] = robot.foot_jacobian[swing]
        self.bias[: Row.TRUNK] = robot.com_bias
        self.bias[Row.COM_X] += (
            robot.angular_momentum_bias - robot.angular_momentum * robot.com_velocity[1] / height
        ) / (robot.mass * height)
        self.bias[Row.SWING_X :] = robot.foot_bias[swing]
