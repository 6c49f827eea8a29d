"""First of a node's guards to fire along a path, and its exact time.

The exact kernel's polynomials and the closed-form maps share this code. Guards are looked at
where substeps end. Bounds of their second derivatives exclude that one rises in between, or lead
to where it does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, BoolArray, IntArray
from template_control.compiled import inner
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event
from template_control.slip.dynamics.guards import (
    SERIES,
    Path,
    all_guards,
    guard,
    guard_rate,
    sample,
)

_ARMING = 1e-10  # a guard must have been this far below zero before it can fire
_ROUNDING = 2.2e-16  # of a guard [SI]
_LOOKS = 2000  # at a guard within a substep: ten do, and only a state that is not finite needs more
_ITERATIONS = 60
_BRACKET_DONE = 1e-14  # [s]
_CLOSE = 1e-9  # [s]; Newton's step after one this short is below rounding
_CURVATURE = 1e4  # [1/s^3]; what the inverse cubic leaves over (step * last step)^2
_GRAZING = 300.0  # [1/s], relative change of a guard's rate over time: its inverse is no cubic
_ZERO = 1e-9  # of l0 (a bracket of no width around a jump holds no root)


class Watch(NamedTuple):
    """The guards of a phase, and what is kept while they are watched.

    ``events`` are the node's, edge by edge. :func:`arm` writes ``values`` (2, NUM_EVENTS), the
    guards at either end of a substep, and ``armed`` (MAX_EDGES,), which may fire. ``bends`` are
    from :func:`~.guards.all_bends`; with zeros guards are only looked at where substeps end.
    """

    events: IntArray
    toes: Array
    rest_length: float
    touchdown_height: float
    values: Array
    armed: BoolArray
    bends: Array
    out: Array
    probe: Array


@inner
def arm(watch: Watch, state: Array, fired: int) -> None:
    """Prepare ``watch`` for a phase that the event ``fired`` begins, -1 at a stride's start.

    A guard that is zero there does not fire there, but for forbidden regions, and the touchdown of
    a foot that is on the ground already.
    """
    events, values, armed = watch.events, watch.values, watch.armed
    all_guards(state, watch.toes, watch.rest_length, watch.touchdown_height, values[0])
    for i in range(events.shape[0]):
        e = events[i]
        lands = e == Event.TOUCHDOWN and e != fired and values[0, e] <= _ARMING
        armed[i] = values[0, e] < -_ARMING or e in (Event.FALL, Event.BACKWARD) or lands


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
    """Time within ``bracket`` at which the guard rises through 0, -1 if it does not [s].

    Newton's method, then the inverse cubic through the last two points, kept bracketed.
    """
    toes, rest_length, out = watch.toes, watch.rest_length, watch.out
    lo, hi = bracket
    t = start
    t_last = g_last = rate_last = t
    step_last = np.inf
    for _ in range(_ITERATIONS):
        sample(kind, path, t, out)
        g = guard(event, out, toes, rest_length, watch.touchdown_height)
        rate = guard_rate(event, out, toes)
        if g >= 0.0:
            hi = min(hi, t)
        else:
            lo = max(lo, t)
        following = t - g / rate
        grazes = False
        if _CLOSE < step_last < np.inf:
            slowest = min(rate, rate_last)
            grazes = abs(rate - rate_last) > _GRAZING * slowest * step_last
            if not grazes:
                following = _inverse_hermite(t_last, g_last, rate_last, t, g, rate)
        if rate > 0.0 and lo <= following <= hi:
            step = abs(following - t)
            done = step <= _CLOSE or (
                not grazes and _CURVATURE * (step * step_last) ** 2 <= tolerance
            )
            t_last, g_last, rate_last, step_last = t, g, rate, step
            t = following
            if done:
                return t
        else:
            if hi - lo <= _BRACKET_DONE:
                return t if abs(g) <= _ZERO * rest_length else -1.0
            t = 0.5 * (lo + hi)
            step_last = np.inf
    return -1.0


@inner
def _clear(g_lo: float, g_hi: float, bend: float, width: float) -> bool:
    """True if a function cannot rise above zero within an interval of a width.

    It lies below the parabola through its ends that bends down by its greatest second derivative.
    """
    sag = 0.5 * bend * width * width
    return sag <= _ROUNDING - g_lo - g_hi + 2.0 * np.sqrt(g_lo * g_hi)


@inner
def _comes_near(values: Array, event: int, sag: float) -> bool:
    """True if :func:`_clear` is to be asked: the mean of two values is at least the smaller one."""
    g_lo, g_hi = values[0, event], values[1, event]
    highest = max(g_lo, g_hi)
    return highest >= -_ARMING or sag > -(g_lo + g_hi) - 2.0 * highest


@inner
def _first_rise(
    kind: int, path: Path, edge: int, span: tuple[float, float], tolerance: float, watch: Watch
) -> float:
    """Time at which a watched guard first fires within a substep, inf if it does not [s].

    The substep is halved until each part, from the first on, either holds no rise, by the bound of
    the guard's second derivative, or ends above zero. No rise is missed, however short the guard is
    above or below zero. ``span`` are the substep's ends, where ``watch`` holds the guard.
    """
    event, probe = watch.events[edge], watch.probe
    toes, rest_length, height = watch.toes, watch.rest_length, watch.touchdown_height
    (t_lo, t_end), armed = span, watch.armed[edge]
    g_lo, g_end = watch.values[0, event], watch.values[1, event]
    bend = watch.bends[event]
    begin, found = t_lo, np.inf
    if armed and g_lo >= 0.0:
        # The phase begins at zero, or in a forbidden region.
        sample(kind, path, t_lo, probe)
        rate = guard_rate(event, probe, toes)
        falls = rate < 0.0 and rate * rate > 2.0 * _ROUNDING * bend
        if g_lo > _ARMING or not (falls or (rate <= 0.0 and g_end < 0.0)):
            return begin
        armed = False
    floor = 0.0 if event == Event.TOUCHDOWN else -_ARMING
    t_hi, g_hi = t_end, g_end
    for _ in range(_LOOKS):
        if t_lo >= t_end:
            break
        if armed and g_hi >= 0.0 and t_hi != found:
            start = t_lo - g_lo * (t_hi - t_lo) / (g_hi - g_lo)
            found = root(kind, path, event, start, (t_lo, t_hi), tolerance, watch)
            t_hi = t_end = found
            g_hi = g_end = 0.0
            continue
        width = t_hi - t_lo
        if armed:
            clear = _clear(g_lo, g_hi, bend, width)
        elif g_hi < floor:
            clear = armed = _clear(0.0, g_hi, bend, width)
        else:
            clear = _clear(min(floor - g_lo, 0.0), floor - g_hi, bend, width)
        if clear:
            t_lo, g_lo = t_hi, g_hi
            t_hi = min(t_lo + 2.0 * width, t_end)
        else:
            t_hi = t_lo + 0.5 * width
        if t_hi == t_end:
            g_hi = g_end
        else:
            sample(kind, path, t_hi, probe)
            g_hi = guard(event, probe, toes, rest_length, height)
    watch.armed[edge] = armed
    return found


@inner
def first_event(
    kind: int, path: Path, horizon: float, substep: float, tolerance: float, watch: Watch
) -> tuple[int, float]:
    """Index of the first of a node's guards that fires within ``horizon``, and its time [s].

    -1 and ``horizon`` if none fires; then ``watch.out`` holds the path there. Guards that come
    close to zero are looked at every ``substep`` [s] at least. :func:`arm` comes before.
    """
    events, values, bends, out = watch.events, watch.values, watch.bends, watch.out
    fired, fired_at = -1, horizon
    t_lo = 0.0
    # The bounds of a series' guards often clear all of it, or a half, at once.
    reach = horizon if kind == SERIES else substep
    while t_lo < horizon and fired < 0:
        t_hi = min(t_lo + reach, horizon)
        if t_hi > horizon - 1e-6 * substep:
            t_hi = horizon
        sample(kind, path, t_hi, out)
        all_guards(out, watch.toes, watch.rest_length, watch.touchdown_height, values[1])
        half = 0.5 * (t_hi - t_lo) ** 2
        near = False
        for i in range(events.shape[0]):
            near |= _comes_near(values, events[i], half * bends[events[i]])
        if near and reach > substep:
            reach *= 0.5
            continue
        if near:
            for i in range(events.shape[0]):
                if _comes_near(values, events[i], half * bends[events[i]]):
                    t = _first_rise(kind, path, i, (t_lo, t_hi), tolerance, watch)
                    if t < np.inf and (fired < 0 or t < fired_at):
                        fired, fired_at = i, t
        for i in range(NUM_EVENTS):
            values[0, i] = values[1, i]
        t_lo = t_hi
    return fired, fired_at
