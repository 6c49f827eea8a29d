"""Kalman filters of joints, trunk, and a floating-base robot's whole state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import FLOATING_DOF
from template_control.slip.similarity import LENGTH, RATE_SQUARED, SPEED, TIME, tuned

Array = NDArray[np.float64]

_X, _PITCH, _V = slice(0, 2), 2, slice(3, 5)
_SIZE = 5 + 2 * 2


@dataclass(frozen=True)
class JointFilterOptions(Checked):
    """Noise that the filter of the joints assumes.

    Attributes:
        angle_noise: standard deviation of an encoder's reading [rad]; the sensor's own.
        acceleration_noise: standard deviation of the error of the whole-body QP's accelerations
            in a tick [rad/s^2]. Less, and speeds are late after an impact; more, and they are
            as noisy as the encoders' differences.
    """

    angle_noise: Positive = 2e-4
    acceleration_noise: Positive = tuned(60.0, RATE_SQUARED)


class JointFilter:
    """Steady-state Kalman filter of each joint, driven by the expected acceleration.

    Model: q'' is the expected acceleration plus white noise, and q is measured.
    With the tracking index L = s_a dt^2 / s_q, r = (4 + L - sqrt(8 L + L^2)) / 4 the gains are
    a = 1 - r^2 and b = 2 (2 - a) - 4 sqrt(1 - a) (Kalata 1984):

        q^ <- q_p + a (q - q_p),    v^ <- v_p + b (q - q_p) / dt.
    """

    def __init__(self, options: JointFilterOptions) -> None:
        self.options = options
        self.angle: Array = np.zeros(0)
        self.speed: Array = np.zeros(0)

    def reset(self, angle: Array, speed: Array) -> None:
        """Reset to known angles (nu,) [rad] and speeds (nu,) [rad/s]."""
        self.angle, self.speed = angle.copy(), speed.copy()

    def update(self, measured: Array, acceleration: Array, dt: float) -> None:
        """Advance the estimate by one tick of dt [s].

        ``measured`` (nu,) are the encoders' angles [rad], ``acceleration`` (nu,) is expected since
        the tick before [rad/s^2].
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


@dataclass(frozen=True)
class BaseFilterOptions(Checked):
    """Noise that the filter of the trunk assumes; standard deviations.

    Attributes:
        gyro_noise: of a reading [rad/s]; the sensor's own, whatever the robot's size.
        force_noise: of a reading of the accelerometer [m/s^2]; likewise.
        foot_noise: of a foot's position relative to the trunk, from encoders and model [m].
        creep: of a standing foot in a second, by slip and by a ground that gives way [m/s].
    """

    gyro_noise: Positive = 5e-3
    force_noise: Positive = 0.1
    foot_noise: Positive = tuned(5e-4, LENGTH)
    creep: Positive = tuned(0.01, SPEED)


class BaseFilter:
    """Extended Kalman filter of (x, y, pitch, x', y', p_left, p_right).

    The IMU predicts the state, with R the trunk's rotation and f the specific force:

        pitch' = gyro,    v' = R(pitch) f - (0, g),    x' = v,

    and a foot in stance stays where it landed. The measurement is p_i minus the foot's position
    by forward kinematics; a round foot rolls, so that p_i is its contact point less the
    radius times its angle, which keeps its value while it rolls. Along the world's x and y
    nothing is measured: the estimate drifts there as a real robot's does. (Bloesch et al. 2012,
    in the plane.) The robot's last update is overwritten.
    """

    def __init__(self, robot: PlanarBiped, options: BaseFilterOptions) -> None:
        self.robot = robot
        self.options = options
        self.state = np.zeros(_SIZE)
        self.pitch_rate = 0.0
        self._covariance = np.zeros((_SIZE, _SIZE))
        self._stands = np.zeros(2, dtype=bool)

    def reset(self, q: Array, v: Array) -> None:
        """Reset to a known state q, v (nv,) [m, rad, m/s, rad/s], with no foot in stance."""
        self.state[:] = 0.0
        self.state[:3], self.state[_V], self.pitch_rate = q[:3], v[:2], float(v[2])
        self._covariance[:] = 0.0
        self._stands[:] = False

    def predict(self, pitch_rate: float, specific_force: Array, dt: float) -> None:
        """Advance the estimate by one tick of dt [s].

        ``pitch_rate`` is read now [rad/s]; ``specific_force`` (2,) is the mean since the tick
        before [m/s^2].
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
        """Correct the estimate with the joints' angles (nu,) [rad] of the feet in contact (2,)."""
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
            # It has just landed: the rest of the state determines its position.
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


