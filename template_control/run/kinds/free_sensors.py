"""What a free robot's controller gets of a state that is measured with noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.estimation.noise_filter import NoiseFilter
from template_control.run.sensing import Sensors

Array = NDArray[np.float64]


class FilteredSensors:
    """Measures as :class:`~template_control.run.sensing.Sensors`, and filters the noise.

    Args:
        sensors: that measure, with noise.
        noise_filter: of the robot.
        time_step: from tick to tick [s].
    """

    exact = False

    def __init__(self, sensors: Sensors, noise_filter: NoiseFilter, time_step: float) -> None:
        self._sensors = sensors
        self._filter = noise_filter
        self._dt = time_step
        self._expected: Array = np.zeros(1)

    def measure(self, q: Array, v: Array, contact: NDArray[np.bool_]) -> tuple[Array, Array]:
        """As :meth:`~template_control.run.sensing.Senses.measure`."""
        measured = self._sensors.measure(q, v, contact)
        return self._filter.update(measured, self._expected, contact, self._dt)

    def expect(self, acceleration: Array) -> None:
        """As :meth:`~template_control.run.sensing.Senses.expect`."""
        self._expected = acceleration
