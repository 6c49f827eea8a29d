"""Plan of the centre of pressure through a list of phases, each with its feet on the ground.

One horizontal direction at a time. The CoM at x, over a centre of pressure p and at a height y that
is known in time, has

    x'' = w^2 (x - p),   w^2 = (g + y'') / y.

A phase is cut into pieces of a constant p_k each. Of all p_k within what the feet of their phases
bear, those are taken that have the least

    sum dt_k (p_k - wish_k)^2 + sum T^2 / dt_k (p_k - p_(k-1))^2
        + R (|x_N - x*|^2 + |x'_N - x'*|^2 / w_N^2),

a quadratic program with bounds, which :func:`bounded` solves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.cholesky import cholesky, solve_cholesky
from template_control.compiled import compiled, constant
from template_control.slip.dynamics.timed import TERMS, Quintic, polynomial, quintic
from template_control.warm_up import Part

SMOOTH = 0.1
"""T, over which p is to change [s, of the reference template]."""
ARRIVE = 2000.0
"""R, what an error at the end costs [s, of the reference template]."""
UNLOADING = 0.06
"""Time over which a foot that is to lift off gives up its load [s, of the reference template]."""
LIGHTEST = 0.05
"""Least load of the legs, over the weight: they do not pull."""
_ROUNDS = 100  # of the active set
_PULL = 1e-9  # from a bound, which frees nothing
# A metre by which an end is missed, made good all along a way of a duration T, moves the centre of
# pressure by 1 m and this over (w T)^2.
_LED = 6.0
_FIRST = constant(0)  # way
_DIRECTIONS = 9  # of x and x' / w at the end, in which an end may be out of reach
# Largest w times the duration that is planned with, about twice that of a CoM that stays up. One
# that falls diverges so fast that of the program nothing would be left but rounding.
_GROWTH = 10.0


class Pieces(NamedTuple):
    """Pieces of the phases, in order; arrays are (n,)."""

    duration: Array  # [s]
    rate: Array  # w [1/s]
    low: Array  # x between which p has to be [m]
    high: Array
    wish: Array  # where p is liked best [m]


@compiled
def bounded(matrix: Array, right: Array, low: Array, high: Array, x: Array) -> None:
    """Write the x (n,) with the least x' matrix x / 2 - right' x between bounds.

    By an active set: from the least without bounds, cut at them, to the least of what no bound
    holds, or to the first bound on the way; there what is pulled away most from its bound is freed.
    ``matrix`` (n, n) is positive definite.
    """
    n = x.shape[0]
    side = np.zeros(n, np.int64)  # -1: at its lower bound, 1: at its upper one
    work, slope, step = matrix.copy(), np.empty(n), np.empty((n, 1))
    step[:, 0] = right
    cholesky(work, n)
    solve_cholesky(work, n, step)
    for i in range(n):
        wish = step[i, 0]
        side[i] = -1 if wish <= low[i] else 1 if wish >= high[i] else 0
        x[i] = min(max(wish, low[i]), high[i])
    for _ in range(_ROUNDS):
        for i in range(n):
            slope[i] = -right[i]
            for j in range(n):
                slope[i] += matrix[i, j] * x[j]
                free = side[i] == 0 and side[j] == 0
                work[i, j] = matrix[i, j] if free else 1.0 if i == j else 0.0
            step[i, 0] = -slope[i] if side[i] == 0 else 0.0
        cholesky(work, n)
        solve_cholesky(work, n, step)
        share, hit, most, freed = 1.0, -1, _PULL, -1
        for i in range(n):
            bound = high[i] if step[i, 0] > 0.0 else low[i]
            if side[i] == 0 and share * abs(step[i, 0]) > abs(bound - x[i]):
                share, hit = (bound - x[i]) / step[i, 0], i
        for i in range(n):
            x[i] += share * step[i, 0]
            pull = slope[i]
            for j in range(n):
                pull += matrix[i, j] * step[j, 0]
            if pull * side[i] > most:
                most, freed = pull * side[i], i
        if hit >= 0:
            side[hit] = 1 if step[hit, 0] > 0.0 else -1
            x[hit] = high[hit] if step[hit, 0] > 0.0 else low[hit]
        elif freed >= 0:
            side[freed] = 0
        else:
            break


@compiled
def pressure(
    pieces: Pieces, start: Array, end: Array, first: float, prices: tuple[float, float], p: Array
) -> float:
    """Write the centres of pressure ``p`` (n,) of the pieces; how far the end is missed [m].

    ``start`` and ``end`` (2,) are x and x' [m, m/s]; ``first`` is p before the first piece [m], NaN
    where it may jump; ``prices`` are T and R [s]. The miss is |x_N - x*| + |x'_N - x'*| / w_N.
    Rates that are too large to plan with are made smaller.
    """
    gain, left = np.empty((2, p.shape[0])), np.empty(2)
    _response(pieces, start, end, gain, left)
    return _solved(pieces, gain, left, first, prices, p)


@compiled
def _response(pieces: Pieces, start: Array, end: Array, gain: Array, left: Array) -> None:
    """Write what of x and x' / w (2,) at the end is ``left`` to p, and the ``gain`` (2, n) of each.

    Rates that are too large to plan with are made smaller.
    """
    n = pieces.rate.shape[0]
    most = _GROWTH / pieces.duration.sum()
    x, v = start[0], start[1]
    for k in range(n):
        pieces.rate[k] = min(pieces.rate[k], most)
        w, dt = pieces.rate[k], pieces.duration[k]
        c, s = np.cosh(w * dt), np.sinh(w * dt)
        for j in range(k):
            gain[0, j], gain[1, j] = _carried(gain[0, j], gain[1, j], w, 0.0, c, s)
        gain[0, k], gain[1, k] = _carried(0.0, 0.0, w, 1.0, c, s)
        x, v = _carried(x, v, w, 0.0, c, s)
    last = pieces.rate[n - 1]
    for j in range(n):
        gain[1, j] /= last
    left[0], left[1] = end[0] - x, (end[1] - v) / last


@compiled
def _least_miss(pieces: Pieces, gain: Array, left: Array) -> float:
    """A miss that no p within its bounds can fall below [m]."""
    least = 0.0
    for i in range(_DIRECTIONS):
        share = 2.0 * i / (_DIRECTIONS - 1) - 1.0
        low = high = -left[0] - share * left[1]
        for k in range(gain.shape[1]):
            g = gain[0, k] + share * gain[1, k]
            low += g * (pieces.low[k] if g > 0.0 else pieces.high[k])
            high += g * (pieces.high[k] if g > 0.0 else pieces.low[k])
        least = max(least, low, -high)
    return least


@compiled
def _solved(
    pieces: Pieces,
    gain: Array,
    left: Array,
    first: float,
    prices: tuple[float, float],
    p: Array,
) -> float:
    """Write the best p (n,); the miss [m]."""
    n = p.shape[0]
    smooth, arrive = prices
    matrix, right = np.zeros((n, n)), np.empty(n)
    for i in range(n):
        for j in range(n):
            matrix[i, j] = arrive * (gain[0, i] * gain[0, j] + gain[1, i] * gain[1, j])
        matrix[i, i] += pieces.duration[i]
        right[i] = arrive * (gain[0, i] * left[0] + gain[1, i] * left[1])
        right[i] += pieces.duration[i] * pieces.wish[i]
        price = smooth * smooth / pieces.duration[i]
        if i > 0:
            matrix[i, i] += price
            matrix[i - 1, i - 1] += price
            matrix[i, i - 1] -= price
            matrix[i - 1, i] -= price
        elif not np.isnan(first):
            matrix[0, 0] += price
            right[0] += price * first
    bounded(matrix, right, pieces.low, pieces.high, p)
    miss = 0.0
    for axis in range(2):
        off = left[axis]
        for j in range(n):
            off -= gain[axis, j] * p[j]
        miss += abs(off)
    return miss


class Ground(NamedTuple):
    """Template, and how the use of the ground under its feet is priced."""

    gravity: tuple[float, float]  # its parts into the ground, and along it, backward [m/s^2]
    reach: float  # longest way from a foot to the CoM [m]
    slack: float  # excess that costs nothing [m]
    unloading: float  # time before a liftoff in which the foot gives up its load [s]
    smooth: float  # T [s]
    arrive: float  # R [s]
    jumps: bool  # whether p may at once be anywhere


class Ways(NamedTuple):
    """Ways of the CoM that are tried, the cheapest first. They go through s stages each.

    Stages are (n, s, 7): duration [s]; low and high, x between which the feet bear the centre of
    pressure; where it is liked best; x of both feet that stand [m]; whether the first of them lifts
    off at the stage's end.
    """

    stages: Array
    ends: Array  # (n, 2, 3) x and y where they end, each position, velocity, acceleration
    price: Array  # (n,) [m]


@compiled
def _excess(
    start: Array, ways: Ways, i: int, ground: Ground, pieces: Pieces, p: Array, most: float
) -> float:
    """Excess of the i-th way [m], and its ``p``; no more than a bound of it beyond ``most``."""
    n, (across, along) = p.shape[0], ground.gravity
    stages, end, rise = ways.stages[i], ways.ends[i], np.empty(TERMS)
    count, time = n // stages.shape[0], 0.0
    quintic(start[1], end[1], stages[:, 0].sum(), rise)
    for k in range(n):
        stage = stages[k // count]
        dt, left = stage[0] / count, 1.0
        # The acceleration at the end is that of the path after it.
        y, _, lift = polynomial(rise, time + (0.5 if k < n - 1 else 1.0) * dt)
        lift = max(across + lift, LIGHTEST * across)
        pieces.duration[k] = dt
        pieces.rate[k] = np.sqrt(lift / max(y, LIGHTEST * ground.reach))
        if stage[6] > 0.0:
            left = min((count - k % count - 1) * dt / ground.unloading, 1.0)
        # On a slope the CoM is as over a centre of pressure further uphill.
        uphill = along / pieces.rate[k] ** 2
        pieces.low[k] = stage[5] + left * (stage[1] - stage[5]) + uphill
        pieces.high[k] = stage[5] + left * (stage[2] - stage[5]) + uphill
        pieces.wish[k] = stage[3] + uphill
        time += dt
    gain, missed = np.empty((2, n)), np.empty(2)
    _response(pieces, start[0], end[0], gain, missed)
    led = 1.0 + _LED / (pieces.rate[n - 1] * time) ** 2
    excess = led * _least_miss(pieces, gain, missed)
    if excess > most:
        return excess
    first = np.nan if ground.jumps else start[0, 0] - start[0, 2] / pieces.rate[0] ** 2
    excess = led * _solved(pieces, gain, missed, first, (ground.smooth, ground.arrive), p)
    x, v, time = start[0, 0], start[0, 1], 0.0
    for k in range(n):
        x, v = _after(x, v, pieces.rate[k], p[k], pieces.duration[k])
        time += pieces.duration[k]
        y, _, _ = polynomial(rise, time)
        stage = stages[k // count]
        away = max(abs(x - stage[4]), abs(x - stage[5]))
        excess = max(excess, np.sqrt(away * away + y * y) - ground.reach)
    return excess


@compiled
def best_way(
    start: Array, ways: Ways, ground: Ground, p: Array, rates: Array
) -> tuple[int, float, float]:
    """Number, cost and excess [m] of the best way from ``start`` (2, 3).

    The height is a quintic. The cost is the price and the excess beyond the slack: the miss of the
    end, or by how far a leg would be longer than its reach. A way within the slack is better than
    any that is not. Centres of pressure ``p`` (k,) and w ``rates`` (k,) are overwritten; each
    stage has as many pieces.
    """
    n = p.shape[0]
    pieces = Pieces(np.empty(n), rates, np.empty(n), np.empty(n), np.empty(n))
    best, chosen = np.inf, _FIRST
    for i in range(ways.price.shape[0]):
        excess = _excess(start, ways, i, ground, pieces, p, ground.slack)
        if excess <= ground.slack:
            return i, ways.price[i], excess
        if excess - ground.slack + ways.price[i] < best:
            best, chosen = excess - ground.slack + ways.price[i], i
    excess = _excess(start, ways, chosen, ground, pieces, p, np.inf)
    return chosen, max(excess - ground.slack, 0.0) + ways.price[chosen], excess


@compiled
def _after(x: float, v: float, w: float, p: float, dt: float) -> tuple[float, float]:
    """Position and velocity after a piece."""
    return _carried(x, v, w, p, np.cosh(w * dt), np.sinh(w * dt))


@compiled
def _carried(x: float, v: float, w: float, p: float, c: float, s: float) -> tuple[float, float]:
    """The same, with cosh and sinh of w dt."""
    return p + c * (x - p) + s / w * v, w * s * (x - p) + c * v


def curve_over(
    start: Array, end: Array, durations: Array, pressures: Array, rates: Array, led: bool
) -> tuple[Quintic, ...]:
    """The curve over centres of pressure (n,) [m], for ``durations`` (n,) [s] and w ``rates``.

    Where it is ``led``, what it misses of place and speed of its ``end`` (2, 3) is added smoothly;
    its last centre of pressure stays.
    """
    (x, v), ends, whole = start[0, :2].tolist(), [], float(durations.sum())
    for dt, p, w in zip(durations.tolist(), pressures, rates, strict=True):
        begin = x, v, w * w * (x - p)
        x, v = _after(x, v, w, p, dt)
        ends.append((dt, np.array((begin, (x, v, w * w * (x - p))))))
    missed, w = end[0, :2] - (x, v), rates[-1]
    missing = np.array((*missed, w * w * missed[0])) * led
    added, rise, pieces, time = np.empty(TERMS), np.empty(TERMS), [], 0.0
    quintic(np.zeros(3), missing, whole, added)
    quintic(start[1], end[1], whole, rise)
    for dt, ahead in ends:
        c, times = np.empty((2, TERMS)), (time, time + dt)
        ahead += [polynomial(added, t) for t in times]
        up = np.array([polynomial(rise, t) for t in times])
        quintic(ahead[0], ahead[1], dt, c[0])
        quintic(up[0], up[1], dt, c[1])
        pieces.append(Quintic(c, dt))
        time += dt
    return tuple(pieces)


def plans() -> None:
    """A plan, and a curve's value, made to compile them."""
    states, one = np.ones((1, 2, 3)), np.ones(2)
    ground = Ground((9.81, 0.0), 1.0, 0.0, UNLOADING, SMOOTH, ARRIVE, False)
    best_way(states[0], Ways(np.ones((1, 1, 7)), states, np.ones(1)), ground, one, one.copy())
    polynomial(one, 1.0)


PRESSURE = (Part(plans, 5.3),)
"""Compiled functions of a plan of the centre of pressure."""
