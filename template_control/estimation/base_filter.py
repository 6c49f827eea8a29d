"""Position, pitch and velocity of the trunk from an IMU and the feet that stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.robot.planar_biped import PlanarBiped
from template_control.slip.similarity import LENGTH, SPEED, tuned

Array = NDArray[np.float64]

_X, _PITCH, _V = slice(0, 2), 2, slice(3, 5)
_SIZE = 5 + 2 * 2


@dataclass(frozen=True)
class BaseFilterOptions(Checked):
    """What the filter reckons with; standard deviations.

    Attributes:
        gyro_noise: of a reading [rad/s]; the sensor's own, whatever the robot's size.
        force_noise: of a reading of the accelerometer [m/s^2]; likewise.
        foot_noise: of a foot's place beside the trunk, by encoders and model [m].
        creep: of a standing foot in a second, by slip and by a ground that gives way [m/s].
    """

    gyro_noise: Positive = 5e-3
    force_noise: Positive = 0.1
    foot_noise: Positive = tuned(5e-4, LENGTH)
    creep: Positive = tuned(0.01, SPEED)


class BaseFilter:
    """Extended Kalman filter of (x, y, pitch, x', y', p_left, p_right).

    The IMU moves the state on, with R the trunk's rotation and f the specific force:

        pitch' = gyro,    v' = R(pitch) f - (0, g),    x' = v,

    and a foot that stands stays where it landed. Measured is p_i less the place at which the
    leg's angles put the foot; a round foot rolls, so that p_i is its contact point less the
    radius times its angle, which keeps its value while it rolls. Along the world's x and y
    nothing is measured: the estimate drifts there as a real robot's does. (Bloesch et al. 2012,
    in the plane.)

    Args:
        robot: model; its last update is overwritten.
        options: the noise.
    """

    def __init__(self, robot: PlanarBiped, options: BaseFilterOptions) -> None:
        self.robot = robot
        self.options = options
        self.state = np.zeros(_SIZE)
        self.pitch_rate = 0.0
        self._covariance = np.zeros((_SIZE, _SIZE))
        self._stands = np.zeros(2, dtype=bool)

    def reset(self, q: Array, v: Array) -> None:
        """Begin with a known state, no foot standing yet.

        Args:
            q: (nv,) configuration [m, rad].
            v: (nv,) velocity [m/s, rad/s].
        """
        self.state[:] = 0.0
        self.state[:3], self.state[_V], self.pitch_rate = q[:3], v[:2], float(v[2])
        self._covariance[:] = 0.0
        self._stands[:] = False

    def predict(self, pitch_rate: float, specific_force: Array, dt: float) -> None:
        """Go on by a tick.

        Args:
            pitch_rate: read now [rad/s].
            specific_force: (2,) mean since the tick before [m/s^2].
            dt: since then [s].
        """
        o, s, g = self.options, self.state, self.robot.gravity
        middle = s[_PITCH] + 0.5 * (self.pitch_rate + pitch_rate) * dt * 0.5
        sine, cosine = np.sin(middle), np.cos(middle)
        forward, up = specific_force
        acceleration = np.array([forward * cosine + up * sine, up * cosine - forward * sine - g])
        turned = np.array([up * cosine - forward * sine, -up * sine - forward * cosine])
        s[_X] += (s[_V] + 0.5 * acceleration * dt) * dt
        s[_PITCH] += 0.5 * (self.pitch_rate + pitch_rate) * dt
        s[_V] += acceleration * dt
        self.pitch_rate = pitch_rate
        flow = np.eye(_SIZE)
        flow[0, 3] = flow[1, 4] = dt
        flow[_V, _PITCH] = turned * dt
        flow[_X, _PITCH] = 0.5 * turned * dt**2
        noise = np.zeros(_SIZE)
        noise[_PITCH] = (o.gyro_noise * dt) ** 2
        noise[_V] = (o.force_noise * dt) ** 2
        noise[5:] = o.creep**2 * dt
        self._covariance = flow @ self._covariance @ flow.T + np.diag(noise)

    def correct(self, joints: Array, contact: NDArray[np.bool_]) -> None:
        """Take in where the legs put the feet.

        Args:
            joints: (nu,) angles [rad].
            contact: (2,) whether each foot touches the ground.
        """
        q = np.concatenate((self.state[:3], joints))
        robot = self.robot
        robot.update(q, np.zeros_like(q))
        for foot in np.flatnonzero(contact):
            rolled = robot.foot_radius * float(robot.foot_turning[foot] @ q)
            place = robot.foot_position[foot] - np.array([rolled, 0.0])
            slope = np.zeros((2, _SIZE))
            slope[:, :3] = robot.foot_jacobian[foot, :, :3]
            self._take(int(foot), place, slope)
        self._stands[:] = contact

    def _take(self, foot: int, place: Array, slope: Array) -> None:
        here = slice(5 + 2 * foot, 7 + 2 * foot)
        noise = self.options.foot_noise**2 * np.eye(2)
        p = self._covariance
        if not self._stands[foot]:
            # It has just landed: where it stands is what the rest of the state says.
            p[here, :] = slope @ p
            p[:, here] = p[here, :].T
            p[here, here] = slope @ p @ slope.T + noise
            self.state[here] = place
            return
        slope[:, here] = -np.eye(2)
        missed = self.state[here] - place
        gain = np.linalg.solve(slope @ p @ slope.T + noise, slope @ p).T
        self.state += gain @ missed
        self._covariance = p - gain @ slope @ p
