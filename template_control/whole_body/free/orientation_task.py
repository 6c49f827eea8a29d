"""Task: the trunk of a free robot stays upright, and looks along the heading."""

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
class OrientationTask(Checked):
    """Three rows: the trunk's angular acceleration about the heading frame's x, y and z.

        w' = kp (-roll, pitch_ref - pitch, -yaw) - kd w

    Roll and pitch are how far the trunk's upward axis leans, about the heading frame's axes; yaw is
    the direction of its forward axis (:meth:`~template_control.robot.FreeBiped.roll_pitch_yaw`). In
    the trunk's own axes its angular acceleration is a part of the generalised acceleration, so
    there is no bias.

    Attributes:
        weight: of roll, pitch and yaw [s^4/rad^2]. A point foot bears no torque about the vertical:
            in single stance the yaw can only be turned against the swinging leg.
        gains: kp [1/s^2] and kd [1/s] of roll and pitch.
        yaw_gains: of yaw.
    """

    weight: tuple[NotNegative, NotNegative, NotNegative] = tuned(
        (1.0, 1.0, 0.02), PER_RATE_TO_THE_FOURTH
    )
    gains: tuple[NotNegative, NotNegative] = tuned((100.0, 20.0), RATE_SQUARED, RATE)
    yaw_gains: tuple[NotNegative, NotNegative] = tuned((36.0, 12.0), RATE_SQUARED, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~template_control.whole_body.task.Task`."""
        return self.weight

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~template_control.whole_body.task.Task.write`."""
        free = spatial(robot)
        (kp, kd), (yaw_p, yaw_d) = self.gains, self.yaw_gains
        roll, pitch, yaw = free.roll_pitch_yaw()
        x, y, z = free.space.turning.tolist()
        rows.jacobian[:] = free.space.turning_jacobian
        rows.desired[0] = -kp * roll - kd * x
        rows.desired[1] = kp * (wanted.pitch - pitch) - kd * y
        rows.desired[2] = -yaw_p * yaw - yaw_d * z
