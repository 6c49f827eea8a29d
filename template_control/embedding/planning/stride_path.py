"""What was decided for the present stride, and the template's path that follows from it.

A path is planned again where a foot has landed, with what is still free chosen from there.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import answered
from template_control.embedding.planners.planner import (
    CurvePlanner,
    Decision,
    Planner,
    Planners,
    SlopePlanner,
)
from template_control.embedding.planning import choosing_again
from template_control.embedding.planning.planned_path import PlannedPath
from template_control.embedding.planning.replan_options import ReplanOptions
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.planning.route_planners import RoutePlanners
from template_control.embedding.planning.steadying import steady
from template_control.embedding.planning.stepping_out import follow_curve
from template_control.embedding.references.template_path import join
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.maps.section import Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, StrideGoal

Array = NDArray[np.float64]


class StridePath(PlannedPath):
    """Keeps what was decided for the present stride, and plans paths by it.

    Args:
        route: which stride comes next, and towards which state.
        planners: one for each kind of stride of the route.
        options: when to plan again.
        automaton: of the strides.
        curved: nodes in which the planner's curve is followed, not the template's springs.

    Attributes:
        reports: one a section, the start's included.
        reaching: the swing foot is overdue, and the path goes on without it.
        arrived: the route has ended.
    """

    def __init__(
        self,
        route: Route,
        planners: Planners,
        options: ReplanOptions,
        automaton: Automaton = AUTOMATON,
        curved: Set[str] = frozenset(),
    ) -> None:
        super().__init__()
        self.route = route
        self.planners = planners
        self.options = options
        self.automaton = automaton
        self.curved = curved
        self.parameters: SlipParameters = route.parameters
        self.reports: list[SectionReport] = []
        self.reaching = False
        self.arrived = False
        self._planned_at = 0.0
        self._whole = True
        self._planners = RoutePlanners(route, planners, options, automaton)
        self._rest = RestOfStride(self._planners, automaton, curved)

    def begin(self, section: Section) -> tuple[Planner, Node]:
        """Planner and first node of the stride that the route begins with, at ``section``.

        Everything of an earlier run is forgotten.

        Raises:
            ParameterError: if the route is empty, or there is no planner for that stride.
        """
        self._planners.reset()
        self._rest.stand_on(self.parameters)
        self.reports.clear()
        self.arrived = False
        goal = self.first_goal()
        return self._planners.of(goal), self.automaton.start(goal.stride)

    def first_goal(self) -> StrideGoal:
        """The stride that the route begins with.

        Raises:
            ParameterError: if the route is empty.
        """
        return self._planners.first_goal()

    @property
    def planner(self) -> Planner:
        """The planner of the present stride."""
        return self._planners.of(self.reports[-1].goal)

    def follow(self, node: Node, sensed: Sensed, now: float, angle_drop: float = 0.0) -> Node:
        """Template path from here to the touchdown after the next section.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            now: time [s].
            angle_drop: how much lower the touchdown angle is than decided [rad].

        Returns:
            The node that the path begins in: of another stride where a curve led to no rest.
        """
        return self._follow(node, sensed.state, sensed, now, angle_drop)

    def _follow(
        self, node: Node, state: Array, sensed: Sensed, now: float, angle_drop: float = 0.0
    ) -> Node:
        report = self.reports[-1]
        u = report.decision.controls
        if angle_drop:
            u = u.copy()
            u[Slot.TOUCHDOWN_ANGLE] -= angle_drop
        self.reaching = angle_drop > 0.0
        if node.name in self.curved:
            self.reports[-1], first = follow_curve(self._rest, node.name, sensed, state, report)
            node = self.automaton.node(first.start)
        else:
            first = self._rest.onward(node.name, sensed, state, u)
        strides, self._whole = self._rest.strides(node, first, report.goal, now)
        self.take(join(strides, self.options.path), sensed.feet)
        self._planned_at = now
        return node

    def land(self, node: Node, sensed: Sensed, now: float) -> None:
        """A foot has landed: choose again what is still free, from where it did.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            now: time [s].
        """
        self.hold(choosing_again.landed(self._rest, node, sensed, self.reports[-1]))
        self.follow(node, sensed, now)

    def hold(self, decision: Decision | None) -> None:
        """From now on this decision holds for the present stride, if it is one.

        Args:
            decision: for it; None: the one so far.
        """
        if decision is not None:
            self.reports[-1] = replace(self.reports[-1], decision=decision)

    def on_slope(self, slope: float) -> float:
        """Plan for another slope from now on.

        Args:
            slope: angle of the ground [rad].

        Returns:
            The slope that is planned for: 0 by a planner that knows none, or no gait there.
        """
        report, ground = self.reports[-1], self.parameters
        # All of them: the strides ahead may be others' than the present one.
        answers = {
            id(planner): answered(SlipParameters, planner.on_slope, slope)
            for planner in self.planners.values()
            if isinstance(planner, SlopePlanner)
        }
        ground = answers.get(id(self.planner), ground)
        if isinstance(self.planner, CurvePlanner) and ground.slope:
            # No spring carries along a curve, but in the strides after it.
            assists = (answer.assist for answer in answers.values())
            ground = replace(ground, assist=next(filter(None, assists), 0.0))
        if self._rest.stand_on(ground):
            self.hold(replace(report.decision, nominal=False))
        return ground.slope

    @property
    def ground(self) -> SlipParameters:
        """The template on its present ground."""
        return self._rest.ground

    def steady(self, node: Node, sensed: Sensed) -> None:
        """Choose the assist of a double stance that begins on ground that was not expected.

        Arguments as for :meth:`follow`. The assist is a slope's: it is left to planners of slopes.
        """
        planner = self.planner
        if isinstance(planner, SlopePlanner) and not isinstance(planner, CurvePlanner):
            steady(self._rest, node, sensed, self.reports[-1], self.options.ground.assist)

    def land_off(self, node: Node, sensed: Sensed, now: float, height: float) -> Node:
        """A foot has landed where the ground may be higher or lower than it was thought.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            now: time [s].
            height: of the ground over the other foot's [m].

        Returns:
            As :meth:`follow`.
        """
        if abs(height) > self.options.ground.height and node.name not in self.curved:
            rest, report = self._rest, self.reports[-1]
            self.hold(choosing_again.landed_off(rest, node, sensed, report, height))
        return self.follow(node, sensed, now)
