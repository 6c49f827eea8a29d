"""Tasks: CoM, feet, trunk and spare joints follow their references.

Each task's formula is a compiled function next to it, and :func:`write_rows` calls those of a
phase's tasks in turn. Their arguments: ``task`` is of ``TASK``, ``r`` of ``ROBOT_DATA``, ``arrays``
is :class:`~template_control.robot.terms.Jacobians` as a plain tuple, ``want`` is of
``REFERENCES``, and ``rows`` are the task's own, overwritten.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Index, NotNegative, Share
from template_control.compiled import compiled
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.robot import Robot
from template_control.robot.terms import UP
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import (
    PER_ACCELERATION_SQUARED,
    PER_RATE_TO_THE_FOURTH,
    RATE,
    RATE_SQUARED,
    tuned,
)
from template_control.whole_body.task import BIAS, DESIRED, WEIGHT, References, Rows

Array = NDArray[np.float64]

_PITCH = 2  # place of a planar robot's pitch in q
_SIDE = 1  # y of a floating-base robot's feet, to the left
_YAW = 2
# An error of the yaw counts as this much at most in a run [rad]: more momentum about the vertical
# than it asks for is more than ab- and adduction have, and roll is lost with it.
_MOST_YAW = 0.2
_F, _I = np.float64, np.int64

TASK = np.dtype(
    [
        ("kind", _I),  # which formula: a task's ``kind``
        ("first", _I),  # row of the stack
        ("leg", _I),  # role of the task's foot
        ("contact", _I),  # which one of the foot's group
        ("gains", _F, (4,)),  # kp and kd, twice where the task has two pairs
        ("weight", _F, (3,)),  # of the first rows
    ],
    align=True,
)
"""A task as compiled code reads it."""

_COM, _FOOT, _MOMENTUM, _POSTURE, _ORIENTATION, _SPIN, _SIDE_FOOT, _SPARE, _SOLE, _SWAY = range(10)


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

    @property
    def numbers(self) -> tuple[float, ...]:
        """Gains, as the formula reads them."""
        return self.gains  # type: ignore[attr-defined]

    def compiled(self, first: int) -> Any:
        """(1,) of ``TASK``.

        Args:
            first: row of the stack.
        """
        found = np.zeros(1, TASK)
        found["kind"], found["first"] = self.kind, first
        found["leg"], weights = getattr(self, "leg", 0), self.weights
        found["contact"] = getattr(self, "contact", 0)
        found["weight"][0, : len(weights)] = weights
        found["gains"][0, : len(self.numbers)] = self.numbers
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
        contact, members = getattr(self, "contact", 0), min(map(len, robot.groups))
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

    weight: tuple[NotNegative, NotNegative] = tuned((1.0, 1.0), PER_ACCELERATION_SQUARED)
    gains: tuple[NotNegative, NotNegative] = tuned((60.0, 16.0), RATE_SQUARED, RATE)
    on_point: bool = tuned(False)
    falling: Share = tuned(0.0)

    kind = _COM

    @property
    def numbers(self) -> tuple[float, ...]:
        """See :attr:`CompiledTask.numbers`."""
        return *self.gains, float(self.on_point), self.falling


@compiled
def com_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of a :class:`ComTask`, and ``lift`` of references; see :func:`write_rows`."""
    com, momentum = arrays[2], arrays[3]
    kp, kd, nv = task.gains[0], task.gains[1], com.shape[1]
    up, pitch = com.shape[0] - 1, len(momentum) // 2
    ref, now = want.com, want.com_now
    height, rise = now[1], r.com_velocity[UP]
    moment = r.mass * height
    for k in range(nv):
        rows[0, k] = com[0, k] + momentum[pitch, k] / moment
        rows[1, k] = com[up, k]
    turning = r.momentum_bias[1] - r.momentum[1] * rise / height
    rows[0, nv + BIAS], rows[1, nv + BIAS] = r.com_bias[0] + turning / moment, r.com_bias[UP]
    ahead = ref[4] + kp * (ref[0] - now[0]) + kd * (ref[2] - now[2]) + want.com_push
    if task.gains[2] > 0.0:
        ahead -= kp * want.lead
    if task.gains[3] > 0.0:
        ahead += task.gains[3] * (ref[5] + r.gravity) / height * (now[0] - ref[0])
    want.lift = kp * (ref[1] - now[1]) + kd * (ref[3] - now[3])
    rows[0, nv + DESIRED], rows[1, nv + DESIRED] = ahead, ref[5] + want.lift


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
    weight: tuple[NotNegative, NotNegative] = tuned((1.0, 1.0), PER_ACCELERATION_SQUARED)
    gains: tuple[NotNegative, NotNegative] = tuned((600.0, 45.0), RATE_SQUARED, RATE)
    hold_gains: tuple[NotNegative, NotNegative] = tuned((1e4, 200.0), RATE_SQUARED, RATE)

    kind = _FOOT

    @property
    def numbers(self) -> tuple[float, ...]:
        """See :attr:`CompiledTask.numbers`."""
        return *self.gains, *self.hold_gains


