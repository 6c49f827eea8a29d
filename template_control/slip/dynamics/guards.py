"""The automaton's guards as compiled functions of the CoM, and their rates of change.

Real or complex arithmetic alike: derivatives of strides come from complex steps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import inner
from template_control.slip.automaton.vocabulary import Event

Array = NDArray[np.float64]

# Numba freezes module-level integers into the compiled code.
_TOUCHDOWN = int(Event.TOUCHDOWN)
_REAR_LIFTOFF = int(Event.REAR_LIFTOFF)
_FRONT_LIFTOFF = int(Event.FRONT_LIFTOFF)
_APEX = int(Event.APEX)
_BOTTOM = int(Event.BOTTOM)
_VIRTUAL_BOTTOM = int(Event.VIRTUAL_BOTTOM)
_VLO = int(Event.VLO)
_PASSED_FRONT_FOOT = int(Event.PASSED_FRONT_FOOT)
_FALL = int(Event.FALL)
_BACKWARD = int(Event.BACKWARD)
_REST = int(Event.REST)


@inner
def guard(
    event: int, state: Array, toes: Array, rest_length: float, touchdown_height: float
) -> float:
    """Value of a guard of ``Event``; it fires when it rises through 0.

    Args:
        event: value of the Event.
        state: (4 or more,) x, y, dx/dt, dy/dt [m, m/s].
        toes: (2,) x of rear and front toe [m].
        rest_length: l0 [m].
        touchdown_height: l0 sin(alpha) [m].
    """
    x, y, u, v = state[0], state[1], state[2], state[3]
    if event == _TOUCHDOWN:
        return touchdown_height - y
    if event == _REAR_LIFTOFF:
        return np.sqrt((x - toes[0]) ** 2 + y * y) - rest_length
    if event == _FRONT_LIFTOFF:
        return np.sqrt((x - toes[1]) ** 2 + y * y) - rest_length
    if event == _APEX:
        return -v
    if event == _BOTTOM:
        return (x - toes[0]) * u + y * v
    if event == _VIRTUAL_BOTTOM:
        return (x - 0.5 * (toes[0] + toes[1])) * u + y * v
    if event == _VLO:
        return x - toes[0]
    if event == _PASSED_FRONT_FOOT:
        return x - toes[1]
    if event == _FALL:
        return -y
    if event == _REST:
        return -(u * u + v * v)
    return -u


@inner
def all_guards(
    state: Array, toes: Array, rest_length: float, touchdown_height: float, values: Array
) -> None:
    """Write the real parts of all guards at once into ``values``.

    There is no branch in it, which makes it faster than :func:`guard` for a few of them.

    Args:
        state: (4 or more,) x, y, dx/dt, dy/dt [m, m/s].
        toes: (2,) x of rear and front toe [m].
        rest_length: l0 [m].
        touchdown_height: l0 sin(alpha) [m].
        values: (NUM_EVENTS,) overwritten, by Event.
    """
    x, y, u, v = state[0].real, state[1].real, state[2].real, state[3].real
    rear, front = x - toes[0].real, x - toes[1].real
    values[_TOUCHDOWN] = touchdown_height.real - y
    values[_REAR_LIFTOFF] = np.sqrt(rear * rear + y * y) - rest_length
    values[_FRONT_LIFTOFF] = np.sqrt(front * front + y * y) - rest_length
    values[_APEX] = -v
    values[_BOTTOM] = rear * u + y * v
    values[_VIRTUAL_BOTTOM] = 0.5 * (rear + front) * u + y * v
    values[_VLO] = rear
    values[_PASSED_FRONT_FOOT] = front
    values[_FALL] = -y
    values[_BACKWARD] = -u
    values[_REST] = -(u * u + v * v)


@inner
def all_bends(
    state: Array,
    toes: Array,
    rest_length: float,
    steepest: tuple[float, float, float],
    step: float,
    bends: Array,
) -> None:
    """Write bounds of all guards' second time derivatives along a path into ``bends``.

    That of a leg holds where it is longer than l0 / 2, and from below it holds always. REST never
    rises above zero; its bound is zero.

    Args:
        state: (4,) x, y, dx/dt, dy/dt at the path's start [m, m/s].
        toes: (2,) x of rear and front toe [m].
        rest_length: l0 [m].
        steepest: bounds of speed, acceleration and jerk along the path [m/s, m/s^2, m/s^3].
        step: duration of the path [s].
        bends: (NUM_EVENTS,) overwritten, by Event.
    """
    speed, acceleration, jerk = steepest
    x, y = state[0].real, abs(state[1].real) + speed * step
    rear, front = abs(x - toes[0].real), abs(x - toes[1].real)
    turn = 3.0 * speed * acceleration
    bends[_TOUCHDOWN] = bends[_VLO] = bends[_PASSED_FRONT_FOOT] = bends[_FALL] = acceleration
    bends[_APEX] = bends[_BACKWARD] = jerk
    bends[_BOTTOM] = turn + (rear + y) * jerk
    bends[_VIRTUAL_BOTTOM] = turn + (0.5 * (rear + front) + y) * jerk
    bends[_REAR_LIFTOFF] = acceleration + 2.0 * speed * speed / rest_length
    bends[_FRONT_LIFTOFF] = bends[_REAR_LIFTOFF]
    bends[_REST] = 0.0


@inner
def guard_rate(event: int, path: Array, toes: Array) -> float:
    """Time derivative of a guard along a path.

    Args:
        event: value of the Event.
        path: (6,) x, y and their first and second derivatives.
        toes: (2,) x of rear and front toe [m].
    """
    x, y, u, v = path[0], path[1], path[2], path[3]
    if event in (_TOUCHDOWN, _FALL):
        return -v
    if event in (_REAR_LIFTOFF, _FRONT_LIFTOFF):
        d = x - toes[0 if event == _REAR_LIFTOFF else 1]
        return (d * u + y * v) / np.sqrt(d * d + y * y)
    if event == _APEX:
        return -path[5]
    if event in (_BOTTOM, _VIRTUAL_BOTTOM):
        pivot = toes[0] if event == _BOTTOM else 0.5 * (toes[0] + toes[1])
        return u * u + v * v + (x - pivot) * path[4] + y * path[5]
    if event == _BACKWARD:
        return -path[4]
    if event == _REST:
        return -2.0 * (u * path[4] + v * path[5])
    return u
