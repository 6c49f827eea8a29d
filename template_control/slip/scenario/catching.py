"""A route whose walk breaks into another stride where it cannot go on, and walks on after it.

Too fast, it runs until it is slow; too slow, both feet carry it on, or it stands and starts again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.maps.section import APEX, REST, Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, StrideGoal
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import REFERENCE, SPEED, Scale, scaled, tuned

Array = NDArray[np.float64]

_WALKS = (StrideKind.WALK, StrideKind.WALK_PUSH_OFF)
_STOPS = (StrideKind.WALK_TO_STAND, StrideKind.STEP_BACK)

CATCHING_STRIDES = frozenset((StrideKind.WALK_TO_RUN, StrideKind.RUN, StrideKind.RUN_TO_WALK))
"""The strides of a run that catches a walk; each needs a planner."""


@dataclass(frozen=True)
class CatchOptions(Checked):
    """When a walk breaks into another stride, and when a run that catches it is over.

    Attributes:
        excess: a walk that is faster than wanted by less than this is left to its planner,
        fast: unless it is at least this fast at VLO, where the template is about to take off.
        walkable: at an apex with at most this speed the robot walks again.
        slow: dx/dt at apex that the run slows down to; less than ``walkable``, as no run settles
            on its speed exactly.
        lag: a walk whose CoM moves slower than its wanted speed at VLO by at least this is carried
            on by both feet, comes to a stand or steps back. While both feet stand, a walk that is
            not disturbed is faster than at VLO.
    """

    excess: NotNegative = tuned(0.42, SPEED)
    fast: Positive = tuned(1.45, SPEED)
    walkable: Positive = tuned(1.45, SPEED)
    slow: Positive = tuned(1.35, SPEED)
    lag: NotNegative = tuned(0.25, SPEED)


@runtime_checkable
class BreakingRoute(Route, Protocol):
    """A route that knows another way where a stride cannot go on."""

    def instead(self, goal: StrideGoal, speed: float, excess: float) -> Sequence[StrideGoal]:
        """What the robot can break into within a stride, the best first; the route does not go on.

        Args:
            goal: of that stride.
            speed: dx/dt now [m/s].
            excess: by which the robot is faster than wanted [m/s]: dx/dt at the section less the
                target's, and what disturbances have added since.

        Returns:
            Empty where there is nothing.
        """

    def take(self, goal: StrideGoal) -> None:
        """The robot has broken into ``goal``, which :meth:`instead` has named."""


class CatchingRoute:
    """Follows another route; where its walk cannot go on, another stride does.

    A walk that is too fast runs until it is slow. One that is too slow is carried on in its double
    stance, or comes to a stand there; on one leg it steps back. From a stand it starts again.

    Args:
        route: that is followed.
        options: when it breaks into what, and when the run is over.
    """

    @checked
    def __init__(self, route: Route, options: CatchOptions | None = None) -> None:
        self.followed = route
        self.parameters: SlipParameters = route.parameters
        self.section: Section = route.section
        self.start: Array = route.start
        self.options = scaled(options or CatchOptions(), Scale.of(route.parameters))
        self._walk: StrideGoal | None = None
        self._caught = ""  # the stride that was broken into

    @property
    def endless(self) -> bool:
        """See :class:`~.route.Route`."""
        return self.followed.endless

    def reset(self) -> None:
        """See :class:`~.route.Route`."""
        self.followed.reset()
        self._walk, self._caught = None, ""

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.next`."""
        on = self._go_on(section, z)
        if on is not None:
            return on
        self._caught = ""
        goal = self.followed.next(section, z, now)
        self._walk = goal if goal is not None and goal.stride in _WALKS else None
        return goal

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.ahead`."""
        return self._go_on(section, z) or self.followed.ahead(section, z, now)

    def instead(self, goal: StrideGoal, speed: float, excess: float) -> Sequence[StrideGoal]:
        """See :meth:`BreakingRoute.instead`: a run, or for a slow walk what goes slower."""
        slowest, fastest = running_speeds(self.parameters)
        o, at_vlo = self.options, float(goal.target[0]) + excess
        walk = goal.stride in _WALKS
        carried = self._caught == goal.stride == StrideKind.CHANGE_SPEED
        if (walk or carried) and speed <= goal.target[0] - o.lag:
            return self._slower(goal, goal.then if carried else goal.stride)
        fast = walk and (excess >= o.excess or at_vlo >= o.fast)
        on = self._caught == goal.stride == StrideKind.WALK_TO_RUN
        if speed < slowest or not (fast or on):
            return ()
        return (self._run(goal, StrideKind.WALK_TO_RUN, min(speed, fastest), StrideKind.RUN),)

    def take(self, goal: StrideGoal) -> None:
        """See :meth:`BreakingRoute.take`."""
        self._caught = goal.stride

    def _go_on(self, section: Section, z: Array) -> StrideGoal | None:
        """The stride that begins where a catch has led to, at an apex or at rest."""
        walk = self._walk
        if walk is None:
            return None
        if self._caught in _STOPS and section is REST:
            return replace(walk, stride=StrideKind.STAND_TO_WALK, then=walk.stride)
        if self._caught != StrideKind.WALK_TO_RUN or section is not APEX:
            return None
        if z[0] > self.options.walkable:
            return self._run(walk, StrideKind.RUN, self.options.slow, StrideKind.RUN_TO_WALK)
        return replace(walk, stride=StrideKind.RUN_TO_WALK, then=walk.stride)

    def _slower(self, goal: StrideGoal, walk: str | None) -> Sequence[StrideGoal]:
        """On to the goal's target and the next stride of ``walk``, or to a stand."""
        height = STAND_HEIGHT / REFERENCE.rest_length * self.parameters.rest_length
        rest = replace(goal, target=np.array([0.0, height, 0.0]), then=StrideKind.STAND_TO_WALK)
        stops = [replace(rest, stride=stop) for stop in _STOPS]
        return replace(goal, stride=StrideKind.CHANGE_SPEED, then=walk), *stops

    def _run(self, walk: StrideGoal, stride: str, speed: float, then: str) -> StrideGoal:
        p = self.parameters
        relative = speed / p.speed_unit
        target = np.array([speed, suited_height(relative) * p.rest_length])
        return StrideGoal(stride, target, speed, walk.segment, then)
