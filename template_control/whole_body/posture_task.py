"""Task: the trunk keeps its pitch."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.biped import Biped
from template_control.slip.similarity import PER_RATE_TO_THE_FOURTH, RATE, RATE_SQUARED, tuned
from template_control.whole_body.task import Rows
from template_control.whole_body.wanted import Wanted

_PITCH = 2  # place of the trunk's pitch in q


@dataclass(frozen=True)
class PostureTask(Checked):
    """One row: theta'' = kp (theta_ref - theta) - kd theta', theta the trunk's pitch.

    Pitch is a coordinate of the robot, so T is a unit row and there is no bias.

    Attributes:
        weight: [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    gains: tuple[NotNegative, NotNegative] = tuned((100.0, 20.0), RATE_SQUARED, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return (self.weight,)

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        kp, kd = self.gains
        angle, rate = wanted.pitch_now.tolist()
        rows.jacobian[0, _PITCH] = 1.0
        rows.desired[0] = kp * (wanted.pitch - angle) - kd * rate
