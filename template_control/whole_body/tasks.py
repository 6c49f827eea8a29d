"""Tasks: CoM, feet, trunk and joints follow references of a tick, or targets of their own.

Compiled formulas write the rows of the former (:mod:`~template_control.whole_body.task_rows`).
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, fields
from typing import Any, ClassVar

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Index, NotNegative, Share, Triple, Vector
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.robot import Robot
from template_control.robot.terms import MOST_SPARE, UP
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import (
    PER_ACCELERATION_SQUARED,
    PER_RATE_TO_THE_FOURTH,
    RATE,
    RATE_SQUARED,
    tuned,
)
from template_control.whole_body import task_rows
from template_control.whole_body.task import References, Rows
from template_control.whole_body.task_rows import TASK, write_rows

_NO_GAINS = ("leg", "contact", "weight")
_Two = tuple[NotNegative, NotNegative]
_Three = tuple[NotNegative, NotNegative, NotNegative]


class CompiledTask(Checked):
    """A task whose rows a compiled formula writes.

    Attributes:
        kind: its formula.
        in_space: whether only floating-base robots have what it speaks of.
        on_soles: whether only those with flat feet have it.
    """

    kind: ClassVar[int]
    in_space: ClassVar[bool] = False
    on_soles: ClassVar[bool] = False

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        weight = self.weight  # type: ignore[attr-defined]
        return weight if isinstance(weight, tuple) else (weight,)

    def compiled(self, first: int) -> Any:
        """(1,) of ``TASK``; its gains are all numbers but the weights, in the fields' order.

        Args:
            first: row of the stack.
        """
        found = np.zeros(1, TASK)
        found["kind"], found["first"] = self.kind, first
        found["leg"], found["contact"] = getattr(self, "leg", 0), getattr(self, "contact", 0)
        weights = self.weights[: found["weight"].shape[1]]
        found["weight"][0, : len(weights)] = weights
        names = (f.name for f in fields(self) if f.name not in _NO_GAINS)  # type: ignore[arg-type]
        gains = [number for name in names for number in np.ravel(getattr(self, name))]
        found["gains"][0, : len(gains)] = gains
        return found

    def check(self, robot: Robot) -> None:
        """Check that a robot has what the task speaks of.

        Raises:
            ParameterError: if it is no biped, or held in its plane and the task is one in space.
        """
        if not isinstance(robot, Biped):
            raise ParameterError(
                f"{robot.name} is no biped, and a {type(self).__name__} asks for one: take a"
                " FrameTask or a JointTask"
            )
        if self.in_space and robot.directions <= UP:
            raise ParameterError(
                f"robot {robot.name} is held in its plane, and a {type(self).__name__} asks for a"
                " free one: take load_floating_robot, or tasks of the plane"
            )
        if self.on_soles and not robot.patches:
            raise ParameterError(
                f"robot {robot.name} has point feet, and a {type(self).__name__} asks for soles:"
                " take tasks of point feet"
            )
        leg = getattr(self, "leg", None)
        if leg is not None and not robot.groups[leg]:
            raise ParameterError(
                f"a {type(self).__name__} asks for the {leg.name.lower()} leg, and {robot.name} has"
                " no such leg: leave the task out"
            )
        contact, members = getattr(self, "contact", 0), min(map(len, filter(None, robot.groups)))
        if contact >= members:
            raise ParameterError(
                f"a {type(self).__name__} asks for contact {contact} of a leg, and the legs of"
                f" {robot.name} have {members}: give a smaller number"
            )

    def write(self, robot: Robot, references: References, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        self.check(robot)
        write_rows(self.compiled(0), robot.data, robot.arrays, references.data, rows.table)


@dataclass(frozen=True)
class ComTask(CompiledTask):
    """Two rows, x and y of the CoM c, towards the template's r.

    The y row asks for J_y a + dJ_y/dt v = r_y'' + kp (r_y - c_y) + kd (r_y' - c_y').

    The x row does not move the CoM itself but s' = c_x' + L / (m h), L the angular momentum
    about the CoM and h its height: m h s' - m x c_y' is the momentum about the foot, which the
    template predicts well, while the swing leg moves c_x' within a step. With L = A_L v,

        (J_x + A_L / (m h)) a + bias = r_x'' + push + kp (r_x - c_x) + kd (r_x' - s'),
        bias = dJ_x/dt v + (dA_L/dt v - L c_y' / h) / (m h).

    A sole bears a moment in single stance, by which both can be followed. The point that moves with
    s' is then taken for c_x (``on_point``): the CoM leads or lags it by a centimetre as the leg
    swings, and the centre of pressure would move by several to hold the CoM back. An error grows as
    that of a pendulum does, by (r_y'' + g) / h (c_x - r_x), which is left to it (``falling``).

    Attributes:
        weight: of x and y [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
        on_point: whether x is that of the point which moves with the momentum.
        falling: share of a pendulum's acceleration that an error of x is left.
    """

    weight: _Two = tuned((1.0, 1.0), PER_ACCELERATION_SQUARED)
    gains: _Two = tuned((60.0, 16.0), RATE_SQUARED, RATE)
    on_point: bool = tuned(False)
    falling: Share = tuned(0.0)

    kind = task_rows.COM


@dataclass(frozen=True)
class FootTask(CompiledTask):
    """Two rows, x and y of a contact p of a foot, towards its reference r.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    In x no more is asked for than the feedback that holds the foot at the furthest place its
    leg reaches, moving with the hips: a knee that goes straight hits its stop with tens of
    kilonewtons.

    A contact that the QP has on the ground already is asked for nothing.

    Attributes:
        leg: the foot's role.
        contact: which one of the foot's contacts.
        weight: of x and y [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
        hold_gains: of the feedback that holds the foot back.
    """

    leg: Leg = Leg.FRONT
    _: KW_ONLY
    contact: Index = tuned(0)
    weight: _Two = tuned((1.0, 1.0), PER_ACCELERATION_SQUARED)
    gains: _Two = tuned((600.0, 45.0), RATE_SQUARED, RATE)
    hold_gains: _Two = tuned((1e4, 200.0), RATE_SQUARED, RATE)

    kind = task_rows.FOOT


@dataclass(frozen=True)
class MomentumTask(CompiledTask):
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

    kind = task_rows.MOMENTUM


@dataclass(frozen=True)
class PostureTask(CompiledTask):
    """One row: theta'' = kp (theta_ref - theta) - kd theta', theta the trunk's pitch.

    Pitch is a coordinate of the robot, so T is a unit row and there is no bias.

    Attributes:
        weight: [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    gains: _Two = tuned((100.0, 20.0), RATE_SQUARED, RATE)

    kind = task_rows.POSTURE


@dataclass(frozen=True)
class OrientationTask(CompiledTask):
    """Three rows: the trunk's angular acceleration about the heading frame's x, y and z.

        w' = kp (roll_ref - roll, pitch_ref - pitch, yaw_ref - yaw) - kd w

    Roll and pitch are how far the trunk's upward axis leans, about the heading frame's axes; yaw is
    the direction of its forward axis (``attitude`` of ``ROBOT_DATA``). In the trunk's own axes its
    angular acceleration is a part of the generalised acceleration, so there is no bias.

    Attributes:
        weight: of roll, pitch and yaw [s^4/rad^2]. A point foot bears no torque about the vertical:
            in single stance the yaw can only be turned against the swinging leg.
        gains: kp [1/s^2] and kd [1/s] of roll and pitch.
        yaw_gains: of yaw.
    """

    weight: _Three = tuned((1.0, 1.0, 0.02), PER_RATE_TO_THE_FOURTH)
    gains: _Two = tuned((100.0, 20.0), RATE_SQUARED, RATE)
    yaw_gains: _Two = tuned((36.0, 12.0), RATE_SQUARED, RATE)

    kind = task_rows.ORIENTATION
    in_space = True


@dataclass(frozen=True)
class SpinTask(CompiledTask):
    """Three rows: the rate of the angular momentum L = A v about the CoM, in the heading frame.

        A_i a + dA_i/dt v = k (m h^2 w_i (ref_i - angle_i) + L_ref,i - L_i)

    A :class:`MomentumTask` about all three axes: ref is (roll, pitch, yaw) as wanted, the angles
    are those of an :class:`OrientationTask`; L_ref, about the vertical, turns with the heading. In
    a run a point foot's force of several times the weight turns the trunk about every axis.

    Attributes:
        weight: of the rows about x, y and z, each over m h^2 [s^4/rad^2]. A moment about the
            vertical comes from the foot's lateral force times its distance ahead, and costs a
            moment about x: so the yaw's weight is the largest.
        bandwidth, turning: as of a :class:`MomentumTask`; w of each row [1/s].
    """

    weight: _Three = tuned((130.0, 130.0, 400.0), PER_RATE_TO_THE_FOURTH)
    bandwidth: NotNegative = tuned(60.0, RATE)
    turning: _Three = tuned((0.26, 0.26, 0.2), RATE)

    kind = task_rows.SPIN
    in_space = True


@dataclass(frozen=True)
class SideFootTask(CompiledTask):
    """One row: y of a contact p towards its reference r, beyond the two of a ``FootTask``.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    As :class:`FootTask`, but for the feedback that holds the foot back.
    """

    leg: Leg = Leg.FRONT
    _: KW_ONLY
    contact: Index = tuned(0)
    weight: NotNegative = tuned(1.0, PER_ACCELERATION_SQUARED)
    gains: _Two = tuned((600.0, 45.0), RATE_SQUARED, RATE)

    kind = task_rows.SIDE_FOOT
    in_space = True


@dataclass(frozen=True)
class SpareJointTask(CompiledTask):
    """A row for each joint that places no foot: q'' = kp (q0 - q) - kd q'.

    A point foot is placed by three hinges. Of four, the one about the axis that is nearest to the
    vertical turns the leg about itself. Arms and a waist that move are in no leg. There is room for
    ``MOST_SPARE`` rows, and those beyond a robot's joints are empty. Weight and gains are as a
    :class:`PostureTask` has them.
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    gains: _Two = tuned((400.0, 40.0), RATE_SQUARED, RATE)

    kind = task_rows.SPARE
    in_space = True

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return (self.weight,) * MOST_SPARE


@dataclass(frozen=True)
class SoleTask(CompiledTask):
    """Three rows: the sole of a foot in the air is kept level, and faces as the trunk shall.

        w' = -kp e - kd w

    e is the axis of the sole's rotation from there times the sine of its angle. A sole that the QP
    has on the ground already is asked for nothing.

    Attributes:
        leg: the foot's role.
        weight: of each row [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    leg: Leg = Leg.FRONT
    _: KW_ONLY
    weight: _Three = tuned((0.05, 0.05, 0.05), PER_RATE_TO_THE_FOURTH)
    gains: _Two = tuned((600.0, 45.0), RATE_SQUARED, RATE)

    kind = task_rows.SOLE
    in_space = True
    on_soles = True


@dataclass(frozen=True)
class SwayTask(CompiledTask):
    """One row: the rate of s = c_y' - L / (m h), the lateral speed with the momentum.

        (J_y - A_L / (m h)) a + bias = sway,   bias = dJ_y/dt v - (dA_L/dt v - L c_z' / h) / (m h)

    L = A_L v is the angular momentum about the CoM's x and h its height: m h s is the momentum
    about a line on the ground below. ``sway`` is the reference of that name.

    Attributes:
        weight: [s^4/m^2].
    """

    weight: NotNegative = tuned(1.0, PER_ACCELERATION_SQUARED)

    kind = task_rows.SWAY
    in_space = True


_GAINS = (100.0, 20.0)  # kp [1/s^2] and kd [1/s]: critically damped, 0.1 s


class FrameTask:
    """Three rows: the origin p of a frame towards its target r, in the world's axes.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    Args:
        frame: name of a frame of the robot's model.
        weight: of each row [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    @checked
    def __init__(self, frame: str, weight: NotNegative = 1.0, gains: _Two = _GAINS) -> None:
        self.frame, self.gains, self.weights = frame, gains, (weight,) * 3
        self._target: Array | None = None

    @checked
    def set_target(
        self, position: Triple, velocity: Triple | None = None, acceleration: Triple | None = None
    ) -> None:
        """Where the frame's origin is to be, in the world.

        Args:
            position: (3,) [m].
            velocity: (3,) of the target [m/s]; None: it rests.
            acceleration: (3,) of the target [m/s^2]; None: 0.
        """
        rates = (np.zeros(3) if rate is None else rate for rate in (velocity, acceleration))
        self._target = np.stack([position, *rates])

    def write(self, robot: Robot, references: Any, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`; a ParameterError before :meth:`set_target`."""
        if self._target is None:
            raise ParameterError(f"the FrameTask of {self.frame!r} has no target: call set_target")
        now, (place, velocity, acceleration) = robot.frame(self.frame), self._target
        rows.jacobian[:], rows.bias[:] = now.jacobian, now.bias
        pull = self.gains[0] * (place - now.position) + self.gains[1] * (velocity - now.velocity)
        rows.desired[:] = acceleration + pull


class JointTask:
    """A row for each actuated joint: q'' = kp (r - q) + kd (r' - q'), r the target.

    Args:
        target: (nu,) in the order of the robot's ``joint_names`` [rad].
        weight: of each row [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    @checked
    def __init__(self, target: Vector, weight: NotNegative = 1.0, gains: _Two = _GAINS) -> None:
        self.gains, self.weights = gains, (weight,) * len(target)
        self.set_target(target)

    @checked
    def set_target(self, angle: Vector, velocity: Vector | None = None) -> None:
        """Where the joints are to be.

        Args:
            angle: (nu,) [rad].
            velocity: (nu,) of the target [rad/s]; None: it rests.
        """
        count, moving = len(self.weights), np.zeros(len(angle)) if velocity is None else velocity
        for name, numbers in (("target", angle), ("target's velocity", moving)):
            if len(numbers) != count:
                raise ParameterError(
                    f"the JointTask's {name} has {len(numbers)} numbers: give {count}"
                )
        self._target = np.stack([angle, moving])

    def write(self, robot: Robot, references: Any, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        if len(self.weights) != len(robot.joint_names):
            raise ParameterError(
                f"the JointTask has {len(self.weights)} angles and {robot.name} has"
                f" {len(robot.joint_names)} joints: give one for each"
            )
        angle, velocity = self._target
        rows.jacobian[:, robot.base_dof :] = np.eye(len(angle))
        pull = self.gains[0] * (angle - robot.joint_angle)
        rows.desired[:] = pull + self.gains[1] * (velocity - robot.joint_velocity)
