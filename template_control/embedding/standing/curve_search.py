"""The best of many quintics between two feet, compiled: a step's planning tries thousands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.warm_up import Part

Array = NDArray[np.float64]

_SAMPLES = 20  # of a curve, beside its start
_TERMS = 6
_LIGHTEST = 0.05  # of the weight: legs do not pull


class Rules(NamedTuple):
    """What makes a curve good.

    Attributes:
        low, high: x between which the centre of pressure is to stay [m].
        gravity: its parts away from the ground and along it, backward [m/s^2].
        reach: longest way from a foot to the CoM [m].
        slack: excess that costs nothing [m].
        pace: price of a second more or less than ``calm`` [m/s].
        calm: duration that is liked best [s].
    """

    low: float
    high: float
    gravity: tuple[float, float]
    reach: float
    slack: float
    pace: float
    calm: float


@compiled
def best_quintic(
    starts: Array, ends: Array, durations: Array, rules: Rules, curve: Array
) -> tuple[float, float, int, int]:
    """Find the quintic of least cost: excess beyond the slack, and time.

    Args:
        starts: (m, 2, 3) x and y, each position, velocity, acceleration.
        ends: (n, 2, 3) the same.
        durations: (d,) tried between each start and each end [s].
        rules: of the cost.
        curve: (2, 6) overwritten with the best one's coefficients, constant term first.

    Returns:
        Cost and excess [m], number of the end, and number of the duration.
    """
    best, least, chosen, lasting = np.inf, np.inf, 0, 0
    c = np.empty((2, _TERMS))
    for i in range(durations.shape[0]):
        t = durations[i]
        time = rules.pace * (t + rules.calm * rules.calm / t)
        for s in range(starts.shape[0]):
            for e in range(ends.shape[0]):
                if time >= best:
                    continue
                for axis in range(2):
                    p, v, a = starts[s, axis, 0], starts[s, axis, 1], starts[s, axis, 2]
                    d = ends[e, axis, 0] - p - v * t - 0.5 * a * t * t
                    w = (ends[e, axis, 1] - v - a * t) * t
                    h = (ends[e, axis, 2] - a) * t * t
                    c[axis, 0], c[axis, 1], c[axis, 2] = p, v, 0.5 * a
                    c[axis, 3] = (10.0 * d - 4.0 * w + 0.5 * h) / t**3
                    c[axis, 4] = (-15.0 * d + 7.0 * w - h) / t**4
                    c[axis, 5] = (6.0 * d - 3.0 * w + 0.5 * h) / t**5
                excess = 0.0
                for k in range(_SAMPLES + 1):
                    excess = max(excess, _excess(c, t * k / _SAMPLES, rules))
                    if excess - rules.slack + time >= best:
                        break
                cost = max(excess - rules.slack, 0.0) + time
                if cost < best:
                    best, least, chosen, lasting = cost, excess, e, i
                    for axis in range(2):
                        for n in range(_TERMS):  # Numba compiles whole copies for seconds
                            curve[axis, n] = c[axis, n]
    return best, least, chosen, lasting


@compiled
def _excess(c: Array, t: float, rules: Rules) -> float:
    """By how far a curve leaves the feet, or the legs' reach, at a time [m]."""
    x = y = ax = ay = 0.0
    for n in range(_TERMS - 1, -1, -1):
        x, y = x * t + c[0, n], y * t + c[1, n]
    for n in range(_TERMS - 1, 1, -1):
        ax, ay = ax * t + n * (n - 1) * c[0, n], ay * t + n * (n - 1) * c[1, n]
    across, along = rules.gravity
    p = x - y * (ax + along) / max(across + ay, _LIGHTEST * across)
    away = max(x - rules.low, rules.high - x)
    far = np.sqrt(away * away + y * y) - rules.reach
    return float(max(rules.low - p, p - rules.high, far))


def curves() -> None:
    """The search, called to compile it."""
    states = np.ones((1, 2, 3))
    rules = Rules(0.0, 1.0, (9.81, 0.0), 1.0, 0.0, 1.0, 1.0)
    best_quintic(states, states, np.ones(1), rules, np.empty((2, _TERMS)))


STAND = (Part(curves, 0.5),)
"""What standing, starting and stopping call."""
