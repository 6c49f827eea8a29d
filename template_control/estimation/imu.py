"""Simulated encoders, IMU and contact sensors, and the state estimator that uses them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import Checked
from template_control.checks.ranges import Index, NotNegative, Share
from template_control.estimation.base_filter import BaseFilter, BaseFilterOptions, trunk_frame
from template_control.estimation.filters import JointFilter, JointFilterOptions
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.slip.similarity import Scale, scaled


class Readings(NamedTuple):
    """Sensor readings of one tick; the position in the world is not measured.

    Attributes:
        joints: (nu,) angles of the encoders [rad].
        turning: (a,) angular velocity of the trunk, from the gyro: in the plane pitch, forward
            positive, in space about the trunk's axes [rad/s].
        specific_force: (d,) from the accelerometer, forward, in space to the left, and up along the
            trunk: its acceleration less gravity, mean since the tick before [m/s^2].
        contact: (n,) whether each contact touches the ground.
    """

    joints: Array
    turning: Array
    specific_force: Array
    contact: BoolArray


@dataclass(frozen=True)
class EstimatorOptions(Checked):
    """Noise that the estimator assumes.

    Attributes:
        joints: of the encoders.
        base: of the IMU and the feet.
    """

    joints: JointFilterOptions = field(default_factory=JointFilterOptions)
    base: BaseFilterOptions = field(default_factory=BaseFilterOptions)


class StateEstimator:
    """Estimator of (q, v) from :class:`Readings`.

    Args:
        robot: model; its last update is overwritten.
        options: the noise.
    """

    def __init__(self, robot: PlanarBiped | FloatingBaseBiped, options: EstimatorOptions) -> None:
        self._joints = JointFilter(options.joints)
        self._base = BaseFilter(robot, options.base)
        self._nu = len(robot.joint_names)

    def reset(self, q: Array, v: Array) -> None:
        """Reset to a known state.

        Args:
            q: (nq,) configuration [m, rad].
            v: (nv,) velocity [m/s, rad/s].
        """
        self._joints.reset(q[-self._nu :], v[-self._nu :])
        self._base.reset(q, v)

    def update(self, readings: Readings, acceleration: Array, dt: float) -> tuple[Array, Array]:
        """Update the estimate with one tick's readings.

        Args:
            readings: of this tick.
            acceleration: (nv,) that the whole-body QP expects since the tick before.
            dt: since then [s]; 0 at the first tick.

        Returns:
            (nq,) configuration and (nv,) velocity.
        """
        joints, base = self._joints, self._base
        if dt > 0.0:
            joints.update(readings.joints, acceleration[-self._nu :], dt)
            base.predict(readings.turning, readings.specific_force, dt)
        base.correct(joints.angle, readings.contact)
        q = np.concatenate((base.base, joints.angle))
        return q, np.concatenate((base.rates, joints.speed))


@dataclass(frozen=True)
class ImuOptions(Checked):
    """Sensing by encoders, a trunk IMU and contacts: the controller gets a state estimate.

    The IMU sits at the origin of the trunk: in the plane where the legs hang. Noise is white and
    Gaussian, drawn anew at every tick.

    Attributes:
        encoder_noise: standard deviation of a joint's angle [rad].
        gyro_noise: of a component of the angular velocity [rad/s].
        accelerometer_noise: of a component of the specific force [m/s^2].
        seed: of the draws.
        contact_errors: share of contact flags that are wrong
            (:class:`~template_control.run.sensing.ContactSensors`).
        estimator: what makes the state of it; scaled to the robot.

    Raises:
        ParameterError: if a number is negative or not finite.
    """

    kind: ClassVar[str] = "imu"

    encoder_noise: NotNegative = 2e-4
    gyro_noise: NotNegative = 5e-3
    accelerometer_noise: NotNegative = 0.1
    seed: Index = 0
    contact_errors: Share = 0.0
    estimator: EstimatorOptions = field(default_factory=EstimatorOptions)


class ImuSensors:
    """Simulated sensors of a robot and its state estimate, which starts at the true state."""

    def __init__(
        self,
        options: ImuOptions,
        robot: PlanarBiped | FloatingBaseBiped,
        scale: Scale,
        time_step: float,
    ) -> None:
        self._options = options
        self._robot, self._trunk = robot, trunk_frame(robot)
        self._estimator = StateEstimator(robot, scaled(options.estimator, scale))
        self._draws = np.random.default_rng(options.seed)
        self._dt = time_step
        self._before: tuple[Array, Array] | None = None
        self._expected = np.zeros(robot.nv)

    def measure(self, q: Array, v: Array, contact: BoolArray) -> tuple[Array, Array]:
        """As :meth:`~template_control.run.sensing.Senses.measure`."""
        dt = self._dt
        if self._before is None:
            self._estimator.reset(q, v)
            self._before, dt = (q, v), 0.0
        found = self._estimator.update(self._read(q, v, contact), self._expected, dt)
        self._before = q.copy(), v.copy()
        return found

    def expect(self, acceleration: Array) -> None:
        """As :meth:`~template_control.run.sensing.Senses.expect`."""
        self._expected = acceleration

    def _read(self, q: Array, v: Array, contact: BoolArray) -> Readings:
        o, draws, trunk, d = self._options, self._draws, self._trunk, self._robot.directions
        assert self._before is not None
        old_q, old_v = self._before
        change = trunk.velocity_axes(q) @ v[:d] - trunk.velocity_axes(old_q) @ old_v[:d]
        acceleration = change / self._dt
        acceleration[-1] += self._robot.gravity
        force = trunk.middle(old_q, q).T @ acceleration
        nu = len(self._robot.joint_names)
        return Readings(
            joints=q[-nu:] + o.encoder_noise * draws.standard_normal(nu),
            turning=v[d : d + trunk.axes] + o.gyro_noise * draws.standard_normal(trunk.axes),
            specific_force=force + o.accelerometer_noise * draws.standard_normal(d),
            contact=contact,
        )
