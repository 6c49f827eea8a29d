"""What the tasks are to bring about at a tick, and what they compare it with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Wanted:
    """References and measurements in one place; the controller overwrites them at every tick.

    Attributes:
        com: (6,) wanted x, y of the CoM, their first and their second derivatives, in a frame
            at the template's rear toe [m, m/s, m/s^2].
        com_now: (4,) the robot's x, y, dx/dt, dy/dt in that frame. dx/dt is the speed that
            the phase senses: with the angular momentum about the CoM, or without.
        com_push: horizontal acceleration added to the feedforward [m/s^2].
        pitch: wanted angle of the trunk [rad].
        pitch_now: (2,) its angle and rate [rad, rad/s].
        feet: the foot that is the rear leg's, and the front leg's.
        foot: (2, 2, 3) of each foot: x and y, each wanted position, velocity, acceleration, in
            the world [m, m/s, m/s^2].
        side: (2, 3) of each foot of a free robot: y, to the left, as ``foot`` in its heading frame.
        furthest: (2,) largest x that each foot may be moved to, so that its leg does not go
            straight [m].
        hip_speed: forward speed of the hips [m/s].
    """

    com: Array = field(default_factory=lambda: np.zeros(6))
    com_now: Array = field(default_factory=lambda: np.zeros(4))
    com_push: float = 0.0
    pitch: float = 0.0
    pitch_now: Array = field(default_factory=lambda: np.zeros(2))
    feet: tuple[int, int] = (0, 1)
    foot: Array = field(default_factory=lambda: np.zeros((2, 2, 3)))
    side: Array = field(default_factory=lambda: np.zeros((2, 3)))
    furthest: Array = field(default_factory=lambda: np.full(2, np.inf))
    hip_speed: float = 0.0
