"""What the sensors of a real robot tell at a tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Readings(NamedTuple):
    """Readings of one tick; no position in the world is among them.

    Attributes:
        joints: (nu,) angles that the encoders tell [rad].
        pitch_rate: of the trunk, from the gyro, forward positive [rad/s].
        specific_force: (2,) from the accelerometer, forward and up along the trunk: its
            acceleration less gravity, mean since the tick before [m/s^2].
        contact: (2,) whether each foot touches the ground.
    """

    joints: Array
    pitch_rate: float
    specific_force: Array
    contact: NDArray[np.bool_]