@compiled
def foot_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of a :class:`FootTask`; arguments as for :func:`write_rows`."""
    contact, foot = arrays[4], want.feet[task.leg]
    kp, kd, hold_p, hold_d = task.gains[0], task.gains[1], task.gains[2], task.gains[3]
    point, nv = r.group[foot, task.contact], contact.shape[2]
    for row in range(2):
        axis, direction = row * UP, row * (min(contact.shape[1], UP + 1) - 1)
        for k in range(nv):
            rows[row, k] = contact[point, direction, k]
        rows[row, nv + BIAS] = r.contact_bias[point, axis]
        wanted, away = want.foot[foot, row], want.offset[point, axis]
        ahead = wanted[0] + away[0] - r.contact_position[point, axis]
        faster = wanted[1] + away[1] - r.contact_velocity[point, axis]
        rows[row, nv + DESIRED] = wanted[2] + away[2] + kp * ahead + kd * faster
        rows[row, nv + WEIGHT] = 0.0 if want.stands[point] else task.weight[row]
    ahead = want.furthest[foot] + want.offset[point, 0, 0] - r.contact_position[point, 0]
    held = hold_p * ahead + hold_d * (r.hip_speed - r.contact_velocity[point, 0])
    rows[0, nv + DESIRED] = min(rows[0, nv + DESIRED], held)


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

    kind = _MOMENTUM

    @property
    def numbers(self) -> tuple[float, ...]:
        """See :attr:`CompiledTask.numbers`."""
        return self.bandwidth, self.turning


@compiled
def momentum_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the row of a :class:`MomentumTask`; arguments as for :func:`write_rows`."""
    momentum, height = arrays[3], want.com_now[1]
    pitch, nv = len(momentum) // 2, momentum.shape[1]
    inertia = r.mass * (height * height)
    for k in range(nv):
        rows[0, k] = momentum[pitch, k]
    rows[0, nv + BIAS] = r.momentum_bias[1]
    turning = inertia * task.gains[1] * (want.pitch - r.attitude[1])
    rows[0, nv + DESIRED] = task.gains[0] * (turning - r.momentum[1])
    rows[0, nv + WEIGHT] = task.weight[0] / (inertia * inertia)


@dataclass(frozen=True)
class PostureTask(CompiledTask):
    """One row: theta'' = kp (theta_ref - theta) - kd theta', theta the trunk's pitch.

    Pitch is a coordinate of the robot, so T is a unit row and there is no bias.

    Attributes:
        weight: [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    gains: tuple[NotNegative, NotNegative] = tuned((100.0, 20.0), RATE_SQUARED, RATE)

    kind = _POSTURE


@compiled
def posture_rows(task: Any, r: Any, want: Any, rows: Array) -> None:
    """Write the row of a :class:`PostureTask`; arguments as for :func:`write_rows`."""
    nv = rows.shape[1] - 3
    rows[0, _PITCH] = 1.0
    away = task.gains[0] * (want.pitch - r.attitude[1])
    rows[0, nv + DESIRED] = away - task.gains[1] * r.turning[1]


@dataclass(frozen=True)
class OrientationTask(CompiledTask):
    """Three rows: the trunk's angular acceleration about the heading frame's x, y and z.

        w' = kp (roll_ref - roll, pitch_ref - pitch, yaw_ref - yaw) - kd w

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

    kind = _ORIENTATION
    in_space = True

    @property
    def numbers(self) -> tuple[float, ...]:
        """See :attr:`CompiledTask.numbers`."""
        return *self.gains, *self.yaw_gains


