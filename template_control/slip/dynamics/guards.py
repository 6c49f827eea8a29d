"""Guards along paths of the CoM: their values and rates, and the first of a node's that fires.

The exact kernel's polynomials and the closed-form maps share this code. Guards are looked at where
substeps end. Bounds of their second derivatives exclude that one rises in between, or lead to where
it does.

Three kinds of path: ``SERIES`` (the exact kernel's Taylor polynomials), ``STANCE`` (the closed form
(11) about a pivot) and ``FLIGHT`` (10).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, BoolArray, IntArray
from template_control.compiled import constant, inner
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event

SERIES, STANCE, FLIGHT = map(constant, range(3))
COEFFICIENTS = 12

_ARMING = 1e-10  # a guard must have been this far below zero before it can fire
_ROUNDING = 2.2e-16  # of a guard [SI]
_LOOKS = 2000  # at a guard within a substep: ten do, and only a state that is not finite needs more
_ITERATIONS = 60
_BRACKET_DONE = 1e-14  # [s]
_CLOSE = 1e-9  # [s]; Newton's step after one this short is below rounding
_CURVATURE = 1e4  # [1/s^3]; what the inverse cubic leaves over (step * last step)^2
_GRAZING = 300.0  # [1/s], relative change of a guard's rate over time: its inverse is no cubic
_ZERO = 1e-9  # of l0 (a bracket of no width around a jump holds no root)


class Path(NamedTuple):
    """A path of the CoM in time, world frame, by its coefficients a and b.

    SERIES: of the polynomials of x and y, constant term first. STANCE: a is (12,), about a pivot at
    x = a0, r = a1 + a8 t + a9 t^2 + a2 sin(a5 t) + a3 cos(a5 t) and theta = a4 + a6 t + a10 t^2 +
    a11 t^3 + a7 (a2 cos(a5 t) - a3 sin(a5 t)), which is (11) where a8 to a11 are zero. FLIGHT: a is
    (6,) x, y, dx/dt, dy/dt at t = 0 and gravity, into the ground and along it.
    """

    a: Array
    b: Array


@inner
def _series(path: Path, t: float, out: Array) -> None:
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


@inner
def _stance(path: Path, t: float, out: Array) -> None:
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


@inner
def _flight(path: Path, t: float, out: Array) -> None:
    a = path.a
    out[0], out[1] = a[0] + (a[2] - 0.5 * a[5] * t) * t, a[1] + (a[3] - 0.5 * a[4] * t) * t
    out[2], out[3] = a[2] - a[5] * t, a[3] - a[4] * t
    out[4], out[5] = -a[5], -a[4]


@inner
def sample(kind: int, path: Path, t: float, out: Array) -> None:
    """Write x, y and their first two derivatives at a time on a path.

    Args:
        kind: SERIES, STANCE or FLIGHT.
        path: its coefficients.
        t: since the start of the path [s].
        out: (6,) overwritten.
    """
    if kind == SERIES:
        _series(path, t, out)
    elif kind == STANCE:
        _stance(path, t, out)
    else:
        _flight(path, t, out)


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
    bends[Event.TOUCHDOWN] = bends[Event.FALL] = acceleration
    bends[Event.VLO] = bends[Event.PASSED_FRONT_FOOT] = acceleration
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


class Watch(NamedTuple):
    """The guards of a phase, and what is kept while they are watched.

    ``events`` are the node's, edge by edge. :func:`arm` writes ``values`` (2, NUM_EVENTS), the
    guards at either end of a substep, and ``armed`` (MAX_EDGES,), which may fire. ``bends`` are
    from :func:`all_bends`; with zeros guards are only looked at where substeps end.
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
