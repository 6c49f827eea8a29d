"""Which of a node's guards fires first along a path, and exactly when.

The exact kernel's polynomials and the closed-form maps share this code.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import inner
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event
from template_control.slip.dynamics.guards import all_guards, guard, guard_rate
from template_control.slip.dynamics.path import Path, sample

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_FALL = int(Event.FALL)
_BACKWARD = int(Event.BACKWARD)
_ARMING = 1e-10  # a guard must have been this far below zero before it can fire
_ITERATIONS = 60
_BRACKET_DONE = 1e-14  # [s]
_CLOSE = 1e-9  # [s]; Newton's step after one this short is below rounding
_CURVATURE = 1e4  # [1/s^3]; what the inverse cubic leaves over (step * last step)^2
_ZERO = 1e-9  # of l0 (a bracket of no width around a jump holds no root)


class Watch(NamedTuple):
    """The guards of a phase, and what is kept while they are watched.

    Attributes:
        events: values of the node's Events, edge by edge.
        toes: (2,) x of rear and front toe [m].
        rest_length: l0 [m].
        touchdown_height: l0 sin(alpha) [m].
        values: (2, NUM_EVENTS) the guards at either end of a substep; from :func:`arm`.
        armed: (MAX_EDGES,) which may fire; from :func:`arm`.
        out: (6,) a sample of the path, overwritten; complex for complex steps.
    """

    events: IntArray
    toes: Array
    rest_length: float
    touchdown_height: float
    values: Array
    armed: NDArray[np.bool_]
    out: Array


@inner
def arm(watch: Watch, state: Array) -> None:
    """Prepare ``watch`` at the start of a phase, where the CoM is at ``state`` (4,).

    A guard that is zero there does not fire there; forbidden regions count at once.
    """
    events, values, armed = watch.events, watch.values, watch.armed
    all_guards(state, watch.toes, watch.rest_length, watch.touchdown_height, values[0])
    for i in range(events.shape[0]):
        e = events[i]
        armed[i] = values[0, e] < -_ARMING or e in (_FALL, _BACKWARD)


@inner
def _inverse_hermite(t0: float, g0: float, r0: float, t1: float, g1: float, r1: float) -> float:
    """Zero of g by the inverse cubic through two points with their rates."""
    h = g1 - g0
    m0, m1, secant = 1.0 / r0, 1.0 / r1, (t1 - t0) / h
    cubic = (m0 + m1 - 2.0 * secant) / (h * h)
    return t1 - m1 * g1 + g1 * g1 * ((m1 - secant) / h - cubic * g0)


@inner
def root(
    kind: int,
    path: Path,
    event: int,
    start: float,
    bracket: tuple[float, float],
    tolerance: float,
    watch: Watch,
) -> float:
    """Time within ``bracket`` at which the guard rises through 0, -1 if it does not.

    Newton's method, then the inverse cubic through the last two points, kept bracketed. In
    complex arithmetic the imaginary part carries the event time's derivative, which two
    more steps make exact.

    Args:
        kind, path: on which the guard is taken.
        event: value of the guard's Event.
        start: where to begin [s].
        bracket: earliest and latest time [s].
        tolerance: of the time [s].
        watch: toes and lengths; its ``out`` is overwritten.
    """
    toes, rest_length, out = watch.toes, watch.rest_length, watch.out
    lo, hi = bracket
    out[0] = 0.0
    t = start + out[0]  # of the path's type
    t_last = g_last = rate_last = t
    step_last = np.inf
    polish = 2 if np.iscomplexobj(out) else 0
    for _ in range(_ITERATIONS):
        sample(kind, path, t, out)
        g = guard(event, out, toes, rest_length, watch.touchdown_height)
        rate = guard_rate(event, out, toes)
        if g.real >= 0.0:
            hi = min(hi, t.real)
        else:
            lo = max(lo, t.real)
        following = t - g / rate
        if _CLOSE < step_last < np.inf:
            following = _inverse_hermite(t_last, g_last, rate_last, t, g, rate)
        if rate.real > 0.0 and lo <= following.real <= hi:
            step = abs(following - t)
            done = step <= _CLOSE or _CURVATURE * (step * step_last) ** 2 <= tolerance
            t_last, g_last, rate_last, step_last = t, g, rate, step
            t = following
            if done:
                if polish == 0:
                    return t
                polish -= 1
                step_last = 0.0
        else:
            if hi - lo <= _BRACKET_DONE:
                return t if abs(g) <= _ZERO * rest_length else 0.0 * t - 1.0
            t = 0.5 * (lo + hi) + 0.0 * t
            step_last = np.inf
    return 0.0 * t - 1.0


@inner
def first_event(
    kind: int, path: Path, horizon: float, substep: float, tolerance: float, watch: Watch
) -> tuple[int, float]:
    """First of a node's guards that fires within ``horizon``, and when.

    Args:
        kind, path: the CoM's, see :func:`~.path.sample`.
        horizon: where to stop looking [s].
        substep: a guard is taken to rise through zero at most once within it [s].
        tolerance: of event times [s].
        watch: the node's guards, once :func:`arm` has seen the phase's start; updated.

    Returns:
        Which of the watched events, -1 if none fires, and the time [s].
    """
    events, values, armed, out = watch.events, watch.values, watch.armed, watch.out
    out[0] = 0.0
    fired, fired_at = -1, horizon + out[0]
    t_lo = 0.0
    while t_lo < horizon and fired < 0:
        t_hi = min(t_lo + substep, horizon)
        if t_hi > horizon - 1e-6 * substep:
            t_hi = horizon
        sample(kind, path, t_hi, out)
        rose = False
        all_guards(out, watch.toes, watch.rest_length, watch.touchdown_height, values[1])
        for i in range(events.shape[0]):
            g = values[1, events[i]]
            if g < -_ARMING:
                armed[i] = True
            elif g >= 0.0 and armed[i]:
                rose = True
        if rose:
            for i in range(events.shape[0]):
                g_lo, g_hi = values[0, events[i]], values[1, events[i]]
                if not armed[i] or g_hi < 0.0:
                    continue
                t = t_lo + 0.0 * fired_at
                if g_lo < 0.0:
                    start = t_lo - g_lo * (t_hi - t_lo) / (g_hi - g_lo)
                    t = root(kind, path, events[i], start, (t_lo, t_hi), tolerance, watch)
                if fired < 0 or t.real < fired_at.real:
                    fired, fired_at = i, t
        for i in range(NUM_EVENTS):
            values[0, i] = values[1, i]
        t_lo = t_hi
    return fired, fired_at
