"""The state of a robot from noisy measurements of all of it, and from what the QP expects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import FLOATING_DOF
from template_control.slip.similarity import RATE_SQUARED, TIME, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseFilterOptions(Checked):
    """How far the accelerations that the whole-body QP expects are believed.

    Attributes:
        acceleration_noise: standard deviation of what they lack in a tick [rad/s^2]; of the base's
            x, y and z it is this times the template's rest length [m/s^2]. Less, and the estimate
            is late after a push and with another mass; more, and it is as noisy as the sensors.
        landing_noise: the same of the joints after a touchdown [rad/s^2]. A foot lands with a
            jolt and may slip until it is loaded; the QP expects neither.
        settling: for so long after it [s].
    """

    acceleration_noise: Positive = tuned(2.0, RATE_SQUARED)
    landing_noise: Positive = tuned(60.0, RATE_SQUARED)
    settling: NotNegative = tuned(0.035, TIME)


class _Pair:
    """Covariance of a position and its speed, both of which are measured at every tick.

    Args:
        deviation: (2,) standard deviations of the measurements.
    """

    def __init__(self, deviation: Array) -> None:
        self._noise = np.diag(deviation**2)
        self._covariance = self._noise.copy()

    def gain(self, lacking: float, dt: float) -> Array:
        """(2, 2) gain of a tick's measurement.

        Args:
            lacking: standard deviation of the accelerations since the last one.
            dt: since then [s].
        """
        flow, entry = np.array([[1.0, dt], [0.0, 1.0]]), np.array([0.5 * dt**2, dt])
        ahead = flow @ self._covariance @ flow.T + lacking**2 * np.outer(entry, entry)
        gain = np.linalg.solve(ahead + self._noise, ahead).T
        self._covariance = ahead - gain @ ahead
        return gain


class NoiseFilter:
    """Kalman filter of the whole state, each coordinate for itself.

    The QP's accelerations a move the state on; what they lack is white noise. Measured are q
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
        self._contact = np.zeros(2, dtype=bool)
        self._landed = np.inf

    def update(
        self,
        measured: tuple[Array, Array],
        acceleration: Array,
        contact: NDArray[np.bool_],
        dt: float,
    ) -> tuple[Array, Array]:
        """Take in the measurement of a tick; the first one is believed as it is.

        Args:
            measured: (nq,) configuration and (nv,) velocity.
            acceleration: (nv,) that the whole-body QP expects since the tick before.
            contact: (2,) whether each foot touches the ground.
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
