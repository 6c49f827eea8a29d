"""Kalman filters of joints, and of a floating-base robot's whole state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import FLOATING_DOF
from template_control.slip.similarity import RATE_SQUARED, TIME, tuned


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
        """Advance by dt [s] with angles (nu,) [rad] and expected accelerations (nu,) [rad/s^2]."""
        o = self.options
        index = o.acceleration_noise * dt**2 / o.angle_noise
        r = 0.25 * (4.0 + index - np.sqrt(8.0 * index + index**2))
        alpha = 1.0 - r**2
        beta = 2.0 * (2.0 - alpha) - 4.0 * float(np.sqrt(1.0 - alpha))
        angle = self.angle + (self.speed + 0.5 * acceleration * dt) * dt
        speed = self.speed + acceleration * dt
        missed = measured - angle
        self.angle = angle + alpha * missed
        self.speed = speed + beta / dt * missed


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
        contact: BoolArray,
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
        lacking = o.landing_noise if self._landed <= o.settling else o.acceleration_noise
        base = self._base.gain(o.acceleration_noise, dt) @ errors[:, :FLOATING_DOF]
        joints = self._joints.gain(lacking, dt) @ errors[:, FLOATING_DOF:]
        change = np.hstack((base, joints))
        self._state = robot.moved(q, change[0]), v + change[1]
        return self._state


class _Pair:
    """Covariance of a position and its speed, measured with the standard deviations (2,)."""

    def __init__(self, deviation: Array) -> None:
        self._noise = np.diag(deviation**2)
        self._covariance = self._noise.copy()

    def gain(self, lacking: float, dt: float) -> Array:
        """(2, 2) gain after dt [s] with the standard deviation of the accelerations in it."""
        flow, entry = np.array([[1.0, dt], [0.0, 1.0]]), np.array([0.5 * dt**2, dt])
        ahead = flow @ self._covariance @ flow.T + lacking**2 * np.outer(entry, entry)
        gain = np.linalg.solve(ahead + self._noise, ahead).T
        self._covariance = ahead - gain @ ahead
        return gain