@dataclass(frozen=True)
class NoiseFilterOptions(Checked):
    """Confidence in the accelerations that the whole-body QP expects.

    Attributes:
        acceleration_noise: standard deviation of their error in a tick [rad/s^2]; of the base's
            x, y and z it is this times the template's rest length [m/s^2]. Less, and the estimate
            is late after a push and with another mass; more, and it is as noisy as the sensors.
        landing_noise: the same of the joints after a touchdown [rad/s^2]. A foot lands with a
            jolt and may slip until it is loaded; the QP expects neither.
        settling: for so long after it [s].
    """

    acceleration_noise: Positive = tuned(2.0, RATE_SQUARED)
    landing_noise: Positive = tuned(60.0, RATE_SQUARED)
    settling: NotNegative = tuned(0.035, TIME)


class NoiseFilter:
    """Kalman filter of the whole state, decoupled by coordinate.

    The state is predicted with the QP's accelerations a; their error is white noise. Measured are q
    and v. With the errors e taken along the configuration space, and gains K that all coordinates
    of the base share, and all joints:

        q_p = q (+) (v dt + a dt^2 / 2),    v_p = v + a dt,
        q = q_p (+) (K_qq e_q + K_qv e_v),  v = v_p + K_vq e_q + K_vv e_v.

    Since the accelerations are known, the estimate is not late where they are right.

    Args:
        robot: whose state.
        deviation: (2,) of the measured positions [rad] and velocities [rad/s]; of the base's x, y
            and z they are these times the template's rest length, as the accelerations are. Not
            both are 0.
        options: of the robot's size.
    """

    def __init__(
        self, robot: FloatingBaseBiped, deviation: Array, options: NoiseFilterOptions
    ) -> None:
        self._robot = robot
        self._options = options
        self._base, self._joints = _Pair(deviation), _Pair(deviation)
        self._state: tuple[Array, Array] | None = None
        self._contact = np.zeros(len(robot.feet), dtype=bool)
        self._landed = np.inf

    def update(
        self,
        measured: tuple[Array, Array],
        acceleration: Array,
        contact: NDArray[np.bool_],
        dt: float,
    ) -> tuple[Array, Array]:
        """Update the estimate with one tick's measurement; the first one sets it.

        Args:
            measured: (nq,) configuration and (nv,) velocity.
            acceleration: (nv,) that the whole-body QP expects since the tick before.
            contact: (n,) whether each contact touches the ground.
            dt: since then [s].

        Returns:
            (nq,) configuration and (nv,) velocity.
        """
        o, robot = self._options, self._robot
        self._landed = 0.0 if (contact & ~self._contact).any() else self._landed + dt
        self._contact = contact.copy()
        if self._state is None:
            self._state = measured
            return measured
        q, v = self._state
        q = robot.moved(q, (v + 0.5 * acceleration * dt) * dt)
        v = v + acceleration * dt
        errors = np.array([robot.between(q, measured[0]), measured[1] - v])
        rough = self._landed <= o.settling
        joints = o.landing_noise if rough else o.acceleration_noise
        change = np.empty_like(errors)
        change[:, :FLOATING_DOF] = (
            self._base.gain(o.acceleration_noise, dt) @ errors[:, :FLOATING_DOF]
        )
        change[:, FLOATING_DOF:] = self._joints.gain(joints, dt) @ errors[:, FLOATING_DOF:]
        self._state = robot.moved(q, change[0]), v + change[1]
        return self._state


class _Pair:
    """Covariance of a position and its speed, both measured at every tick.

    ``deviation`` (2,) are the standard deviations of the measurements.
    """

    def __init__(self, deviation: Array) -> None:
        self._noise = np.diag(deviation**2)
        self._covariance = self._noise.copy()

    def gain(self, lacking: float, dt: float) -> Array:
        """(2, 2) gain of a tick's measurement, dt [s] after the last one.

        ``lacking`` is the standard deviation of the accelerations since then.
        """
        flow, entry = np.array([[1.0, dt], [0.0, 1.0]]), np.array([0.5 * dt**2, dt])
        ahead = flow @ self._covariance @ flow.T + lacking**2 * np.outer(entry, entry)
        gain = np.linalg.solve(ahead + self._noise, ahead).T
        self._covariance = ahead - gain @ ahead
        return gain
