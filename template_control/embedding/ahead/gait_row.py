"""A row of the table of gaits by speed: a compiled plan interpolates between those of two knots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled

Array = NDArray[np.float64]

CONTROLS = 4
"""Controls of a step: alpha, kappa_1, kappa_2, kappa_p."""
STIFFNESS, STATE, CONTROL = 0, 1, 4
"""Places in a row: k [N/m]; (3,) VLO state; (4,) alpha and shares of k."""
COST, SETTLING = 8, 17
"""Places in a row: (3, 3) cost-to-go; (7, 3) shift of state and controls by an offset."""
GAIN = 38
"""Place in a row: (4, 3) gain of the LQR."""
DURATION, LENGTH = 50, 51
"""Places in a row: duration [s] and length [m] of a step."""
WIDTH = 52


class GaitTable(NamedTuple):
    """Gaits at rising speeds; where one chain of the family ends and the next begins, two.

    Attributes:
        speed: (n,) dx/dt at VLO [m/s].
        rows: (n, WIDTH) what belongs to each.
    """

    speed: Array
    rows: Array


@compiled
def gait_row(table: GaitTable, speed: float, row: Array) -> None:
    """What belongs to a speed, interpolated; beyond the ends the end's own.

    Args:
        table: the gaits.
        speed: dx/dt at VLO [m/s].
        row: (WIDTH,) overwritten.
    """
    low, high = 0, table.speed.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table.speed[middle] <= speed:
            low = middle
        else:
            high = middle
    width = table.speed[high] - table.speed[low]
    share = (speed - table.speed[low]) / width if width > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    for i in range(row.shape[0]):
        row[i] = (1.0 - share) * table.rows[low, i] + share * table.rows[high, i]
