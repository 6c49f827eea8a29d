"""Bounds of the joints' accelerations, near their limits of speed and before their stops.

A leg that has pushed off trails behind hips that run on, and its knee straightens. One that goes
straight hits its stop with tens of kilonewtons, which throws the leg back and the trunk forward. So
no joint may be faster than one that is to come to rest before its stop:

    (-v_least - v) / T <= a <= (v_most - v) / T
    v_most = min(v_max, (q_max - q) / T_s),  v_least = min(v_max, (q - q_min) / T_s)

with T the horizon in which a limit of speed is met, and T_s that in which a stop is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.robot.biped import Biped

Array = NDArray[np.float64]


class JointTuning(NamedTuple):
    """When the bounds are needed, and how soon they are met.

    Attributes:
        speed_share, speed_horizon, stop_share, stop_horizon: as in
            :class:`~.whole_body.solver.QpOptions`.
    """

    speed_share: float
    speed_horizon: float
    stop_share: float
    stop_horizon: float


class JointBounds:
    """Tells when a robot's joints need bounds, and which.

    Args:
        robot: the model; its last update is read.
        tuning: when they are needed.
    """

    def __init__(self, robot: Biped, tuning: JointTuning) -> None:
        self._robot = robot
        self._tuning = tuning
        self._low, self._high = robot.joint_range.T
        self._stop_time = tuning.stop_horizon / tuning.speed_share

    def needed(self) -> bool:
        """Whether a joint is near its limit of speed, or the one that it has before its stop."""
        fastest, o = self._robot.fastest, self._tuning
        if fastest <= o.stop_share:
            return False
        return fastest > o.speed_share or self._robot.soonest_stop <= self._stop_time

    def write(self, least: Array, most: Array, slack: float) -> None:
        """Write the bounds.

        Args:
            least, most: (nu,) accelerations, overwritten [rad/s^2].
            slack: what is allowed at least in either direction [rad/s^2]: -inf, or 0 where a joint
                that is too fast may stay so.
        """
        robot, o = self._robot, self._tuning
        place, speed, limit = robot.joint_angle, robot.joint_velocity, robot.velocity_limit
        down = np.minimum((place - self._low) / o.stop_horizon, limit)
        up = np.minimum((self._high - place) / o.stop_horizon, limit)
        most[:] = np.maximum((up - speed) / o.speed_horizon, slack)
        least[:] = -np.maximum((down + speed) / o.speed_horizon, slack)
