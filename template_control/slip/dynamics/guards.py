"""Guards along paths of the CoM, as compiled functions, and their rates of change.

Three kinds of path: ``SERIES`` (the exact kernel's Taylor polynomials), ``STANCE`` (the closed form
(11) about a pivot) and ``FLIGHT`` (10). Compiled code gives the kind as one of these
constants, an argument of its own, and Numba compiles that kind alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from template_control.arrays import Array
from template_control.compiled import inner, inner_by_type
from template_control.slip.automaton.vocabulary import Event

SERIES, STANCE, FLIGHT = 0, 1, 2
COEFFICIENTS = 12


class Path(NamedTuple):
    """A path of the CoM in time, world frame, by its coefficients a and b.

    SERIES: of the polynomials of x and y, constant term first. STANCE: a is (12,), about a pivot at
    x = a0, r = a1 + a8 t + a9 t^2 + a2 sin(a5 t) + a3 cos(a5 t) and theta = a4 + a6 t + a10 t^2 +
    a11 t^3 + a7 (a2 cos(a5 t) - a3 sin(a5 t)), which is (11) where a8 to a11 are zero. FLIGHT: a is
    (6,) x, y, dx/dt, dy/dt at t = 0 and gravity, into the ground and along it.
    """

    a: Array
    b: Array


def _series(kind: int, path: Path, t: float, out: Array) -> None:
    a, b = path
    x = y = u = v = ax = ay = 0.0
    for n in range(a.shape[0] - 1, -1, -1):
        ax = ax * t + u
        ay = ay * t + v
        u = u * t + x
        v = v * t + y
        x = x * t + a[n]
        y = y * t + b[n]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, u, v, 2.0 * ax, 2.0 * ay


def _stance(kind: int, path: Path, t: float, out: Array) -> None:
    a = path.a
    w, swing = a[5], a[7]
    s, c = np.sin(w * t), np.cos(w * t)
    ds, dc = a[2] * s + a[3] * c, a[2] * c - a[3] * s
    r = a[1] + (a[8] + a[9] * t) * t + ds
    dr = a[8] + 2.0 * a[9] * t + w * dc
    ddr = 2.0 * a[9] - w * w * ds
    theta = a[4] + (a[6] + (a[10] + a[11] * t) * t) * t + swing * dc
    rate = a[6] + (2.0 * a[10] + 3.0 * a[11] * t) * t - swing * w * ds
    curve = 2.0 * a[10] + 6.0 * a[11] * t - swing * w * w * dc
    s, c = np.sin(theta), np.cos(theta)
    radial, tangential = ddr - r * rate * rate, 2.0 * dr * rate + r * curve
    out[0], out[1] = a[0] + r * c, r * s
    out[2], out[3] = dr * c - r * rate * s, dr * s + r * rate * c
    out[4] = radial * c - tangential * s
    out[5] = radial * s + tangential * c


def _flight(kind: int, path: Path, t: float, out: Array) -> None:
    a = path.a
    out[0], out[1] = a[0] + (a[2] - 0.5 * a[5] * t) * t, a[1] + (a[3] - 0.5 * a[4] * t) * t
    out[2], out[3] = a[2] - a[5] * t, a[3] - a[4] * t
    out[4], out[5] = -a[5], -a[4]


_BY_KIND = (_series, _stance, _flight)


def sample(kind: int, path: Path, t: float, out: Array) -> None:
    """Write x, y and their first two derivatives at ``t`` [s] of a path into ``out`` (6,)."""
    _BY_KIND[kind](kind, path, t, out)


@inner_by_type(sample)
def _kind(kind: Any, path: Any, t: Any, out: Any) -> Any:
    """That of the literal ``kind``: Numba would compile the branches of all of them."""
    return _BY_KIND[kind.literal_value] if isinstance(kind, types.IntegerLiteral) else None


@inner
def guard(
    event: int, state: Array, toes: Array, rest_length: float, touchdown_height: float
) -> float:
    """Value of the guard of an event; it fires when it rises through 0."""
    x, y, u, v = state[0], state[1], state[2], state[3]
    if event == Event.TOUCHDOWN:
        return touchdown_height - y
    if event == Event.REAR_LIFTOFF:
        return np.sqrt((x - toes[0]) ** 2 + y * y) - rest_length
    if event == Event.FRONT_LIFTOFF:
        return np.sqrt((x - toes[1]) ** 2 + y * y) - rest_length
    if event == Event.APEX:
        return -v
    if event == Event.BOTTOM:
        return (x - toes[0]) * u + y * v
    if event == Event.VIRTUAL_BOTTOM:
        return (x - 0.5 * (toes[0] + toes[1])) * u + y * v
    if event == Event.VLO:
        return x - toes[0]
    if event == Event.PASSED_FRONT_FOOT:
        return x - toes[1]
    if event == Event.FALL:
        return -y
    if event == Event.REST:
        return -(u * u + v * v)
    return -u


@inner
def all_guards(
    state: Array, toes: Array, rest_length: float, touchdown_height: float, values: Array
) -> None:
    """Write all guards into ``values`` by Event: without a branch, faster than a few by one."""
    x, y, u, v = state[0], state[1], state[2], state[3]
    rear, front = x - toes[0], x - toes[1]
    values[Event.TOUCHDOWN] = touchdown_height - y
    values[Event.REAR_LIFTOFF] = np.sqrt(rear * rear + y * y) - rest_length
    values[Event.FRONT_LIFTOFF] = np.sqrt(front * front + y * y) - rest_length
    values[Event.APEX] = -v
    values[Event.BOTTOM] = rear * u + y * v
    values[Event.VIRTUAL_BOTTOM] = 0.5 * (rear + front) * u + y * v
    values[Event.VLO] = rear
    values[Event.PASSED_FRONT_FOOT] = front
    values[Event.FALL] = -y
    values[Event.BACKWARD] = -u
    values[Event.REST] = -(u * u + v * v)


@inner
def all_bends(
    state: Array,
    toes: Array,
    rest_length: float,
    steepest: tuple[float, float, float],
    step: float,
    bends: Array,
) -> None:
    """Write bounds of all guards' second time derivatives along a path into ``bends``, by Event.

    ``steepest`` are those of speed, acceleration and jerk within the path's ``step`` [s]. That of a
    leg holds where it is longer than l0 / 2, and from below always. REST never rises above zero.
    """
    speed, acceleration, jerk = steepest
    x, y = state[0], abs(state[1]) + speed * step
    rear, front = abs(x - toes[0]), abs(x - toes[1])
    turn = 3.0 * speed * acceleration
    bends[Event.TOUCHDOWN] = bends[Event.VLO] = bends[Event.PASSED_FRONT_FOOT] = bends[
        Event.FALL
    ] = acceleration
    bends[Event.APEX] = bends[Event.BACKWARD] = jerk
    bends[Event.BOTTOM] = turn + (rear + y) * jerk
    bends[Event.VIRTUAL_BOTTOM] = turn + (0.5 * (rear + front) + y) * jerk
    bends[Event.REAR_LIFTOFF] = acceleration + 2.0 * speed * speed / rest_length
    bends[Event.FRONT_LIFTOFF] = bends[Event.REAR_LIFTOFF]
    bends[Event.REST] = 0.0


@inner
def guard_rate(event: int, path: Array, toes: Array) -> float:
    """Time derivative of a guard where x, y and their first two derivatives are ``path`` (6,)."""
    x, y, u, v = path[0], path[1], path[2], path[3]
    if event in (Event.TOUCHDOWN, Event.FALL):
        return -v
    if event in (Event.REAR_LIFTOFF, Event.FRONT_LIFTOFF):
        d = x - toes[0 if event == Event.REAR_LIFTOFF else 1]
        return (d * u + y * v) / np.sqrt(d * d + y * y)
    if event == Event.APEX:
        return -path[5]
    if event in (Event.BOTTOM, Event.VIRTUAL_BOTTOM):
        pivot = toes[0] if event == Event.BOTTOM else 0.5 * (toes[0] + toes[1])
        return u * u + v * v + (x - pivot) * path[4] + y * path[5]
    if event == Event.BACKWARD:
        return -path[4]
    if event == Event.REST:
        return -2.0 * (u * path[4] + v * path[5])
    return u


@inner
def guard_gradient(event: int, state: Array, toes: Array, gradient: Array) -> None:
    """Write a guard's derivatives by state, both toes' x and the touchdown height: (7,)."""
    x, y, u, v = state[0], state[1], state[2], state[3]
    for i in range(7):
        gradient[i] = 0.0
    if event == Event.TOUCHDOWN:
        gradient[1], gradient[6] = -1.0, 1.0
    elif event in (Event.REAR_LIFTOFF, Event.FRONT_LIFTOFF):
        leg = 0 if event == Event.REAR_LIFTOFF else 1
        d = x - toes[leg]
        length = np.sqrt(d * d + y * y)
        gradient[0], gradient[1], gradient[4 + leg] = d / length, y / length, -d / length
    elif event == Event.APEX:
        gradient[3] = -1.0
    elif event in (Event.BOTTOM, Event.VIRTUAL_BOTTOM):
        front = 0.5 if event == Event.VIRTUAL_BOTTOM else 0.0
        gradient[0], gradient[1], gradient[3] = u, v, y
        gradient[2] = x - (1.0 - front) * toes[0] - front * toes[1]
        gradient[4], gradient[5] = -(1.0 - front) * u, -front * u
    elif event == Event.VLO:
        gradient[0], gradient[4] = 1.0, -1.0
    elif event == Event.PASSED_FRONT_FOOT:
        gradient[0], gradient[5] = 1.0, -1.0
    elif event == Event.FALL:
        gradient[1] = -1.0
    elif event == Event.REST:
        gradient[2], gradient[3] = -2.0 * u, -2.0 * v
    else:
        gradient[2] = -1.0
