"""The robot's state in the template's terms."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Sensed:
    """What the robot feels, in the template's terms; overwritten at every tick.

    Attributes:
        state: (4,) x, y, dx/dt, dy/dt of the CoM [m, m/s], y over the template's ground. Where
            the phase says so, dx/dt includes the angular momentum about the CoM as if it moved
            the CoM, so that m y dx/dt - m x dy/dt is the robot's angular momentum about its
            stance foot.
        toes: (2,) x of the rear and the front foot [m].
        contact: (2,) whether each foot touches the ground.
        swing_time: (2,) time since each foot lifted off [s].
        feet: the foot that is the rear leg's, and the front leg's.
        acceleration: (2,) wanted of the CoM at the last tick [m/s^2]: what is planned anew goes on
            with it.
    """

    state: Array = field(default_factory=lambda: np.zeros(4))
    toes: Array = field(default_factory=lambda: np.zeros(2))
    contact: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(2, dtype=bool))
    swing_time: Array = field(default_factory=lambda: np.full(2, np.inf))
    feet: tuple[int, int] = (0, 1)
    acceleration: Array = field(default_factory=lambda: np.zeros(2))
