"""Tasks: CoM, feet, trunk and spare joints follow their references."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.compiled import compiled
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import (
    PER_ACCELERATION_SQUARED,
    PER_RATE_TO_THE_FOURTH,
    RATE,
    RATE_SQUARED,
    tuned,
)
from template_control.whole_body.task import BIAS, DESIRED, References, Rows

Array = NDArray[np.float64]

_PITCH = 2  # place of a planar robot's pitch in q
_SIDE = 1  # y of a floating-base robot's feet, to the left


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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        (kp, kd), ref, now = self.gains, references.com.tolist(), references.com_now.tolist()
        height, rise = now[1], robot.com_velocity.tolist()[1]
        moment = robot.mass * height
        rows.jacobian[:] = robot.com_jacobian
        rows.jacobian[0] += robot.angular_momentum_jacobian / moment
        rows.bias[:] = robot.com_bias
        rows.bias[0] += (
            robot.angular_momentum_bias - robot.angular_momentum * rise / height
        ) / moment
        rows.desired[0] = (
            ref[4] + kp * (ref[0] - now[0]) + kd * (ref[2] - now[2]) + references.com_push
        )
        rows.desired[1] = ref[5] + self.lift(references)

    def lift(self, references: References) -> float:
        """The feedback part of the vertical acceleration [m/s^2]."""
        (kp, kd), ref, now = self.gains, references.com.tolist(), references.com_now.tolist()
        return float(kp * (ref[1] - now[1]) + kd * (ref[3] - now[3]))


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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        feels = robot.foot_position, robot.foot_velocity, robot.foot_jacobian, robot.foot_bias
        wish = references.foot, references.furthest
        gains = *self.gains, *self.hold_gains
        follow_foot(references.feet[self.leg], feels, wish, references.hip_speed, gains, rows.table)


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


@dataclass(frozen=True)
class MomentumTask(Checked):
    """One row: the rate of the angular momentum L = A_L v about the CoM.

        A_L a + dA_L/dt v = k (m h^2 w (theta_ref - theta) - L)

    h is the CoM's height. The row's weight is that of both sides over m h^2. A trunk that leans too
    far back gets a forward momentum, and with it turns forward. Ground forces of several
    kilonewtons then do not have to pass the hips' PD feedback, as they must where
    :class:`.PostureTask` holds the trunk in stance.

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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        # Python's numbers: arithmetic on an array's is slow.
        height, angle = references.com_now.item(1), references.pitch_now.item(0)
        inertia = robot.mass * (height * height)
        rows.jacobian[0] = robot.angular_momentum_jacobian
        rows.bias[0] = robot.angular_momentum_bias
        turning = inertia * self.turning * (references.pitch - angle)
        rows.desired[0] = self.bandwidth * (turning - robot.angular_momentum)
        rows.weight[0] = self.weight / (inertia * inertia)


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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        kp, kd = self.gains
        angle, rate = references.pitch_now.tolist()
        rows.jacobian[0, _PITCH] = 1.0
        rows.desired[0] = kp * (references.pitch - angle) - kd * rate


@dataclass(frozen=True)
class OrientationTask(Checked):
    """Three rows: the trunk's angular acceleration about the heading frame's x, y and z.

        w' = kp (-roll, pitch_ref - pitch, -yaw) - kd w

    Roll and pitch are how far the trunk's upward axis leans, about the heading frame's axes; yaw is
    the direction of its forward axis (:meth:`.FloatingBaseBiped.roll_pitch_yaw`). In the trunk's
    own axes its angular acceleration is a part of the generalised acceleration, so
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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~template_control.whole_body.task.Task.write`."""
        free = _floating(robot)
        (kp, kd), (yaw_p, yaw_d) = self.gains, self.yaw_gains
        roll, pitch, yaw = free.roll_pitch_yaw()
        x, y, z = free.space.turning.tolist()
        rows.jacobian[:] = free.space.turning_jacobian
        rows.desired[0] = -kp * roll - kd * x
        rows.desired[1] = kp * (references.pitch - pitch) - kd * y
        rows.desired[2] = -yaw_p * yaw - yaw_d * z


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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~template_control.whole_body.task.Task.write`."""
        space, (kp, kd) = _floating(robot).space, self.gains
        foot = references.feet[self.leg]
        place, speed, acceleration = references.side[foot].tolist()
        rows.jacobian[0] = space.foot_jacobian[foot, _SIDE]
        rows.bias[0] = space.foot_bias[foot, _SIDE]
        away = place - float(space.foot[foot, _SIDE])
        behind = speed - float(robot.contact_velocity[foot, _SIDE])
        rows.desired[0] = acceleration + kp * away + kd * behind


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

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """See :meth:`~template_control.whole_body.task.Task.write`."""
        spare, (kp, kd) = _floating(robot).spare, self.gains
        rows.weight[len(spare) :] = 0.0
        for row, (joint, rest) in enumerate(spare):
            rows.jacobian[row, robot.base_dof + joint] = 1.0
            away = rest - float(robot.joint_angle[joint])
            rows.desired[row] = kp * away - kd * float(robot.joint_velocity[joint])


def _floating(robot: Biped) -> FloatingBaseBiped:
    """The robot, if it has a floating base.

    Raises:
        ParameterError: if it is held in its plane.
    """
    if isinstance(robot, FloatingBaseBiped):
        return robot
    raise ParameterError(
        f"robot {robot.name} is held in its plane, and a task in space asks for a free one: take"
        " load_floating_robot, or tasks of the plane"
    )