@compiled
def orientation_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of an :class:`OrientationTask`; arguments as for :func:`write_rows`."""
    turning, nv = arrays[5], rows.shape[1] - 3
    kp, kd, yaw_p, yaw_d = task.gains[0], task.gains[1], task.gains[2], task.gains[3]
    for axis in range(turning.shape[0]):
        for k in range(nv):
            rows[axis, k] = turning[axis, k]
    rows[0, nv + DESIRED] = kp * (want.lean[0] - r.attitude[0]) - kd * r.turning[0]
    rows[1, nv + DESIRED] = kp * (want.pitch - r.attitude[1]) - kd * r.turning[1]
    rows[2, nv + DESIRED] = yaw_p * (want.lean[2] - r.attitude[2]) - yaw_d * r.turning[2]


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
        bandwidth: k [1/s].
        turning: w, angular momentum over m h^2 for each radian of error [1/s].
    """

    weight: tuple[NotNegative, NotNegative, NotNegative] = tuned(
        (130.0, 130.0, 400.0), PER_RATE_TO_THE_FOURTH
    )
    bandwidth: NotNegative = tuned(60.0, RATE)
    turning: tuple[NotNegative, NotNegative, NotNegative] = tuned((0.26, 0.26, 0.2), RATE)

    kind = _SPIN
    in_space = True

    @property
    def numbers(self) -> tuple[float, ...]:
        """See :attr:`CompiledTask.numbers`."""
        return self.bandwidth, *self.turning


