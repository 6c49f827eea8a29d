"""Task: the centre of mass follows the template's."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.robot.biped import Biped
from template_control.slip.similarity import PER_ACCELERATION_SQUARED, RATE, RATE_SQUARED, tuned
from template_control.whole_body.task import Rows
from template_control.whole_body.wanted import Wanted


@dataclass(frozen=True)
class ComTask(Checked):
    """Two rows, x and y of the CoM c, towards the template's r.

    The y row asks for J_y a + dJ_y/dt v = r_y'' + kp (r_y - c_y) + kd (r_y' - c_y').

    The x row does not move the CoM itself but s' = c_x' + L / (m h), L the angular momentum
    about the CoM and h its height: m h s' - m x c_y' is the momentum about the foot, which the
    template predicts well, while the swing leg moves c_x' within a step. With L = A_L v,

        (J_x + A_L / (m h)) a + bias = r_x'' + push + kp (r_x - c_x) + kd (r_x' - s'),
        bias = dJ_x/dt v + (dA_L/dt v - L c_y' / h) / (m h).

    Attributes:
        weight: of x and y [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    weight: tuple[NotNegative, NotNegative] = tuned((1.0, 1.0), PER_ACCELERATION_SQUARED)
    gains: tuple[NotNegative, NotNegative] = tuned((60.0, 16.0), RATE_SQUARED, RATE)

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return self.weight

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        (kp, kd), ref, now = self.gains, wanted.com.tolist(), wanted.com_now.tolist()
        height, rise = now[1], robot.com_velocity.tolist()[1]
        moment = robot.mass * height
        rows.jacobian[:] = robot.com_jacobian
        rows.jacobian[0] += robot.angular_momentum_jacobian / moment
        rows.bias[:] = robot.com_bias
        rows.bias[0] += (
            robot.angular_momentum_bias - robot.angular_momentum * rise / height
        ) / moment
        rows.desired[0] = ref[4] + kp * (ref[0] - now[0]) + kd * (ref[2] - now[2]) + wanted.com_push
        rows.desired[1] = ref[5] + self.lift(wanted)

    def lift(self, wanted: Wanted) -> float:
        """The feedback part of the vertical acceleration [m/s^2]."""
        (kp, kd), ref, now = self.gains, wanted.com.tolist(), wanted.com_now.tolist()
        return float(kp * (ref[1] - now[1]) + kd * (ref[3] - now[3]))
