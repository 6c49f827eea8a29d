"""Angles and speeds of the joints from their encoders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.slip.similarity import RATE_SQUARED, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointFilterOptions(Checked):
    """What the filter reckons with.

    Attributes:
        angle_noise: standard deviation of an encoder's reading [rad]; the sensor's own.
        acceleration_noise: standard deviation of what the whole-body QP's accelerations lack
            in a tick [rad/s^2]. Less, and speeds are late after an impact; more, and they are
            as noisy as the encoders' differences.
    """

    angle_noise: Positive = 2e-4
    acceleration_noise: Positive = tuned(60.0, RATE_SQUARED)


class JointFilter:
    """Steady Kalman filter of each joint: q'' is known but for white noise, q is measured.

    With the tracking index L = s_a dt^2 / s_q, r = (4 + L - sqrt(8 L + L^2)) / 4 the gains are
    a = 1 - r^2 and b = 2 (2 - a) - 4 sqrt(1 - a) (Kalata 1984):

        q^ <- q_p + a (q - q_p),    v^ <- v_p + b (q - q_p) / dt.

    Args:
        options: the noise.
    """

    def __init__(self, options: JointFilterOptions) -> None:
        self.options = options
        self.angle: Array = np.zeros(0)
        self.speed: Array = np.zeros(0)

    def reset(self, angle: Array, speed: Array) -> None:
        """Begin with a known state.

        Args:
            angle: (nu,) [rad].
            speed: (nu,) [rad/s].
        """
        self.angle, self.speed = angle.copy(), speed.copy()

    def update(self, measured: Array, acceleration: Array, dt: float) -> None:
        """Go on by a tick.

        Args:
            measured: (nu,) the encoders' angles [rad].
            acceleration: (nu,) expected since the tick before [rad/s^2].
            dt: since then [s].
        """
        alpha, beta = self._gains(dt)
        angle = self.angle + (self.speed + 0.5 * acceleration * dt) * dt
        speed = self.speed + acceleration * dt
        missed = measured - angle
        self.angle = angle + alpha * missed
        self.speed = speed + beta / dt * missed

    def _gains(self, dt: float) -> tuple[float, float]:
        o = self.options
        index = o.acceleration_noise * dt**2 / o.angle_noise
        r = 0.25 * (4.0 + index - np.sqrt(8.0 * index + index**2))
        alpha = 1.0 - r**2
        return alpha, 2.0 * (2.0 - alpha) - 4.0 * float(np.sqrt(1.0 - alpha))
