"""Touchdown angles of a template's leg: the steepest, after some time, on a ballistic path."""

from __future__ import annotations

from math import asin, atan2, hypot

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.slip.parameters import SlipParameters

ANY_ANGLE = (-np.inf, np.inf)
"""Range of angles that leaves the touchdown angle free."""

_NEWTON = 4
TOP_MARGIN = 0.01
"""Distance of alpha below asin(y / l0), at which the foot would touch down at once [rad]."""


@compiled
def steepest(
    z: Array, body: tuple[float, float, float], stiffness: float, earliest: float
) -> float:
    """Largest touchdown angle at a VLO state z (3,) [rad].

    The foot is neither on the ground at once, nor ``earliest`` after VLO [s]: the height then comes
    from its Taylor series to the second order. ``body`` are l0, m and g, the leg has a stiffness
    [N/m].
    """
    length, mass, gravity = body
    top = np.arcsin(min(z[1] / length, 1.0)) - TOP_MARGIN
    if earliest > 0.0:
        lift = stiffness / mass * (length - z[1]) - gravity
        later = z[1] + earliest * (z[2] + 0.5 * earliest * lift)
        top = min(top, np.arcsin(min(max(later / length, 0.0), 1.0)))
    return float(max(top, TOP_MARGIN))


def touchdown_angle_after(
    state: Array, toes: Array, parameters: SlipParameters, stiffness: float, time: float
) -> float:
    """Touchdown angle of a front leg that comes to l0 ``time`` [s] from now [rad].

    By the Taylor series of the height to the second order; ``state`` (4,) is x, y, dx/dt, dy/dt,
    and a leg of a stiffness [N/m] stands at the first of x ``toes`` (2,) [m].
    """
    x, y, _, dy = state.tolist()
    length = parameters.rest_length
    stretch = length / hypot(x - float(toes[0]), y) - 1.0
    lift = stiffness * stretch * y / parameters.mass - parameters.gravity
    later = y + time * (dy + 0.5 * time * lift)
    return asin(min(max(later / length, 0.0), 1.0))


def ballistic_touchdown_angle(state: Array, toes: Array, parameters: SlipParameters) -> float:
    """Angle of the template's leg as it comes to l0 on the ballistic path through a state [rad].

    ``state`` (4,) is x, y, dx/dt, dy/dt as a foot meets the ground at the first of x ``toes`` (2,)
    [m], which is a little before or after.
    """
    x, y, dx, dy = state.tolist()
    x -= float(toes[0])
    time = 0.0
    for _ in range(_NEWTON):
        px, py, speed = x + dx * time, y + dy * time - 0.5 * parameters.gravity * time**2, dy
        speed -= parameters.gravity * time
        slope = 2.0 * (px * dx + py * speed)
        if slope >= 0.0:
            break
        time -= (px**2 + py**2 - parameters.rest_length**2) / slope
    return atan2(py, -px)
