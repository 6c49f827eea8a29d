"""Sensor models of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import Checked
from template_control.checks.ranges import Index, NotNegative, Share
from template_control.embedding.controller import EmbeddingController
from template_control.errors import ParameterError
from template_control.estimation.delay import DelayCompensation
from template_control.estimation.filters import NoiseFilter
from template_control.estimation.imu import ImuOptions, ImuSensors
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale

_VELOCITY_NOISE = 20.0  # [1/s] noise of velocities over that of positions
_CONTACT_DRAWS = 1  # added to the seed: flags are drawn apart from the noise of the state


@dataclass(frozen=True)
class SensorOptions(Checked):
    """The whole state is measured, with white Gaussian noise, drawn anew at every tick.

    Attributes:
        position_noise: standard deviation of the pitch and of every joint's angle [rad]; of
            the base's x and y it is this times the template's rest length [m].
        velocity_noise: the same of the velocities [rad/s], [m/s].
        seed: of the draws.
        contact_errors: share of contact flags that are wrong (:class:`ContactSensors`).
        noise: instead of the first two, one number for both: that of the angles [rad]; velocities
            have 20 times as much per second on the reference template, and on another one per its
            own unit of time.

    Raises:
        ParameterError: if a number is negative or not finite, or noise is given twice.
    """

    kind: ClassVar[str] = "state"

    position_noise: NotNegative = 0.0
    velocity_noise: NotNegative = 0.0
    seed: Index = 0
    contact_errors: Share = 0.0
    noise: NotNegative = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.noise and (self.position_noise or self.velocity_noise):
            raise ParameterError(
                "SensorOptions.noise stands for position_noise and velocity_noise: leave them out"
            )

    def deviations(self, scale: Scale) -> tuple[float, float]:
        """Standard deviations of angles [rad] and velocities [rad/s] at a template's ``scale``."""
        if self.noise:
            return self.noise, _VELOCITY_NOISE / scale.time * self.noise
        return self.position_noise, self.velocity_noise


class Senses(Protocol):
    """Measurement of the controller's state, tick by tick."""

    def measure(self, q: Array, v: Array, contact: BoolArray) -> tuple[Array, Array]:
        """q, v that the controller gets of the true q (nq,) [m, rad] and v (nv,) [m/s, rad/s].

        The true arrays are not changed; ``contact`` (n,) says which contacts touch the ground.
        """

    def expect(self, acceleration: Array) -> None:
        """Take the acceleration (nv,) that the controller expects until the next tick."""


class Sensors:
    """Measures the state of a robot, with noise scaled to its template."""

    def __init__(self, options: SensorOptions, robot: Biped, template: SlipParameters) -> None:
        self.deviations = options.deviations(Scale.of(template))
        self.exact = self.deviations == (0.0, 0.0)
        self._draws = np.random.default_rng(options.seed)
        self._robot = robot
        scale = np.ones(robot.nv)
        scale[: robot.directions] = template.rest_length  # the base's place comes first
        self._deviation = np.outer(self.deviations, scale)

    def measure(self, q: Array, v: Array, contact: BoolArray) -> tuple[Array, Array]:
        """As :meth:`Senses.measure`; without noise the true arrays themselves."""
        if self.exact:
            return q, v
        noise = self._deviation * self._draws.standard_normal(self._deviation.shape)
        return self._robot.moved(q, noise[0]), v + noise[1]

    def expect(self, acceleration: Array) -> None:
        """Nothing is expected: each tick is measured for itself."""


class ForeseeingSensors:
    """Sensors that give the state in which the torques of this tick will act, by a learnt delay."""

    def __init__(self, sensors: Sensors, delay: DelayCompensation) -> None:
        self._sensors, self._delay = sensors, delay
        self.expect = delay.expect

    def measure(self, q: Array, v: Array, contact: BoolArray) -> tuple[Array, Array]:
        """See :meth:`Senses.measure`."""
        return self._delay.foresee(*self._sensors.measure(q, v, contact))


class ContactSensors:
    """Contact flags and forces of the feet; a share of them is wrong, drawn anew at every tick.

    A wrong flag comes with the force that it stands for: none, or the ``threshold`` [N] from which
    on a foot touches the ground, straight up.
    """

    def __init__(self, options: SensorOptions | ImuOptions, threshold: float) -> None:
        self._errors = options.contact_errors
        # Two arrays are compared faster than an array and a number.
        self._threshold = np.array(threshold)
        self._draws = np.random.default_rng((options.seed, _CONTACT_DRAWS))

    def measure(self, forces: Array) -> tuple[BoolArray, Array]:
        """Flags (n,) and forces (n, d), up last [N], as the controller gets them."""
        touching = forces[:, -1] > self._threshold
        if self._errors == 0.0:
            return touching, forces
        wrong = self._draws.random(len(touching)) < self._errors
        touching, forces = touching ^ wrong, forces.copy()
        forces[wrong] = 0.0
        forces[wrong & touching, -1] = self._threshold
        return touching, forces


class FilteredSensors:
    """Sensors whose noise is filtered."""

    def __init__(self, sensors: Sensors, noise_filter: NoiseFilter, time_step: float) -> None:
        self._sensors, self._filter, self._dt = sensors, noise_filter, time_step
        self._expected: Array = np.zeros(1)

    def measure(self, q: Array, v: Array, contact: BoolArray) -> tuple[Array, Array]:
        """See :meth:`Senses.measure`."""
        measured = self._sensors.measure(q, v, contact)
        return self._filter.update(measured, self._expected, contact, self._dt)

    def expect(self, acceleration: Array) -> None:
        """See :meth:`Senses.expect`."""
        self._expected = acceleration


def senses_of(
    controller: EmbeddingController, options: SensorOptions | ImuOptions, dt: float
) -> Senses:
    """Sensors and estimators that give a controller its state every ``dt`` [s]."""
    robot, template, tuning = controller.robot, controller.parameters, controller.options
    assert isinstance(robot, PlanarBiped | FloatingBaseBiped)
    if isinstance(options, ImuOptions):
        # On a model of its own: the controller's may be turned.
        return ImuSensors(options, robot.changed(), Scale.of(template), dt)
    sensors = Sensors(options, robot, template)
    if isinstance(robot, PlanarBiped):
        return ForeseeingSensors(sensors, DelayCompensation(tuning.delay, robot, dt))
    if sensors.exact or tuning.noise_filter is None:
        return sensors
    noise_filter = NoiseFilter(robot, np.array(sensors.deviations), tuning.noise_filter)
    return FilteredSensors(sensors, noise_filter, dt)
