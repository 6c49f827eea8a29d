"""Task: a foot in the air follows its reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.compiled import compiled
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import PER_ACCELERATION_SQUARED, RATE, RATE_SQUARED, tuned
from template_control.whole_body.task import BIAS, DESIRED, Rows
from template_control.whole_body.wanted import Wanted

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FootTask(Checked):
    """Two rows, x and y of a foot p, towards its reference r.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    In x no more is asked for than the feedback that holds the foot at the furthest place its
    leg reaches, moving with the hips: a knee that goes straight hits its stop with tens of
    kilonewtons.

    Attributes:
        leg: the foot's role.
        weight: of x and y [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
        hold_gains: of the feedback that holds the foot back.
    """

    leg: Leg = Leg.FRONT
    weight: tuple[NotNegative, NotNegative] = tuned((1.0, 1.0), PER_ACCELERATION_SQUARED)
    gains: tuple[NotNegative, NotNegative] = tuned((600.0, 45.0), RATE_SQUARED, RATE)
    hold_gains: tuple[NotNegative, NotNegative] = tuned((1e4, 200.0), RATE_SQUARED, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return self.weight

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        feels = robot.foot_position, robot.foot_velocity, robot.foot_jacobian, robot.foot_bias
        wish = wanted.foot, wanted.furthest
        gains = *self.gains, *self.hold_gains
        follow_foot(wanted.feet[self.leg], feels, wish, wanted.hip_speed, gains, rows.table)


@compiled
def follow_foot(
    foot: int,
    feels: tuple[Array, Array, Array, Array],
    wish: tuple[Array, Array],
    hip_speed: float,
    gains: tuple[float, float, float, float],
    table: Array,
) -> None:
    """Write the two rows of a :class:`FootTask`.

    Args:
        foot: 0 or 1.
        feels: (2, 2) positions and (2, 2) velocities of both feet, their (2, 2, nv) Jacobians, and
            (2, 2) dJ/dt v.
        wish: (2, 2, 3) the references, and (2,) the furthest x of each foot [m].
        hip_speed: forward [m/s].
        gains: kp and kd of the feedback, and of that which holds the foot back.
        table: (2, nv + 3) overwritten, as that of a :class:`~.task.TaskStack`.
    """
    position, velocity, jacobian, bias = feels
    reference, furthest = wish
    kp, kd, hold_p, hold_d = gains
    nv = table.shape[1] - 3
    for axis in range(2):
        for k in range(nv):
            table[axis, k] = jacobian[foot, axis, k]
        table[axis, nv + BIAS] = bias[foot, axis]
        r = reference[foot, axis]
        ahead, faster = r[0] - position[foot, axis], r[1] - velocity[foot, axis]
        table[axis, nv + DESIRED] = r[2] + kp * ahead + kd * faster
    ahead = furthest[foot] - position[foot, 0]
    held = hold_p * ahead + hold_d * (hip_speed - velocity[foot, 0])
    table[0, nv + DESIRED] = min(table[0, nv + DESIRED], held)
