"""A change of speed that one stride can make, where more is asked for.

Least squares that begin at a gait end beside it where the change asked for is too great: the stride
found then makes a small part of it. A run that is so kept from slowing down falls further behind,
and the next stride is asked for as much. A smaller change, asked for instead, is made whole.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Solve = Callable[[Array], tuple[Array, Array | None]]
"""Controls and end of a stride for where it should end; the end is None where there is none."""

_MADE = 0.5  # of a change: a stride that makes less of it is not the one that was sought
_SMALLER = 0.7  # of the change asked for before
_TRIES = 2  # as many more solutions a stride may cost


def solve_within_reach(
    solve: Solve, z: Array, aim: Array, least: float
) -> tuple[Array, Array | None]:
    """The stride that comes nearest to the speed aimed at, of a few that aim at less.

    Args:
        solve: finds a stride.
        z: (n,) where it begins.
        aim: (n,) where it should end.
        least: strides that miss the speed by less than this are left as they are [m/s].

    Returns:
        As ``solve``.
    """
    u, end = solve(aim)
    if end is None:
        return u, end
    change, near = float(aim[0] - z[0]), abs(float(end[0] - aim[0]))
    bound = max(least, (1.0 - _MADE) * abs(change))
    for number in range(_TRIES):
        if near <= bound:
            break
        nearer = aim.copy()
        nearer[0] = z[0] + _SMALLER ** (number + 1) * change
        other, there = solve(nearer)
        if there is not None and abs(there[0] - aim[0]) < near:
            u, end, near = other, there, abs(float(there[0] - aim[0]))
    return u, end
