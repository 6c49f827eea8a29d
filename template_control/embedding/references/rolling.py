"""Feet that roll: their lowest points move on as the legs turn, the template's toes do not."""

from __future__ import annotations

from math import atan2, pi

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def unrolled(lowest: float, state: Array, radius: float) -> float:
    """The place that a rolling foot has its lowest point in as the CoM is over it.

    That point moves on by the radius times the angle that the leg turns by. So the phase would go
    on more slowly than the CoM, and the step would end later and slower than planned.

    Args:
        lowest: x of the foot's lowest point [m].
        state: (4,) x, y, dx/dt, dy/dt of the CoM.
        radius: of the foot [m].

    Returns:
        x of the template's toe [m].
    """
    return float(lowest - radius * atan2(state[0] - lowest, state[1]))


def rolled(toe: float, touchdown_angle: float, radius: float) -> float:
    """Where the lowest point of a foot lands whose toe is to be at ``toe``: :func:`unrolled` back.

    Args:
        toe: x of the template's toe [m].
        touchdown_angle: from the ground to the leg [rad].
        radius: of the foot [m].
    """
    return toe - radius * (0.5 * pi - touchdown_angle)
