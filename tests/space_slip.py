"""The spring-mass walker in space, nonlinear: the truth that the sideways motion is held against.

Massless springs push from toes (x_i, y_i, 0) along the line to the CoM (x, y, z); x forward, y
left, z up. A leg lands when it is as long as at rest, in the touchdown angle as seen from the
side, and lifts off when it is so long again.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from template_control.slip import Slot


@dataclass(frozen=True)
class Step:
    """One step from VLO to VLO: state (6,) at its end, times, and the new stance toe (2,)."""

    end: np.ndarray
    toe: np.ndarray
    touchdown: float
    duration: float
    states: np.ndarray


def acceleration(p, state, toes, stiffness):
    a = np.array([0.0, 0.0, -p.gravity])
    for toe, k in zip(toes, stiffness, strict=True):
        leg = state[:3] - [*toe, 0.0]
        length = np.linalg.norm(leg)
        a += k * (p.rest_length - length) / (p.mass * length) * leg
    return a


def energy(p, state, toes=(), stiffness=()):
    total = 0.5 * p.mass * state[3:] @ state[3:] + p.mass * p.gravity * state[2]
    for toe, k in zip(toes, stiffness, strict=True):
        total += 0.5 * k * (p.rest_length - np.linalg.norm(state[:3] - [*toe, 0.0])) ** 2
    return total


def integrate(p, state, toes, stiffness, guard, longest=5.0):
    """DOP853 at 1e-12 until ``guard(state)`` rises through 0, or for the longest time [s]."""

    def event(_, s):
        return guard(s)

    event.terminal, event.direction = True, 1.0
    found = solve_ivp(
        lambda _, s: np.concatenate((s[3:], acceleration(p, s, toes, stiffness))),
        (0.0, longest),
        state,
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
        events=event,
    )
    return found.t[-1], found.y[:, -1], found.y.T


def step(p, state, toe, u, foothold, looks=()):
    """One walking step.

    Args:
        p: parameters.
        state: (6,) at VLO, above ``toe`` (2,) or beside it.
        u: (NUM_SLOTS,) controls of the step.
        foothold: function of time and state that gives y of the next toe.
        looks: times at which it is asked [s]; the last answer counts.
    """
    alpha, k1, k2 = u[Slot.TOUCHDOWN_ANGLE], u[Slot.K_SC], u[Slot.K_SD]
    l0, time, paths = p.rest_length, 0.0, []
    y = foothold(0.0, state)

    def landed(s):
        return np.sqrt(l0**2 - (s[1] - y) ** 2) * np.sin(alpha) - s[2]

    for look in (*looks, np.inf):
        dt, state, path = integrate(p, state, [toe], [k1], landed, min(look, 5.0) - time)
        time, paths = time + dt, [*paths, path]
        if abs(landed(state)) < 1e-9:
            break
        y = foothold(time, state)
    touchdown = time
    new = np.array([state[0] + state[2] / np.tan(alpha), y])
    legs, middle = [toe, new], 0.5 * (toe[0] + new[0])
    for k, guard in (
        (k1, lambda s: (s[0] - middle) * s[3] + s[2] * s[5]),
        (k2, lambda s: np.linalg.norm(s[:3] - [*toe, 0.0]) - l0),
    ):
        dt, state, path = integrate(p, state, legs, [k, k], guard)
        time, paths = time + dt, [*paths, path]
    dt, state, path = integrate(p, state, [new], [k2], lambda s: s[0] - new[0])
    return Step(state, new, touchdown, time + dt, np.vstack([*paths, path]))
