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

from math import factorial
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
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
_ROUNDS = 30  # of the active set
_HELD = 1e-9  # [m]: a bound that is nearer holds
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

    By a primal-dual active set: the bounds that hold are guessed, the free part is solved for, and
    what violates a bound, or is pulled away from it, changes sides. ``matrix`` (n, n) is positive
    definite, so that few rounds suffice.
    """
    n = x.shape[0]
    side = np.zeros(n, np.int64)  # -1: at its lower bound, 1: at its upper one
    work, part = np.empty((n, n)), np.empty(n)
    for _ in range(_ROUNDS):
        for i in range(n):
            if side[i] == 0:
                for j in range(n):
                    work[i, j] = matrix[i, j] if side[j] == 0 else 0.0
                part[i] = right[i]
                for j in range(n):
                    if side[j] != 0:
                        part[i] -= matrix[i, j] * (low[j] if side[j] < 0 else high[j])
            else:
                for j in range(n):
                    work[i, j] = 1.0 if i == j else 0.0
                part[i] = low[i] if side[i] < 0 else high[i]
        _solve(work, part)
        changed = False
        for i in range(n):
            x[i] = part[i]
        for i in range(n):
            if side[i] == 0:
                new = -1 if x[i] < low[i] - _HELD else 1 if x[i] > high[i] + _HELD else 0
            else:
                pull = right[i]
                for j in range(n):
                    pull -= matrix[i, j] * x[j]
                new = side[i] if pull * side[i] > 0.0 else 0
            if new != side[i]:
                side[i], changed = new, True
        if not changed:
            break
    for i in range(n):
        x[i] = min(max(x[i], low[i]), high[i])


@compiled
def _solve(a: Array, b: Array) -> None:
    """Overwrite ``b`` (n,) with the solution of a x = b, by elimination; ``a`` is overwritten.

    No pivots are sought: ``a`` is positive definite but for rows of the unit matrix.
    """
    n = b.shape[0]
    for k in range(n):
        for i in range(k + 1, n):
            if a[i, k] == 0.0:
                continue
            f = a[i, k] / a[k, k]
            for j in range(k, n):
                a[i, j] -= f * a[k, j]
            b[i] -= f * b[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]


@compiled
def pressure(
    pieces: Pieces, start: Array, end: Array, first: float, prices: tuple[float, float], p: Array
) -> float:
    """Write the centres of pressure ``p`` (n,) of the pieces; how far the end is missed [m].

    ``start`` and ``end`` (2,) are x and x' [m, m/s]; ``first`` is p before the first piece [m], NaN
    where it may jump; ``prices`` are T and R [s]. The miss is |x_N - x*| + |x'_N - x'*| / w_N.
    Rates that are too large to plan with are made smaller.
    """
    n = p.shape[0]
    smooth, arrive = prices
    most = _GROWTH / pieces.duration.sum()
    for k in range(n):
        pieces.rate[k] = min(pieces.rate[k], most)
    # x_N = free + sum gain_k p_k, the same of x'_N / w_N.
    gain, free = np.empty((2, n)), np.empty(2)
    last = pieces.rate[n - 1]
    free[0], free[1] = start[0], start[1]
    for k in range(n):
        w, dt = pieces.rate[k], pieces.duration[k]
        c, s = np.cosh(w * dt), np.sinh(w * dt)
        for j in range(k):
            ahead, speed = gain[0, j], gain[1, j]
            gain[0, j], gain[1, j] = c * ahead + s / w * speed, w * s * ahead + c * speed
        gain[0, k], gain[1, k] = 1.0 - c, -w * s
        free[0], free[1] = c * free[0] + s / w * free[1], w * s * free[0] + c * free[1]
    for j in range(n):
        gain[1, j] /= last
    left0, left1 = end[0] - free[0], (end[1] - free[1]) / last
    matrix, right = np.zeros((n, n)), np.empty(n)
    for i in range(n):
        for j in range(n):
            matrix[i, j] = arrive * (gain[0, i] * gain[0, j] + gain[1, i] * gain[1, j])
        matrix[i, i] += pieces.duration[i]
        right[i] = arrive * (gain[0, i] * left0 + gain[1, i] * left1)
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
    for j in range(n):
        left0 -= gain[0, j] * p[j]
        left1 -= gain[1, j] * p[j]
    return abs(left0) + abs(left1)


class Ground(NamedTuple):
    """Ground under both feet, and how its use is priced."""

    rear: float  # x of the feet [m]
    front: float
    low: float  # x between which both together bear the centre of pressure [m]
    high: float
    gravity: tuple[float, float]  # its parts into the ground, and along it, backward [m/s^2]
    reach: float  # longest way from a foot to the CoM [m]
    slack: float  # excess that costs nothing [m]
    pace: float  # price of a second more or less than the next [m/s]
    calm: float  # duration that is liked best [s]
    unloading: float  # time before the end in which the rear foot gives up its load [s]; 0: none
    smooth: float  # T [s]
    arrive: float  # R [s]


@compiled
def best_pressure(
    start: Array, ends: Array, durations: Array, ground: Ground, jumps: bool, p: Array, rates: Array
) -> tuple[float, float, int, int]:
    """Cost and excess [m] of the best curve: excess beyond the slack, and time.

    The height is a quintic, between the states x, y, each position, velocity and acceleration, of
    ``start`` (2, 3) and of ``ends`` (n, 2, 3); ``durations`` (d,) are tried to each of these [s].
    One within the slack is better than any that is not. Where p ``jumps``, it may at once be
    anywhere. The excess is the miss of the end, or by how far a leg would be longer than its reach.
    Centres of pressure ``p`` (k,) and w ``rates`` (k,) of the pieces are overwritten; also returns
    the numbers of the end and of the duration.
    """
    n, g = p.shape[0], ground.gravity[0]
    best, least, chosen, lasting, fits = np.inf, np.inf, 0, 0, False
    rise, low, high = np.empty(TERMS), np.empty(n), np.empty(n)
    wish, lasts, rate, found = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(durations.shape[0]):
        t = durations[i]
        time = ground.pace * (t + ground.calm * ground.calm / t)
        if fits and time >= best:
            continue
        for e in range(ends.shape[0]):
            quintic(start[1], ends[e, 1], t, rise)
            goal = ground.front if ground.unloading > 0.0 else ends[e, 0, 0]
            for k in range(n):
                lasts[k] = t / n
                y, _, lift = polynomial(rise, (k + 0.5) * t / n)
                lift = max(g + lift, LIGHTEST * g)
                rate[k] = np.sqrt(lift / max(y, LIGHTEST * ground.reach))
                wish[k], left = goal, 1.0
                if ground.unloading > 0.0:
                    left = min((n - k - 1) * t / n / ground.unloading, 1.0)
                    low[k] = goal + left * (ground.low - goal)
                    high[k] = goal + left * (ground.high - goal)
                else:
                    low[k], high[k] = ground.low, ground.high
            pieces = Pieces(lasts, rate, low, high, wish)
            first = np.nan if jumps else start[0, 0] - start[0, 2] / rate[0] ** 2
            prices = (ground.smooth, ground.arrive)
            excess = pressure(pieces, start[0], ends[e, 0], first, prices, found)
            x, v = start[0, 0], start[0, 1]
            for k in range(n):
                x, v = _after(x, v, rate[k], found[k], lasts[k])
                y, _, _ = polynomial(rise, (k + 1) * t / n)
                away = max(x - ground.rear, ground.front - x)
                excess = max(excess, np.sqrt(away * away + y * y) - ground.reach)
            cost = max(excess - ground.slack, 0.0) + time
            holds = excess <= ground.slack
            if (holds and not fits) or (holds == fits and cost < best):
                best, least, chosen, lasting, fits = cost, excess, e, i, holds
                for k in range(n):
                    p[k], rates[k] = found[k], rate[k]
    return best, least, chosen, lasting


@compiled
def _after(x: float, v: float, w: float, p: float, dt: float) -> tuple[float, float]:
    """Position and velocity after a piece."""
    c, s = np.cosh(w * dt), np.sinh(w * dt)
    return p + c * (x - p) + s / w * v, w * s * (x - p) + c * v


def curve_over(
    start: Array, end: Array, duration: float, pressures: Array, rates: Array
) -> tuple[Quintic, ...]:
    """The curve of a duration [s] over centres of pressure (n,) [m], w (n,) being ``rates``."""
    rise = Quintic.between(start, end, duration).coefficients[1]
    (x, v), dt, time = start[0, :2], duration / len(rates), 0.0
    found = []
    for p, w in zip(pressures, rates, strict=True):
        c = np.empty((2, TERMS))
        for n in range(TERMS):  # of p + (x - p) cosh(w t) + v sinh(w t) / w
            c[0, n] = (v if n % 2 else x - p) * w ** (n - n % 2) / factorial(n)
        c[0, 0], c[1] = x, _from(rise, time)
        found.append(Quintic(c, dt))
        x, v, _ = polynomial(c[0], dt)
        time += dt
    return tuple(found)


def _from(polynomial: Array, time: float) -> Array:
    """The same polynomial (n,), its time counted from another one [s] on."""
    c = polynomial.copy()
    for i in range(len(c) - 1):
        for k in range(len(c) - 2, i - 1, -1):
            c[k] += time * c[k + 1]
    return c


def plans() -> None:
    """A plan, and a curve's value, made to compile them."""
    states, one = np.ones((1, 2, 3)), np.ones(2)
    feet, gravity = (0.0, 1.0, 0.0, 1.0), (9.81, 0.0)
    ground = Ground._make((*feet, gravity, 1.0, 0.0, 1.0, 1.0, 0.1, SMOOTH, ARRIVE))
    best_pressure(states[0], states, one, ground, False, one.copy(), one.copy())
    polynomial(one, 1.0)


PRESSURE = (Part(plans, 6.5),)
"""Compiled functions of a plan of the centre of pressure."""
