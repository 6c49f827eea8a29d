"""Task: a foot in the air follows its reference sideways."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import PER_ACCELERATION_SQUARED, RATE, RATE_SQUARED, tuned
from template_control.whole_body.free.spatial import spatial
from template_control.whole_body.task import Rows
from template_control.whole_body.wanted import Wanted

_SIDE = 1  # y, to the left


@dataclass(frozen=True)
class SideFootTask(Checked):
    """One row: y of a foot p towards its reference r, beside the two of a ``FootTask``.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    Attributes:
        leg: the foot's role.
        weight: [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    leg: Leg = Leg.FRONT
    weight: NotNegative = tuned(1.0, PER_ACCELERATION_SQUARED)
    gains: tuple[NotNegative, NotNegative] = tuned((600.0, 45.0), RATE_SQUARED, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~template_control.whole_body.task.Task`."""
        return (self.weight,)

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~template_control.whole_body.task.Task.write`."""
        space, (kp, kd) = spatial(robot).space, self.gains
        foot = wanted.feet[self.leg]
        place, speed, acceleration = wanted.side[foot].tolist()
        rows.jacobian[0] = space.foot_jacobian[foot, _SIDE]
        rows.bias[0] = space.foot_bias[foot, _SIDE]
        away = place - float(space.foot[foot, _SIDE])
        behind = speed - float(robot.contact_velocity[foot, _SIDE])
        rows.desired[0] = acceleration + kp * away + kd * behind
