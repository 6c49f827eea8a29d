"""Task: the joint that a leg of four hinges has to spare stays where the straight leg has it."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.biped import Biped
from template_control.slip.similarity import PER_RATE_TO_THE_FOURTH, RATE, RATE_SQUARED, tuned
from template_control.whole_body.free.spatial import spatial
from template_control.whole_body.task import Rows
from template_control.whole_body.wanted import Wanted


@dataclass(frozen=True)
class SpareJointTask(Checked):
    """Two rows, one for each leg: q'' = kp (q0 - q) - kd q'.

    A foot is placed by three hinges. Of four, the one about the axis that is nearest to the
    vertical turns the leg about itself. Without it the rows are empty.

    Attributes:
        weight: [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    gains: tuple[NotNegative, NotNegative] = tuned((400.0, 40.0), RATE_SQUARED, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~template_control.whole_body.task.Task`."""
        return self.weight, self.weight

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~template_control.whole_body.task.Task.write`."""
        spare, (kp, kd) = spatial(robot).spare, self.gains
        rows.weight[len(spare) :] = 0.0
        for row, (joint, rest) in enumerate(spare):
            rows.jacobian[row, robot.base_dof + joint] = 1.0
            away = rest - float(robot.joint_angle[joint])
            rows.desired[row] = kp * away - kd * float(robot.joint_velocity[joint])
