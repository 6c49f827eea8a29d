"""Closed-form stance: one leg (Geyer, Arslan) and two legs (the paper's AT-SLIP).

Polar coordinates (r, theta) about a pivot: the foot in single stance, the middle between the
feet in double stance; theta counter-clockwise from +x, so forward motion has a negative
rate. Real or complex arithmetic alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import inner
from template_control.slip.dynamics.model import Model, backward
from template_control.slip.dynamics.path import COEFFICIENTS, STANCE, Path, sample

Array = NDArray[np.float64]

_NEWTON = 6


@inner
def polar(x: float, y: float) -> tuple[float, float]:
    """Radius and angle of a point above the ground; a complex step goes through both.

    Args:
        x: horizontal distance from the pivot [m].
        y: height over it, positive [m].

    Returns:
        The radius [m]; the angle, from forward horizontal [rad].
    """
    angle = np.arctan2(y.real, x.real)
    # The first-order term carries a complex step; it is zero for real numbers.
    angle = angle + (y * x.real - x * y.real) / (x.real**2 + y.real**2)
    return np.sqrt(x * x + y * y), angle


@inner
def axial_torsional(
    spread: float, stiffness: float, mass: float, gravity: float, rest_length: float
) -> tuple[float, float, float]:
    """AT-SLIP that stands in for two legs: (18) to (25), with the notes' reading of (23).

    Args:
        spread: c, distance of the toes [m].
        stiffness: of either leg [N/m].
        mass, gravity, rest_length: SI.

    Returns:
        k_r [N/m], l_r0 [m], k_t [N m/rad].
    """
    half = 0.25 * spread * spread
    weight = mass * gravity
    top = np.sqrt(rest_length**2 - half)
    # (18) is the squared balance 2 k0 (l0 - l) y / l = m g; its root next to l0 is wanted.
    leg = rest_length - 0.5 * weight / stiffness * rest_length / top
    for _ in range(_NEWTON):
        y = np.sqrt(leg * leg - half)
        balance = 2.0 * stiffness * (rest_length - leg) * y / leg - weight
        slope = 2.0 * stiffness * ((rest_length - leg) * half / (leg * leg * y) - y / leg)
        step = balance / slope
        leg -= step
        if abs(step) < 1e-13 * rest_length:
            break
    y = np.sqrt(leg * leg - half)
    k_r = weight / (top - y)
    k_t = stiffness * spread * spread * (4.0 * rest_length**2 - spread * spread)
    return k_r, top, k_t / (8.0 * rest_length**2)


class Launch(NamedTuple):
    """Where a stance phase begins, in polar coordinates.

    Attributes:
        pivot: x of their origin [m].
        r, theta: the CoM [m, rad].
        radial_speed: dr/dt [m/s].
    """

    pivot: float
    r: float
    theta: float
    radial_speed: float


@inner
def harmonic(
    a: Array,
    start: Launch,
    momentum: float,
    frequency_squared: float,
    length: float,
    gravity: float,
) -> None:
    """Coefficients of (11) into ``a`` (12,), see :class:`~.path.Path`.

    Args:
        a: overwritten.
        start: at t = 0, about the pivot.
        momentum: p / m, constant over the phase [m^2/s].
        frequency_squared: omega_0^2 = k/m [1/s^2].
        length: l0, or l_r0 of the AT-SLIP [m].
        gravity: [m/s^2].
    """
    pivot, r, theta, radial_speed = start
    omega = momentum / (length * length)
    w2 = frequency_squared + 3.0 * omega * omega
    w = np.sqrt(w2)
    for i in range(8, COEFFICIENTS):
        a[i] = 0.0
    a[0] = pivot
    a[1] = (-gravity + length * frequency_squared + 4.0 * length * omega * omega) / w2
    a[2] = radial_speed / w
    a[3] = r - a[1]
    a[5] = w
    a[6] = (2.0 * gravity / length + frequency_squared + omega * omega) / w2 * omega
    a[7] = 2.0 * omega / (length * w)
    a[4] = theta - a[7] * a[2]


@inner
def momentum_changes(a: Array, t: float, gravity: tuple[float, float], torsion: float) -> float:
    """Change of p/m over [0, t] by gravity (12), (13) and the torsional spring (27).

    Args:
        a: (12,) the first iteration's path.
        t: end of the phase [s].
        gravity: into the ground, and what acts along it, backward positive [m/s^2].
        torsion: k_t / m, 0 in single stance.
    """
    w, l1, l2 = a[5], a[2], a[3]
    s, c = np.sin(w * t), np.cos(w * t)
    start_angle = a[4] + a[7] * l1
    end_angle = a[4] + a[6] * t + a[7] * (l1 * c - l2 * s)
    mean_r = a[1] + (l1 - l1 * c + l2 * s) / (w * t)
    change = -0.5 * t * gravity[0] * mean_r * (np.cos(start_angle) + np.cos(end_angle))
    change += 0.5 * t * gravity[1] * mean_r * (np.sin(start_angle) + np.sin(end_angle))
    integral = 0.5 * a[6] * t * t + a[7] / w * (l1 * s - l2 * (1.0 - c)) + a[4] * t
    return change - torsion * (integral - 0.5 * np.pi * t)


@inner
def _spring(
    x: float, y: float, pivot: float, toes: Array, stiffness: Array, rest_length: float
) -> tuple[float, float]:
    """Of the loaded legs at (x, y): radial force times r, and torque about the pivot [N m]."""
    fx = fy = 0.0 * x
    for leg in range(2):
        if stiffness[leg] == 0.0:
            continue
        d = x - toes[leg]
        length = np.sqrt(d * d + y * y)
        share = stiffness[leg] * (rest_length / length - 1.0)
        fx += share * d
        fy += share * y
    d = x - pivot
    return fx * d + fy * y, d * fy - y * fx


@inner
def corrected(
    a: Array,
    t: float,
    momentum: float,
    toes: Array,
    stiffness: Array,
    model: Model,
    out: Array,
) -> float:
    """Improve the path ``a`` in place by one deferred correction; p/m at ``t``.

    The true radial acceleration and torque at the start, middle and end of the first path
    differ from what it assumes by a defect; a quadratic in time through the three is added
    to the right-hand side of the radial equation, which still has a closed-form solution.
    The angular rate p(t) / (m r(t)^2) is interpolated through the same three points.

    Args:
        a: (12,) first path, from :func:`harmonic`; overwritten.
        t: time of the event that ends the phase on it [s].
        momentum: p/m at the start [m^2/s].
        toes, stiffness: (2,) of the legs; stiffness 0 for one in the air.
        model: the template.
        out: (6,) scratch.

    Returns:
        p/m at ``t`` [m^2/s].
    """
    mass, gravity, rest_length = model.mass, model.gravity, model.rest_length
    along = backward(model, stiffness)
    w2 = a[5] * a[5]
    # Radial defects and torques at 0, t/2 and t.
    pull_0 = pull_1 = pull_2 = torque_0 = torque_1 = torque_2 = 0.0 * a[0]
    angle = a[4] + a[7] * a[2]
    radius = a[1] + a[3]
    speed = a[5] * a[2]
    p0 = p1 = p2 = momentum
    r1 = r2 = radius
    s, c = np.sin(angle), np.cos(angle)
    x, y = a[0] + radius * c, radius * s
    for i in range(3):
        if i > 0:
            sample(STANCE, Path(a, a), 0.5 * i * t, out)
            x, y = out[0], out[1]
        d = x - a[0]
        r = np.sqrt(d * d + y * y)
        force, torque = _spring(x, y, a[0], toes, stiffness, rest_length)
        pull = force / (r * mass) - (gravity * y + along * d) / r + w2 * (r - a[1])
        torque = torque / mass - gravity * d + along * y
        if i == 0:
            pull_0, torque_0 = pull, torque
        elif i == 1:
            pull_1, torque_1, r1 = pull, torque, r
        else:
            pull_2, torque_2, r2 = pull, torque, r
    p1 = p0 + t / 24.0 * (5.0 * torque_0 + 8.0 * torque_1 - torque_2)
    p2 = p0 + t / 6.0 * (torque_0 + 4.0 * torque_1 + torque_2)
    pull_0 += p0 * p0 / radius**3
    pull_1 += p1 * p1 / r1**3
    pull_2 += p2 * p2 / r2**3
    # pull = q0 + q1 t + q2 t^2 through the three points.
    q0 = pull_0
    q1 = (4.0 * pull_1 - 3.0 * pull_0 - pull_2) / t
    q2 = 2.0 * (pull_0 - 2.0 * pull_1 + pull_2) / (t * t)
    a[1] += q0 / w2 - 2.0 * q2 / (w2 * w2)
    a[8] = q1 / w2
    a[9] = q2 / w2
    a[2] = (speed - a[8]) / a[5]
    a[3] = radius - a[1]
    a[7] = 0.0
    # Angular rate through three points of the new radius.
    rates_0 = p0 / (radius * radius)
    s, c = np.sin(0.5 * a[5] * t), np.cos(0.5 * a[5] * t)
    r1 = a[1] + (a[8] + 0.5 * a[9] * t) * 0.5 * t + a[2] * s + a[3] * c
    s, c = 2.0 * s * c, c * c - s * s
    r2 = a[1] + (a[8] + a[9] * t) * t + a[2] * s + a[3] * c
    rates_1, rates_2 = p1 / (r1 * r1), p2 / (r2 * r2)
    a[4] = angle
    a[6] = rates_0
    a[10] = 0.5 * (4.0 * rates_1 - 3.0 * rates_0 - rates_2) / t
    a[11] = 2.0 / 3.0 * (rates_0 - 2.0 * rates_1 + rates_2) / (t * t)
    return p2
