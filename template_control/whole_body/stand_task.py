"""Task of a stand: the CoM stays over the feet, to the left and right."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import UP
from template_control.slip.similarity import PER_ACCELERATION_SQUARED, tuned
from template_control.whole_body.task import References, Rows

_SIDE = 1  # y, to the left
_GAIN = 1.5  # k: larger, and a foot that slides a little is rocked on
_LOWEST = 0.1  # of the legs' length: the least height that the law is used with
_SHARE = 0.9  # of the way from the middle to the outermost contact on which p stays


@dataclass(frozen=True)
class StandTask(Checked):
    """One row: y of a floating-base robot's CoM, over the middle of the contacts that stand.

    Not dy/dt itself is moved but s = dy/dt - L / (m h), L the angular momentum about the forward
    axis through the CoM and h its height over the feet. With w^2 = g / h, the capture point is
    xi = y + s / w, and the centre of pressure is to be at p = xi + k (xi - middle), as far as the
    feet bear it there:

        s' = w^2 (y - p).

    Attributes:
        weight: [s^4/m^2].
    """

    weight: NotNegative = tuned(10.0, PER_ACCELERATION_SQUARED)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return (self.weight,)

    def write(self, robot: Any, references: References, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        assert isinstance(robot, FloatingBaseBiped)
        s = robot.space
        stands = references.stands[: len(robot.feet)] > 0
        sides = s.contact[stands, _SIDE]
        low, high = float(sides.min()), float(sides.max())
        middle, half = 0.5 * (low + high), 0.5 * _SHARE * (high - low)
        # Of a robot that falls it may be below its feet.
        height = max(float(s.com[UP] - s.contact[stands, UP].mean()), _LOWEST * robot.leg_length)
        moment = robot.mass * height
        speed = float(s.com_velocity[_SIDE] - s.momentum[0] / moment)
        rate = sqrt(robot.gravity / height)
        capture = float(s.com[_SIDE]) + speed / rate - middle
        pressure = middle + float(np.clip((1.0 + _GAIN) * capture, -half, half))
        rows.jacobian[0] = s.com_jacobian[_SIDE] - s.momentum_jacobian[0] / moment
        turning = s.momentum_bias[0] - s.momentum[0] * s.com_velocity[UP] / height
        rows.bias[0] = s.com_bias[_SIDE] - turning / moment
        rows.desired[0] = rate**2 * (s.com[_SIDE] - pressure)
