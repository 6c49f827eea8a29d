"""Task: the angular momentum about the CoM turns the trunk back to its pitch."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.biped import Biped
from template_control.slip.similarity import PER_RATE_TO_THE_FOURTH, RATE, tuned
from template_control.whole_body.task import Rows
from template_control.whole_body.wanted import Wanted


@dataclass(frozen=True)
class MomentumTask(Checked):
    """One row: the rate of the angular momentum L = A_L v about the CoM.

        A_L a + dA_L/dt v = k (m h^2 w (theta_ref - theta) - L)

    h is the CoM's height. The row's weight is that of both sides over m h^2. A trunk that leans too
    far back gets a forward momentum, and with it turns forward. Ground forces of several
    kilonewtons then do not have to pass the hips' PD feedback, as they must where
    :class:`~.posture_task.PostureTask` holds the trunk in stance.

    Attributes:
        weight: of the row over m h^2, an angular acceleration [s^4/rad^2].
        bandwidth: k [1/s].
        turning: w, angular momentum over m h^2 for each radian of error [1/s].
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    bandwidth: NotNegative = tuned(20.0, RATE)
    turning: NotNegative = tuned(1.35, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return (self.weight,)

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        # Python's numbers: arithmetic on an array's is slow.
        height, angle = wanted.com_now.item(1), wanted.pitch_now.item(0)
        inertia = robot.mass * (height * height)
        rows.jacobian[0] = robot.angular_momentum_jacobian
        rows.bias[0] = robot.angular_momentum_bias
        turning = inertia * self.turning * (wanted.pitch - angle)
        rows.desired[0] = self.bandwidth * (turning - robot.angular_momentum)
        rows.weight[0] = self.weight / (inertia * inertia)
