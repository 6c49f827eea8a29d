"""Strides of the template by DOP853 at 1e-12 and a dense search for events: the truth for the map.

It reads the automaton's nodes and edges. Equations of motion, guards, resets and the search are
written here anew: the formulas of DOP853 take steps of at most a millisecond, every extremum of a
guard within a step is located by its rate of change, and an event by bisection between extrema.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.integrate import DOP853

from template_control.slip.automaton.vocabulary import Event, Outcome, Reset

TOLERANCE = 1e-12
LONGEST = 1e-3  # [s]
STILL = 1e-10  # a guard so close to zero at the start of a phase is zero there
_A, _B, _E3, _E5 = (np.ascontiguousarray(a) for a in (DOP853.A, DOP853.B, DOP853.E3, DOP853.E5))
_TIMEOUT = int(Outcome.TIMEOUT)


class World(NamedTuple):
    """Mass, gravity into and along the ground, assist, rest length, touchdown angle, time limit."""

    mass: float
    gravity: float
    along: float
    assist: float
    rest: float
    angle: float
    limit: float


class End(NamedTuple):
    """How a stride ended.

    Attributes:
        outcome: of the stride.
        events: how many there were.
        state: (4,) x, y, dx/dt, dy/dt at the end [m, m/s].
        margin: smallest distance from zero of an extremum of a guard [SI].
        slowest: smallest rate of a guard that fired [SI].
    """

    outcome: Outcome
    events: int
    state: np.ndarray
    margin: float
    slowest: float


@njit
def rates(s, toes, k, world, out):
    ax, ay = -world.along, -world.gravity
    if k[0] > 0.0 and k[1] > 0.0:
        ax += world.assist
    for leg in range(2):
        if k[leg] > 0.0:
            dx, dy = s[0] - toes[leg], s[1]
            length = np.hypot(dx, dy)
            pull = k[leg] * (world.rest - length) / (world.mass * length)
            ax, ay = ax + pull * dx, ay + pull * dy
    out[0], out[1], out[2], out[3] = s[2], s[3], ax, ay


@njit
def advanced(s, h, toes, k, world, stages, out):
    """Write the state ``h`` later into ``out``; the estimated error over the tolerance."""
    for i in range(12):
        for j in range(4):
            out[j] = s[j]
            for m in range(i):
                out[j] += h * _A[i, m] * stages[m, j]
        rates(out, toes, k, world, stages[i])
    for j in range(4):
        out[j] = s[j]
        for i in range(12):
            out[j] += h * _B[i] * stages[i, j]
    rates(out, toes, k, world, stages[12])
    fifth = third = 0.0
    for j in range(4):
        e5 = e3 = 0.0
        for i in range(13):
            e5, e3 = e5 + _E5[i] * stages[i, j], e3 + _E3[i] * stages[i, j]
        scale = TOLERANCE * (1.0 + max(abs(s[j]), abs(out[j])))
        fifth, third = fifth + (e5 / scale) ** 2, third + (e3 / scale) ** 2
    total = fifth + 0.01 * third
    return abs(h) * fifth / np.sqrt(4.0 * total) if total > 0.0 else 0.0


@njit
def leg(s, toe, rest):
    length = np.hypot(s[0] - toe, s[1])
    return length - rest, ((s[0] - toe) * s[2] + s[1] * s[3]) / length


@njit
def turning(s, a, pivot):
    """Half the rate of the squared distance to a pivot on the ground, and its rate."""
    value = (s[0] - pivot) * s[2] + s[1] * s[3]
    return value, s[2] ** 2 + s[3] ** 2 + (s[0] - pivot) * a[2] + s[1] * a[3]


@njit
def watched(event, s, toes, k, world, a):
    """A guard and its rate, by the table in ``Event``."""
    rates(s, toes, k, world, a)
    if event == Event.TOUCHDOWN:
        return world.rest * np.sin(world.angle) - s[1], -s[3]
    if event == Event.REAR_LIFTOFF:
        return leg(s, toes[0], world.rest)
    if event == Event.FRONT_LIFTOFF:
        return leg(s, toes[1], world.rest)
    if event == Event.APEX:
        return -s[3], -a[3]
    if event == Event.BOTTOM:
        return turning(s, a, toes[0])
    if event == Event.VIRTUAL_BOTTOM:
        return turning(s, a, 0.5 * (toes[0] + toes[1]))
    if event == Event.VLO:
        return s[0] - toes[0], s[2]
    if event == Event.PASSED_FRONT_FOOT:
        return s[0] - toes[1], s[2]
    if event == Event.FALL:
        return -s[1], -s[3]
    if event == Event.BACKWARD:
        return -s[2], -a[2]
    return -(s[2] ** 2 + s[3] ** 2), -2.0 * (s[2] * a[2] + s[3] * a[3])


@njit
def bisected(event, s, lo, hi, of_rate, toes, k, world, stages, out, a):
    """Time between ``lo`` and ``hi`` after ``s`` at which guard or rate changes its sign."""
    low = 0.0
    for i in range(60):
        middle = 0.5 * (lo + hi) if i else lo
        advanced(s, middle, toes, k, world, stages, out)
        value = watched(event, out, toes, k, world, a)[1 if of_rate else 0]
        if i == 0:
            low = value
        elif (value < 0.0) == (low < 0.0):
            lo = middle
        else:
            hi = middle
    return hi


@njit
def ascent(event, s, h, ends, below, toes, k, world, stages, out, a):
    """First time within a step at which a guard rises through zero, or inf.

    Args:
        ends: guard and rate at ``s``, guard and rate ``h`` later.
        below: whether the guard has been below zero yet.

    Returns:
        The time, whether the guard has been below zero then, and the smallest distance from zero
        of an extremum within the step.
    """
    g0, r0, g1, r1 = ends
    turns, last, value, close = h, 0.0, g0, np.inf
    if (r0 < 0.0) != (r1 < 0.0):
        turns = bisected(event, s, 0.0, h, True, toes, k, world, stages, out, a)
    for piece in range(2):
        t, g = (turns, g1) if piece == 0 else (h, g1)
        if piece == 0 and turns < h:
            advanced(s, turns, toes, k, world, stages, out)
            g = watched(event, out, toes, k, world, a)[0]
            close = abs(g)
        if below and value < 0.0 <= g:
            t = bisected(event, s, last, t, False, toes, k, world, stages, out, a)
            return t, True, close
        below = below or g < -STILL
        last, value = t, g
    return np.inf, below, close


@njit
def at_once(event, ends):
    """Whether an event happens as a phase begins: in a forbidden region, or a foot that arrives."""
    g, r = ends[0], ends[1]
    if event == Event.BACKWARD or event == Event.FALL:
        return g > 0.0 or (g == 0.0 and ends[2] >= 0.0)
    return event == Event.TOUCHDOWN and abs(g) <= STILL and (r > 0.0 or (g >= 0.0 and r == 0.0))


@njit
def copy(source, target):
    """As ``target[:] = source``, for whose refusal of other shapes Numba would compile strings."""
    for j in range(4):
        target[j] = source[j]


@njit
def _stride(tables, node, s, toes, u, world):
    """As :func:`stride`; ``s`` (4,) and ``toes`` (2,) are overwritten."""
    out, a, stages, nxt = np.empty(4), np.empty(4), np.empty((13, 4)), np.empty(4)
    ends, below, k = np.empty((8, 4)), np.zeros(8, np.bool_), np.empty(2)
    time, events, close, slowest, start = 0.0, 0, np.inf, np.inf, True
    h = LONGEST
    while time < world.limit:
        first, last = tables.first_edge[node], tables.first_edge[node + 1]
        k[0] = u[tables.rear[node]] if tables.rear[node] >= 0 else 0.0
        k[1] = u[tables.front[node]] if tables.front[node] >= 0 else 0.0
        h = min(2.0 * h, LONGEST, world.limit - time)
        while advanced(s, h, toes, k, world, stages, nxt) > 1.0:
            h *= 0.5
        fired, at = -1, np.inf
        for e in range(first, last):
            event, end = tables.event[e], ends[e - first]
            end[0], end[1] = watched(event, s, toes, k, world, a)
            end[2], end[3] = watched(event, nxt, toes, k, world, a)
            t = 0.0
            if start:
                below[e - first] = end[0] < -STILL
            if not (start and at_once(event, end)):
                forbidden = event == Event.BACKWARD or event == Event.FALL
                if event == Event.TOUCHDOWN and start and end[0] < 0.0:
                    below[e - first] = True
                t, below[e - first], turn = ascent(
                    event, s, h, end, below[e - first] or forbidden,
                    toes, k, world, stages, out, a,
                )  # fmt: skip
                if event != Event.REST:
                    close = min(close, turn)
            if t < at:
                fired, at = e, t
        start = False
        if fired < 0:
            copy(nxt, s)
            time += h
            continue
        advanced(s, at, toes, k, world, stages, out)
        copy(out, s)
        slowest = min(slowest, abs(watched(tables.event[fired], s, toes, k, world, a)[1]))
        time, events, start = time + at, events + 1, True
        reset = tables.reset[fired]
        if reset == Reset.PLACE_REAR:
            toes[0] = s[0] + world.rest * np.cos(world.angle)
        elif reset == Reset.PLACE_FRONT:
            toes[1] = s[0] + world.rest * np.cos(world.angle)
        elif reset == Reset.SHIFT:
            toes[0] = toes[1]
        elif reset == Reset.SWAP:
            toes[0], toes[1] = toes[1], toes[0]
        if tables.outcome[fired] >= 0:
            return tables.outcome[fired], events, close, slowest
        node = tables.target[fired]
    return _TIMEOUT, events, close, slowest


def stride(p, automaton, start, state, u):
    """One stride from node ``start`` by controls ``u``, the rear toe at x = 0."""
    limit = 20.0 * np.sqrt(p.rest_length / p.gravity)
    world = World(p.mass, *p.gravity_parts, p.assist, p.rest_length, u[0], limit)
    end, node = np.array(state, dtype=float), automaton.index[start]
    outcome, *rest = _stride(automaton.tables, node, end, np.zeros(2), u, world)
    return End(Outcome(outcome), rest[0], end, *rest[1:])
