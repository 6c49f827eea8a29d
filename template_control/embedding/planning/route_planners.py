"""The planners of a route: which one plans a stride, from where, and what it decides."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import asked, check, name_of, shown
from template_control.checks.ranges import Shape, Triple
from template_control.embedding.planners.planner import (
    Decision,
    ForgettingPlanner,
    Planner,
    Planners,
    decided,
)
from template_control.embedding.planning.replan_options import ReplanOptions
from template_control.embedding.section_report import Learnt, SectionReport
from template_control.errors import ParameterError
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.maps.section import Section, section_of
from template_control.slip.scenario.route import Route, StrideGoal

Array = NDArray[np.float64]

_TARGETS = {size: Annotated[Array, Shape((size,))] for size in (2, 3)}


class RoutePlanners:
    """Decides at the sections of a route.

    Args:
        route: which stride comes next, and towards which state.
        planners: one for each kind of stride of the route.
        options: from which states a path starts where the robot's leads nowhere.
        automaton: of the strides.
    """

    def __init__(
        self, route: Route, planners: Planners, options: ReplanOptions, automaton: Automaton
    ) -> None:
        self.route = route
        self.planners = planners
        self.options = options
        self.automaton = automaton

    def reset(self) -> None:
        """Forget an earlier run."""
        asked(self.route.reset)
        for planner in self.planners.values():
            asked(planner.reset)

    def first_goal(self) -> StrideGoal:
        """The stride that the route begins with.

        Raises:
            ParameterError: if the route is empty.
        """
        goal = self.ahead(self.route.section, self.route.start, 0.0)
        if goal is None:
            raise ParameterError("the route ends where it begins: give one with a stride")
        return goal

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """As :meth:`~template_control.slip.scenario.route.Route.next`, checked.

        Args:
            section: where the robot is.
            z: (n,) its state there.
            now: time [s].

        Raises:
            ParameterError: naming the route's class, if it asks for no stride that there is.
        """
        return self._goal(self.route.next, section, z, now)

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """As :meth:`~template_control.slip.scenario.route.Route.ahead`, checked as :meth:`next`.

        Arguments as for :meth:`next`.
        """
        return self._goal(self.route.ahead, section, z, now)

    def _goal(
        self, method: Callable[[Section, Array, float], StrideGoal | None], *where: Any
    ) -> StrideGoal | None:
        goal = asked(method, *where)
        if goal is None:
            return None
        if not isinstance(goal, StrideGoal):
            raise ParameterError(
                f"{name_of(method)} returned {shown(goal)}: return a StrideGoal, or None at the end"
            )
        if goal.stride not in self.automaton.starts:
            raise ParameterError(
                f"{name_of(method)} asks for a stride {goal.stride!r}: give one of"
                f" {', '.join(self.automaton.starts)}"
            )
        end = section_of(self.automaton.sections(self.automaton.starts[goal.stride])[1])
        check(f"{name_of(method)}: the target", goal.target, _TARGETS[end.dimension])
        return goal

    def of(self, goal: StrideGoal) -> Planner:
        """The planner of a goal's stride.

        Raises:
            ParameterError: if there is none.
        """
        if goal.stride not in self.planners:
            raise ParameterError(
                f"the route asks for a stride {goal.stride!r}, and there are planners for"
                f" {', '.join(self.planners)}: give one for it too, or another route"
            )
        return self.planners[goal.stride]

    def decide(
        self,
        section: Section,
        z: Array,
        now: float,
        learnt: Learnt,
        reports: Sequence[SectionReport],
    ) -> tuple[SectionReport, Array, bool]:
        """Learn from the stride that ended, ask the route for the next one, and plan it.

        Args:
            section: that was reached.
            z: (n,) state there.
            now: time [s].
            learnt: what the controller has learnt, for the report.
            reports: of the strides so far; none at the start.

        Returns:
            What was decided, the section state from which its path starts, and whether the route
            goes on.
        """
        begin = time.perf_counter()
        if reports:
            last = reports[-1]
            asked(self.of(last.goal).observe, last.decision, z)
        wanted = self.next(section, z, now)
        # The last stride goes on until whoever drives the robot ends the run.
        goal = reports[-1].goal if wanted is None else wanted
        planner = self.of(goal)
        other = reports and reports[-1].goal.stride != goal.stride
        if other and isinstance(planner, ForgettingPlanner):
            asked(planner.forget)
        decision, start = self.plan(section, z, goal)
        seconds = time.perf_counter() - begin
        end = section_of(self.automaton.sections(self.automaton.start(goal.stride).name)[1])
        report = SectionReport(
            time=now,
            section=section,
            state=section.padded(z),
            goal=goal,
            target=end.padded(goal.target),
            decision=decision,
            offset=check(f"{type(planner).__name__}.offset", planner.offset, Triple).copy(),
            learnt=learnt,
            plan_seconds=seconds,
        )
        return report, start, wanted is not None

    def plan(self, section: Section, z: Array, goal: StrideGoal) -> tuple[Decision, Array]:
        """A decision at ``z``, and the section state from which its path starts.

        The template's leg ends at l0, cannot pull, and pushes as its spring does; the robot's
        need not. Where the template would leave the ground or come to no second stride, the
        path starts from a state that does, and the robot is let down or pushed up to it.

        Args:
            section: that was reached.
            z: (n,) state there.
            goal: the stride that begins.
        """
        o, planner = self.options, self.of(goal)
        decision = decided(planner.decide, z, goal.target)
        if decision.lasting:
            return decision, z
        for share in o.calmer:
            start = section.calmer(z, share, o.highest * self.route.parameters.rest_length)
            calmer = decided(planner.decide, start, goal.target)
            if calmer.lasting:  # from there; from here a run may be the better way
                feasible = decision.feasible
                return replace(calmer, feasible=feasible, lasting=False, nominal=False), start
        return decision, z
