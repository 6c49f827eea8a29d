"""Rows of the library's tasks, in compiled code.

One formula a task, and :func:`write_rows` calls those of a phase's tasks in turn. The equations are
in the docstrings of the tasks. Arguments: ``task`` is of ``TASK``, ``r`` of ``ROBOT_DATA``,
``arrays`` is :class:`~template_control.robot.terms.Jacobians` as a plain tuple, ``want`` is of
``REFERENCES``, and ``rows`` are the task's own, overwritten.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled, constant
from template_control.robot.terms import MOST_SPARE, UP, onward
from template_control.structured import structure
from template_control.whole_body.task import BIAS, DESIRED, WEIGHT

_PITCH = 2  # place of a planar robot's pitch in q
_AHEAD, _SIDE, _UPWARD = map(constant, (0, 1, UP))  # axes of rows
_YAW = 2
# An error of the yaw counts as this much at most in a run [rad]: more momentum about the vertical
# than it asks for is more than ab- and adduction have, and roll is lost with it.
_MOST_YAW = 0.2
TASK = structure(
    kind=np.int64,  # which formula: a task's ``kind``
    first=np.int64,  # row of the stack
    leg=np.int64,  # role of the task's foot
    contact=np.int64,  # which one of the foot's group
    gains=(float, (4,)),  # kp and kd, twice where the task has two pairs
    weight=(float, (3,)),  # of the first rows
)
"""A task as compiled code reads it."""

COM, FOOT, MOMENTUM, POSTURE, ORIENTATION, SPIN, SIDE_FOOT, SPARE, SOLE, SWAY = range(10)
"""Formulas, by the kind of a task."""


@compiled
def _momentum_speed_row(
    r: Any, arrays: tuple[Any, ...], height: float, axis: int, row: Array
) -> None:
    """Write the rate of the CoM's speed with the momentum, ahead (0) or to the left (1).

    The angular momentum counts over m h, h the ``height``: that about the pitch's axis ahead, that
    about x, which moves the CoM the other way, to the left.
    """
    com, momentum, turn, sign = arrays[2], arrays[3], 1 - axis, 1.0 - 2.0 * axis
    nv, moment = com.shape[1], r.mass * height
    for k in range(nv):
        spin = momentum[min(turn, len(momentum) - 1), k] / moment
        row[k] = com[axis, k] + sign * spin
    turning = r.momentum_bias[turn] - r.momentum[turn] * r.com_velocity[UP] / height
    row[nv + BIAS] = r.com_bias[axis] + sign * (turning / moment)


@compiled
def com_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of a :class:`ComTask`, and ``lift`` of references; see :func:`write_rows`."""
    com, kp, kd = arrays[2], task.gains[0], task.gains[1]
    up, nv, ref, now = com.shape[0] - 1, com.shape[1], want.com, want.com_now
    _momentum_speed_row(r, arrays, now[1], _AHEAD, rows[0])
    for k in range(nv):
        rows[1, k] = com[up, k]
    rows[1, nv + BIAS] = r.com_bias[UP]
    ahead = ref[4] + kp * (ref[0] - now[0]) + kd * (ref[2] - now[2]) + want.com_push
    if task.gains[2] > 0.0:
        ahead -= kp * want.lead
    if task.gains[3] > 0.0:
        ahead += task.gains[3] * (ref[5] + r.gravity) / now[1] * (now[0] - ref[0])
    if not np.isnan(want.ahead):
        ahead = want.ahead
    want.lift = kp * (ref[1] - now[1]) + kd * (ref[3] - now[3])
    rows[0, nv + DESIRED], rows[1, nv + DESIRED] = ahead, ref[5] + want.lift


