"""Task: a foot in the air follows its reference."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import PER_ACCELERATION_SQUARED, RATE, RATE_SQUARED, tuned
from template_control.whole_body.task import Rows
from template_control.whole_body.wanted import Wanted


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
        foot = wanted.feet[self.leg]
        (kp, kd), (hold_p, hold_d) = self.gains, self.hold_gains
        # Lists: arithmetic on an array's single numbers is slow.
        position, velocity = robot.foot_position[foot].tolist(), robot.foot_velocity[foot].tolist()
        x, y = wanted.foot[foot].tolist()
        rows.jacobian[:] = robot.foot_jacobian[foot]
        rows.bias[:] = robot.foot_bias[foot]
        to_reference = x[2] + kp * (x[0] - position[0]) + kd * (x[1] - velocity[0])
        ahead = wanted.furthest[foot] - position[0]
        held = hold_p * ahead + hold_d * (wanted.hip_speed - velocity[0])
        rows.desired[0] = min(to_reference, held)
        rows.desired[1] = y[2] + kp * (y[0] - position[1]) + kd * (y[1] - velocity[1])