@compiled
def spin_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of a :class:`SpinTask`.

    Arguments as for :func:`write_rows`, one of each.
    """
    momentum, height = arrays[3], want.com_now[1]
    nv, inertia = momentum.shape[1], r.mass * (height * height)
    for axis in range(momentum.shape[0]):
        for k in range(nv):
            rows[axis, k] = momentum[axis, k]
        rows[axis, nv + BIAS] = r.momentum_bias[axis]
        wanted = want.pitch if axis == 1 else want.lean[axis]
        error = wanted - r.attitude[axis]
        if axis == _YAW:
            error = min(max(error, -_MOST_YAW), _MOST_YAW)
        turning = inertia * task.gains[1 + axis] * error
        if axis == _YAW:
            turning += want.spin
        rows[axis, nv + DESIRED] = task.gains[0] * (turning - r.momentum[axis])
        rows[axis, nv + WEIGHT] = task.weight[axis] / (inertia * inertia)


@dataclass(frozen=True)
class SideFootTask(CompiledTask):
    """One row: y of a contact p towards its reference r, beyond the two of a ``FootTask``.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    Attributes:
        leg: the foot's role.
        contact: which one of the foot's contacts.
        weight: [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    leg: Leg = Leg.FRONT
    _: KW_ONLY
    contact: Index = tuned(0)
    weight: NotNegative = tuned(1.0, PER_ACCELERATION_SQUARED)
    gains: tuple[NotNegative, NotNegative] = tuned((600.0, 45.0), RATE_SQUARED, RATE)

    kind = _SIDE_FOOT
    in_space = True


@compiled
def side_foot_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the row of a :class:`SideFootTask`; arguments as for :func:`write_rows`."""
    contact, foot, nv = arrays[4], want.feet[task.leg], rows.shape[1] - 3
    point = r.group[foot, task.contact]
    wanted, off = want.side[foot], want.offset[point, _SIDE]
    for k in range(nv):
        rows[0, k] = contact[point, _SIDE, k]
    rows[0, nv + BIAS] = r.contact_bias[point, _SIDE]
    away = wanted[0] + off[0] - r.contact_position[point, _SIDE]
    behind = wanted[1] + off[1] - r.contact_velocity[point, _SIDE]
    rows[0, nv + DESIRED] = wanted[2] + off[2] + task.gains[0] * away + task.gains[1] * behind
    rows[0, nv + WEIGHT] = 0.0 if want.stands[point] else task.weight[0]


@dataclass(frozen=True)
class SpareJointTask(CompiledTask):
    """Two rows, one for each leg of a biped: q'' = kp (q0 - q) - kd q'.

    A foot is placed by three hinges. Of four, the one about the axis that is nearest to the
    vertical turns the leg about itself. Without it the rows are empty.

    Attributes:
        weight: [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    weight: NotNegative = tuned(1.0, PER_RATE_TO_THE_FOURTH)
    gains: tuple[NotNegative, NotNegative] = tuned((400.0, 40.0), RATE_SQUARED, RATE)

    kind = _SPARE
    in_space = True

    @property
    def weights(self) -> tuple[float, ...]:
        """See :class:`~.task.Task`."""
        return self.weight, self.weight


@compiled
def spare_joint_rows(task: Any, r: Any, arrays: tuple[Any, ...], rows: Array) -> None:
    """Write the rows of a :class:`SpareJointTask`; arguments as for :func:`write_rows`."""
    joints, nv = arrays[6], rows.shape[1] - 3
    base_dof = nv - joints.shape[1]
    for row in range(2):
        if row >= r.spare:
            rows[row, nv + WEIGHT] = 0.0
            continue
        joint = r.spare_joint[row]
        rows[row, base_dof + joint] = 1.0
        away = task.gains[0] * (r.spare_angle[row] - joints[0, joint])
        rows[row, nv + DESIRED] = away - task.gains[1] * joints[1, joint]


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
    weight: tuple[NotNegative, NotNegative, NotNegative] = tuned(
        (0.05, 0.05, 0.05), PER_RATE_TO_THE_FOURTH
    )
    gains: tuple[NotNegative, NotNegative] = tuned((600.0, 45.0), RATE_SQUARED, RATE)

    kind = _SOLE
    in_space = True
    on_soles = True


@compiled
def sole_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of a :class:`SoleTask`; arguments as for :func:`write_rows`."""
    contact, foot = arrays[4], want.feet[task.leg]
    patch, nv = r.group[foot, 0], contact.shape[2]
    axes = r.contact_axes[patch]
    c, s = np.cos(want.lean[2]), np.sin(want.lean[2])
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        # The rotation times the inverse of the wanted one, a turn about the vertical.
        off = _turned_back(axes, j, i, c, s) - _turned_back(axes, i, j, c, s)
        for k in range(nv):
            rows[axis, k] = contact[patch, 3 + axis, k]
        rows[axis, nv + BIAS] = r.contact_bias[patch, 3 + axis]
        speed = r.contact_velocity[patch, 3 + axis]
        rows[axis, nv + DESIRED] = -0.5 * task.gains[0] * off - task.gains[1] * speed
        rows[axis, nv + WEIGHT] = 0.0 if want.stands[patch] else task.weight[axis]


@compiled
def _turned_back(axes: Array, row: int, column: int, c: float, s: float) -> float:
    """Entry of a rotation times that about the vertical by minus an angle: cosine c, sine s."""
    if column == 0:
        return c * axes[row, 0] - s * axes[row, 1]
    if column == 1:
        return s * axes[row, 0] + c * axes[row, 1]
    return float(axes[row, 2])


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

    kind = _SWAY
    in_space = True

    @property
    def numbers(self) -> tuple[float, ...]:
        """See :attr:`CompiledTask.numbers`."""
        return ()


@compiled
def sway_rows(r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the row of a :class:`SwayTask`; arguments as for :func:`write_rows`."""
    com, momentum, height = arrays[2], arrays[3], want.com_now[1]
    nv, moment = com.shape[1], r.mass * height
    for k in range(nv):
        rows[0, k] = com[_SIDE, k] - momentum[0, k] / moment
    turning = r.momentum_bias[0] - r.momentum[0] * r.com_velocity[UP] / height
    rows[0, nv + BIAS] = r.com_bias[_SIDE] - turning / moment
    rows[0, nv + DESIRED] = want.sway


@compiled
def write_rows(
    program: Any, data: Any, arrays: tuple[Any, ...], references: Any, table: Array
) -> None:
    """Let tasks write their rows into the table of a :class:`~.stack.TaskStack`.

    ``program`` (n,) is of ``TASK``, ``data`` (1,) of ``ROBOT_DATA``, ``references`` (1,) of
    ``REFERENCES``.
    """
    r, want = data[0], references[0]
    for i in range(program.shape[0]):
        task = program[i]
        rows = table[task.first :]
        if task.kind == _COM:
            com_rows(task, r, arrays, want, rows)
        elif task.kind == _FOOT:
            foot_rows(task, r, arrays, want, rows)
        elif task.kind == _MOMENTUM:
            momentum_rows(task, r, arrays, want, rows)
        elif task.kind == _POSTURE:
            posture_rows(task, r, want, rows)
        elif task.kind == _ORIENTATION:
            orientation_rows(task, r, arrays, want, rows)
        elif task.kind == _SPIN:
            spin_rows(task, r, arrays, want, rows)
        elif task.kind == _SIDE_FOOT:
            side_foot_rows(task, r, arrays, want, rows)
        elif task.kind == _SOLE:
            sole_rows(task, r, arrays, want, rows)
        elif task.kind == _SWAY:
            sway_rows(r, arrays, want, rows)
        else:
            spare_joint_rows(task, r, arrays, rows)