@compiled
def _contact_row(task: Any, r: Any, contact: Array, want: Any, axis: int, row: Array) -> None:
    """Write the row by which a foot's contact follows its reference along an axis."""
    foot, nv = want.feet[task.leg], contact.shape[2]
    point, wanted = r.group[foot, task.contact], want.foot[foot, axis // UP]
    if axis == _SIDE:
        wanted = want.side[foot]
    for k in range(nv):
        row[k] = contact[point, min(axis, contact.shape[1] - 1), k]
    row[nv + BIAS], away = r.contact_bias[point, axis], want.offset[point, axis]
    ahead = wanted[0] + away[0] - r.contact_position[point, axis]
    faster = wanted[1] + away[1] - r.contact_velocity[point, axis]
    row[nv + DESIRED] = wanted[2] + away[2] + task.gains[0] * ahead + task.gains[1] * faster
    row[nv + WEIGHT] = 0.0 if want.stands[point] else task.weight[axis // UP]


@compiled
def foot_rows(task: Any, r: Any, contact: Array, want: Any, rows: Array) -> None:
    """Write the rows of a :class:`FootTask`."""
    _contact_row(task, r, contact, want, _AHEAD, rows[0])
    _contact_row(task, r, contact, want, _UPWARD, rows[1])
    foot, nv = want.feet[task.leg], contact.shape[2]
    point = r.group[foot, task.contact]
    ahead = want.furthest[foot] + want.offset[point, 0, 0] - r.contact_position[point, 0]
    faster = r.hip_speed - r.contact_velocity[point, 0]
    held = task.gains[2] * ahead + task.gains[3] * faster
    rows[0, nv + DESIRED] = min(rows[0, nv + DESIRED], held)


@compiled
def posture_rows(task: Any, r: Any, want: Any, rows: Array) -> None:
    """Write the row of a :class:`PostureTask`."""
    nv = rows.shape[1] - 3
    rows[0, _PITCH] = onward(r.facing)
    away = task.gains[0] * (want.pitch - r.attitude[1])
    rows[0, nv + DESIRED] = away - task.gains[1] * r.turning[1]


@compiled
def orientation_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of an :class:`OrientationTask`."""
    turning, nv = arrays[5], rows.shape[1] - 3
    kp, kd, yaw_p, yaw_d = task.gains[0], task.gains[1], task.gains[2], task.gains[3]
    for axis in range(turning.shape[0]):
        for k in range(nv):
            rows[axis, k] = turning[axis, k]
    rows[0, nv + DESIRED] = kp * (want.lean[0] - r.attitude[0]) - kd * r.turning[0]
    rows[1, nv + DESIRED] = kp * (want.pitch - r.attitude[1]) - kd * r.turning[1]
    rows[2, nv + DESIRED] = yaw_p * (want.lean[2] - r.attitude[2]) - yaw_d * r.turning[2]


@compiled
def momentum_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the row of a :class:`MomentumTask`, about the pitch's axis, or those of a spin task."""
    momentum, height = arrays[3], want.com_now[1]
    nv, inertia = momentum.shape[1], r.mass * (height * height)
    alone = task.kind == MOMENTUM
    for row in range(1 if alone else momentum.shape[0]):
        axis, place = (1, len(momentum) // 2) if alone else (row, row)
        for k in range(nv):
            rows[row, k] = momentum[place, k]
        rows[row, nv + BIAS] = r.momentum_bias[axis]
        wanted = want.pitch if axis == 1 else want.lean[axis]
        error = wanted - r.attitude[axis]
        if axis == _YAW:
            error = min(max(error, -_MOST_YAW), _MOST_YAW)
        turning = inertia * task.gains[1 + row] * error
        if axis == _YAW:
            turning += want.spin
        rows[row, nv + DESIRED] = task.gains[0] * (turning - r.momentum[axis])
        rows[row, nv + WEIGHT] = task.weight[row] / (inertia * inertia)


@compiled
def spare_joint_rows(task: Any, r: Any, arrays: tuple[Any, ...], rows: Array) -> None:
    """Write the rows of a :class:`SpareJointTask`."""
    joints, nv = arrays[6], rows.shape[1] - 3
    base_dof = nv - joints.shape[1]
    for row in range(r.spare, MOST_SPARE):
        rows[row, nv + WEIGHT] = 0.0
    for row in range(r.spare):
        joint = r.spare_joint[row]
        rows[row, base_dof + joint] = 1.0
        away = task.gains[0] * (r.spare_angle[row] - joints[0, joint])
        rows[row, nv + DESIRED] = away - task.gains[1] * joints[1, joint]


@compiled
def sole_rows(task: Any, r: Any, arrays: tuple[Any, ...], want: Any, rows: Array) -> None:
    """Write the rows of a :class:`SoleTask`."""
    contact, foot = arrays[4], want.feet[task.leg]
    patch, nv = r.group[foot, 0], contact.shape[2]
    axes = r.contact_axes[patch]
    yaw = r.facing + want.lean[2]
    c, s = np.cos(yaw), np.sin(yaw)
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


@compiled
def write_rows(
    program: Any, data: Any, arrays: tuple[Any, ...], references: Any, table: Array
) -> None:
    """Let the tasks of a ``program`` write their rows of a :class:`~.stack.TaskStack`'s table."""
    r, want = data[0], references[0]
    for i in range(program.shape[0]):
        task = program[i]
        rows = table[task.first :]
        if task.kind == COM:
            com_rows(task, r, arrays, want, rows)
        elif task.kind == FOOT:
            foot_rows(task, r, arrays[4], want, rows)
        elif task.kind == MOMENTUM or task.kind == SPIN:
            momentum_rows(task, r, arrays, want, rows)
        elif task.kind == POSTURE:
            posture_rows(task, r, want, rows)
        elif task.kind == ORIENTATION:
            orientation_rows(task, r, arrays, want, rows)
        elif task.kind == SIDE_FOOT:
            _contact_row(task, r, arrays[4], want, _SIDE, rows[0])
        elif task.kind == SOLE:
            sole_rows(task, r, arrays, want, rows)
        elif task.kind == SWAY:
            _momentum_speed_row(r, arrays, want.com_now[1], _SIDE, rows[0])
            rows[0, table.shape[1] - 3 + DESIRED] = want.sway
        else:
            spare_joint_rows(task, r, arrays, rows)
