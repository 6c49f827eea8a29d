"""A route that breaks into a run where its walk cannot go on, slows down, and walks on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Positive
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.maps.section import APEX, Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, StrideGoal
from template_control.slip.similarity import SPEED, Scale, scaled, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CatchOptions(Checked):
    """How a run that catches a walk goes.

    Attributes:
        brake: the speed aimed at is this far below the present one [m/s].
        walkable: at an apex with at most this speed the robot walks again [m/s].
    """

    brake: Positive = tuned(0.2, SPEED)
    walkable: Positive = tuned(1.45, SPEED)


@runtime_checkable
class BreakingRoute(Route, Protocol):
    """A route that knows another way where a stride cannot be completed."""

    def instead(self, goal: StrideGoal, speed: float) -> StrideGoal | None:
        """Another stride than ``goal``'s, that the robot can break into within it.

        Args:
            goal: what the route asked for.
            speed: dx/dt now [m/s].

        Returns:
            None where there is none.
        """

    def take(self, goal: StrideGoal) -> None:
        """The robot has broken into ``goal``."""


class CatchingRoute:
    """Follows another route; where the walk cannot go on the robot runs until it is slow.

    Args:
        route: that is followed.
        options: how the run goes.
    """

    @checked
    def __init__(self, route: Route, options: CatchOptions | None = None) -> None:
        self.inner = route
        self.parameters: SlipParameters = route.parameters
        self.section: Section = route.section
        self.start: Array = route.start
        self.options = scaled(options or CatchOptions(), Scale.of(route.parameters))
        self._slowest, self._fastest = running_speeds(route.parameters)
        self._unit = float(np.sqrt(self.parameters.gravity * self.parameters.rest_length))
        self._walk: StrideGoal | None = None
        self._runs = False

    @property
    def endless(self) -> bool:
        """See :class:`~.route.Route`."""
        return self.inner.endless

    def reset(self) -> None:
        """See :meth:`~.route.Route.reset`."""
        self.inner.reset()
        self._walk, self._runs = None, False

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.next`."""
        if self._runs and section == APEX:
            return self._run_on(float(z[0]))
        self._runs = False
        goal = self.inner.next(section, z, now)
        if goal is not None and goal.stride == "w":
            self._walk = goal
        return goal

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.ahead`."""
        if self._runs and section == APEX:
            return self._run_on(float(z[0]))
        return self.inner.ahead(section, z, now)

    def instead(self, goal: StrideGoal, speed: float) -> StrideGoal | None:
        """See :class:`BreakingRoute`."""
        if goal.stride not in ("w", "wr") or self._walk is None or speed < self._slowest:
            return None
        if goal.stride == "wr" and not self._runs:
            return None
        return self._run("wr", speed)

    def take(self, goal: StrideGoal) -> None:
        """See :class:`BreakingRoute`."""
        self._runs = True

    def _run(self, stride: str, speed: float) -> StrideGoal:
        brake = 0.0 if stride == "wr" else self.options.brake
        wanted = min(max(speed - brake, self._slowest), self._fastest)
        height = suited_height(wanted / self._unit) * self.parameters.rest_length
        then = "rw" if stride == "r" else "r"
        return StrideGoal(stride, np.array([wanted, height]), wanted, then=then)

    def _run_on(self, speed: float) -> StrideGoal:
        assert self._walk is not None
        if speed > self.options.walkable:
            return self._run("r", speed)
        return replace(self._walk, stride="rw", then="w")
