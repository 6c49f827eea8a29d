"""A walk whose wanted speed may change at any time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.checks.fitting import check
from template_control.checks.ranges import NotNegative, Positive
from template_control.errors import ScenarioError
from template_control.slip.gaits.by_speed.speed_family import walking_by_speed
from template_control.slip.maps.section import VLO, Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import StrideGoal

Array = NDArray[np.float64]

Speed = Callable[[float], float]
"""The mean forward speed wanted at a time: m/s, from s."""

_FIRST_DURATION = 2.2  # of sqrt(l0 / g): guess of a step's duration before one was made


class SpeedRoute:
    """Walks at a speed that a function of time says.

    A step aims at the speed that is wanted when it will be over, and takes that of the family's
    gait at VLO for it. Beyond the family's range the target is beyond its end too, by as much; the
    planner takes the end.

    Args:
        parameters: the template.
        speed: a :class:`~.speed_command.SpeedProfile`, a :class:`~.speed_command.SpeedCommand`, or
            any function of time.
        duration: when the route ends [s]; None: it does not.
    """

    @checked
    def __init__(
        self, parameters: SlipParameters, speed: Speed, duration: Positive | None = None
    ) -> None:
        self.parameters = parameters
        self.section: Section = VLO
        self._speed, self._duration = speed, duration
        self._family = walking_by_speed()
        low, high = self._family.range(parameters)
        self._range = low, high
        first = min(max(self._wanted(0.0), low), high)
        self.start: Array = self._family.gait_for(parameters, first).vlo
        self._guess = _FIRST_DURATION * float(np.sqrt(parameters.rest_length / parameters.gravity))
        self.reset()

    @property
    def endless(self) -> bool:
        """See :class:`~.route.Route`."""
        return self._duration is None

    def reset(self) -> None:
        """See :class:`~.route.Route`."""
        self._began, self._took = 0.0, self._guess

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.next`."""
        if now > self._began:
            self._took = now - self._began
        self._began = now
        return self.ahead(section, z, now)

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.ahead`."""
        if self._duration is not None and now >= self._duration:
            return None
        wanted = self._wanted(now + self._took)
        speed, height = self._family.vlo_for(self.parameters, wanted)
        beyond = wanted - min(max(wanted, self._range[0]), self._range[1])
        return StrideGoal("wp", np.array([speed + beyond, height, 0.0]), wanted)

    def _wanted(self, time: float) -> float:
        """The wanted mean speed [m/s].

        Raises:
            ScenarioError: if the function does not say one.
        """
        found = check(
            f"the wanted speed at {time:g} s", self._speed(time), NotNegative, ScenarioError
        )
        return float(found)
