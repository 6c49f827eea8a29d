"""What a running stride may aim at, and between which controls: in one compiled call.

A run plans three times a stride, and each plan decides on two strides. In Python, these few
numbers took as long as the algebra that they are for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled

Array = NDArray[np.float64]

_SAME = 1e-9  # rounding [m/s, m]


class RunningLimits(NamedTuple):
    """The numbers of a running planner; compiled code takes a plain tuple of them.

    Attributes:
        rest_length: l0 [m].
        top_margin: alpha stays this far [rad] below asin(y / l0).
        flatter, steeper: least and greatest alpha, relative to the gait's [rad].
        softest, stiffest: least and greatest stiffness, over the gait's.
        turn, sooner, later: changes of alpha [rad], k_sc and k_sd (shares) that count as 1.
        faster, higher, slower, lower: how far the aim may be from the present apex [m/s, m].
    """

    rest_length: float
    top_margin: float
    flatter: float
    steeper: float
    softest: float
    stiffest: float
    turn: float
    sooner: float
    later: float
    faster: float
    higher: float
    slower: float
    lower: float


@compiled
def aim_and_bounds(
    z: Array,
    wanted: Array,
    offset: Array,
    legs: Array,
    angles: tuple[float, float],
    limits: tuple[float, ...],
) -> tuple[Array, Array, bool]:
    """Where the template's stride is to end, and the controls that it may have.

    Args:
        z: (2,) apex that the stride begins at, dx/dt and y [m/s, m].
        wanted: (2,) apex that the route asks for.
        offset: (3,) what the robot adds to the template's next apex.
        legs: (3,) alpha [rad], k_sc and k_sd [N/m] of the gait near the present speed.
        angles: least and greatest alpha that the swing foot can still reach [rad].
        limits: of :class:`RunningLimits`.

    Returns:
        (2,) the aim, less the offset; (4, 3) of a :class:`~.regularised.Prior`; whether the aim is
        what was wanted.
    """
    l0, margin, flatter, steeper, softest, stiffest = limits[:6]
    turn, sooner, later, faster, higher, slower, lower = limits[6:]
    goal, table = np.empty(2), np.empty((4, 3))
    at_target = True
    for i in range(2):
        up, down = (faster, slower) if i == 0 else (higher, lower)
        aim = min(max(wanted[i], z[i] - down), z[i] + up)
        at_target = at_target and abs(wanted[i] - aim) < _SAME
        goal[i] = aim - offset[i]
    top = np.arcsin(min(z[1] / l0, 1.0)) - margin
    table[1, 0] = turn
    table[2, 0] = min(max(min(legs[0] + flatter, top), angles[0]), angles[1], top)
    table[3, 0] = min(max(min(legs[0] + steeper, top), angles[0]), angles[1], top)
    for i in range(1, 3):
        table[1, i] = (sooner if i == 1 else later) * legs[i]
        table[2, i], table[3, i] = softest * legs[i], stiffest * legs[i]
    for i in range(3):
        table[0, i] = min(max(legs[i], table[2, i]), table[3, i])
    return goal, table, at_target
