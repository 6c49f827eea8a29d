"""The robot's whole state, estimated at every tick."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.estimation.base_filter import BaseFilter, BaseFilterOptions
from template_control.estimation.joint_filter import JointFilter, JointFilterOptions
from template_control.estimation.readings import Readings
from template_control.robot.planar_biped import PlanarBiped

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EstimatorOptions(Checked):
    """What the estimator reckons with.

    Attributes:
        joints: of the encoders.
        base: of the IMU and the feet.
    """

    joints: JointFilterOptions = field(default_factory=JointFilterOptions)
    base: BaseFilterOptions = field(default_factory=BaseFilterOptions)


class StateEstimator:
    """Estimates (q, v) from :class:`Readings`.

    Args:
        robot: model; its last update is overwritten.
        options: the noise.
    """

    def __init__(self, robot: PlanarBiped, options: EstimatorOptions) -> None:
        self._joints = JointFilter(options.joints)
        self._base = BaseFilter(robot, options.base)

    def reset(self, q: Array, v: Array) -> None:
        """Begin with a known state.

        Args:
            q: (nv,) configuration [m, rad].
            v: (nv,) velocity [m/s, rad/s].
        """
        self._joints.reset(q[3:], v[3:])
        self._base.reset(q, v)

    def update(self, readings: Readings, acceleration: Array, dt: float) -> tuple[Array, Array]:
        """Take in the readings of a tick.

        Args:
            readings: of this tick.
            acceleration: (nv,) that the whole-body QP expects since the tick before.
            dt: since then [s]; 0 at the first tick.

        Returns:
            (nv,) configuration and (nv,) velocity.
        """
        joints, base = self._joints, self._base
        if dt > 0.0:
            joints.update(readings.joints, acceleration[3:], dt)
            base.predict(readings.pitch_rate, readings.specific_force, dt)
        base.correct(joints.angle, readings.contact)
        q = np.concatenate((base.state[:3], joints.angle))
        return q, np.concatenate((base.state[3:5], [base.pitch_rate], joints.speed))
