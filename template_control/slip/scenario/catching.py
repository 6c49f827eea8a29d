"""A route that breaks into a run where its walk cannot go on, slows down, and walks on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.maps.section import APEX, Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, StrideGoal
from template_control.slip.similarity import SPEED, Scale, scaled, tuned

Array = NDArray[np.float64]

_WALKS = ("w", "wp")
_BREAKS, _RUNS, _SLOWS = "wr", "r", "rw"

CATCHING_STRIDES = frozenset((_BREAKS, _RUNS, _SLOWS))
"""The strides of a run that catches a walk; each needs a planner."""


@dataclass(frozen=True)
class CatchOptions(Checked):
    """When a run catches a walk, and when it is over.

    Attributes:
        excess: a walk that is faster than wanted by less than this is left to its planner,
        fast: unless it is at least this fast at VLO, where the template is about to take off.
        walkable: at an apex with at most this speed the robot walks again.
        slow: dx/dt at apex that the run slows down to; less than ``walkable``, as no run settles
            on its speed exactly.
    """

    excess: NotNegative = tuned(0.42, SPEED)
    fast: Positive = tuned(1.45, SPEED)
    walkable: Positive = tuned(1.45, SPEED)
    slow: Positive = tuned(1.35, SPEED)


@runtime_checkable
class BreakingRoute(Route, Protocol):
    """A route that knows another way where a stride cannot go on."""

    def instead(self, goal: StrideGoal, speed: float, excess: float) -> StrideGoal | None:
        """What the robot can break into within a stride; the route does not go on.

        Args:
            goal: of that stride.
            speed: dx/dt now [m/s].
            excess: by which the robot is faster than wanted [m/s]: dx/dt at the section less the
                target's, and what disturbances have added since.

        Returns:
            None where there is nothing.
        """

    def take(self, goal: StrideGoal) -> None:
        """The robot has broken into ``goal``, which :meth:`instead` has named."""


class CatchingRoute:
    """Follows another route; where its walk cannot go on, the robot runs until it is slow.

    Args:
        route: that is followed.
        options: when the run is over.
    """

    @checked
    def __init__(self, route: Route, options: CatchOptions | None = None) -> None:
        self.followed = route
        self.parameters: SlipParameters = route.parameters
        self.section: Section = route.section
        self.start: Array = route.start
        self.options = scaled(options or CatchOptions(), Scale.of(route.parameters))
        self._walk: StrideGoal | None = None
        self._caught = False

    @property
    def endless(self) -> bool:
        """See :class:`~.route.Route`."""
        return self.followed.endless

    def reset(self) -> None:
        """See :class:`~.route.Route`."""
        self.followed.reset()
        self._walk, self._caught = None, False

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.next`."""
        on = self._run_on(section, z)
        if on is not None:
            return on
        self._caught = False
        goal = self.followed.next(section, z, now)
        self._walk = goal if goal is not None and goal.stride in _WALKS else None
        return goal

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.ahead`."""
        return self._run_on(section, z) or self.followed.ahead(section, z, now)

    def instead(self, goal: StrideGoal, speed: float, excess: float) -> StrideGoal | None:
        """See :meth:`BreakingRoute.instead`: a run, for a walk that is fast enough for it."""
        slowest, fastest = running_speeds(self.parameters)
        o, at_vlo = self.options, float(goal.target[0]) + excess
        walks = goal.stride in _WALKS and (excess >= o.excess or at_vlo >= o.fast)
        on = self._caught and goal.stride == _BREAKS
        if speed < slowest or not (walks or on):
            return None
        return self._run(goal, _BREAKS, min(speed, fastest), _RUNS)

    def take(self, goal: StrideGoal) -> None:
        """See :meth:`BreakingRoute.take`."""
        self._caught = True

    def _run_on(self, section: Section, z: Array) -> StrideGoal | None:
        """The stride that begins at an apex of the run that catches a walk."""
        if not self._caught or section is not APEX or self._walk is None:
            return None
        if z[0] > self.options.walkable:
            return self._run(self._walk, _RUNS, self.options.slow, _SLOWS)
        return replace(self._walk, stride=_SLOWS, then=self._walk.stride)

    def _run(self, walk: StrideGoal, stride: str, speed: float, then: str) -> StrideGoal:
        p = self.parameters
        relative = speed / p.speed_unit
        target = np.array([speed, suited_height(relative) * p.rest_length])
        return StrideGoal(stride, target, speed, walk.segment, then)
