"""Supervision of a stride: decision at its section, the template's path, new plans on the way.

The path is planned at a section, again where a foot has landed, and again when a disturbance has
carried the robot away from it.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import answered_or_none
from template_control.embedding.com_path import Landing, TemplatePath, join
from template_control.embedding.planners.planner import (
    Cause,
    Decision,
    Planner,
    Planners,
)
from template_control.embedding.recovery import curve_or_step, find_recovery
from template_control.embedding.replanning import (
    HEIGHT_ERROR,
    choose_after_touchdown,
    choose_all_controls,
    choose_assist,
    choose_on_unexpected_ground,
    choose_stiffnesses,
    reachable_angles,
    reachable_turn,
)
from template_control.embedding.rollout import ReplanOptions, RoutePlanners, TemplateRollout
from template_control.embedding.state import EstimatorState, SectionReport, TemplateState
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event, Slot
from template_control.slip.maps.section import Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, StrideGoal

Array = NDArray[np.float64]


_TOUCHDOWN = int(Event.TOUCHDOWN)
_ANGLE_DROP = 0.15  # [rad] by which the touchdown angle of an overdue touchdown is taken lower


class StrideSupervisor:
    """Supervisor of a stride: decision at its section, path, and new plans on the way.

    Args:
        route: which stride comes next, and towards which state.
        planners: one for each kind of stride of the route.
        options: when to plan again.
        automaton: of the strides.
        curved: nodes in which the planner's curve is followed, not the template's springs.

    Attributes:
        reports: one a section, the start's included.
        path: the template's, from the last plan on.
        event_times: time on the path of the next occurrence of each :class:`Event` [s], else inf.
        feet: that were the rear and the front leg's where the path starts.
        without_touchdown: the swing foot is overdue, and the path goes on without it.
        arrived: the route has ended.
        height_error: of the ground under a foot that has landed, from which on it is unexpected
            [m].
    """

    path: TemplatePath

    def __init__(
        self,
        route: Route,
        planners: Planners,
        options: ReplanOptions,
        automaton: Automaton = AUTOMATON,
        curved: Set[str] = frozenset(),
    ) -> None:
        self.route = route
        self.planners = planners
        self.options = options
        self.automaton = automaton
        self.curved = curved
        self.parameters: SlipParameters = route.parameters
        self.reports: list[SectionReport] = []
        self.event_times = [np.inf] * NUM_EVENTS
        self.feet = (0, 1)
        self.without_touchdown = False
        self.arrived = False
        self._passed = 0  # so many of the path's events are over
        self._planned_at = 0.0
        self._viable = True  # the template completes the path's strides, and goes on
        self._recovering = False  # into the present stride
        self._knows_slopes = False  # the present stride's planner
        self._curved_kinds = {
            kind
            for kind, start in automaton.starts.items()
            if any(node.name in curved for node in automaton.stride(start))
        }
        self._speed_excess = (
            0.0  # speed at the stride's section less the wanted, and what came on top
        )
        self._planners = RoutePlanners(route, planners, automaton)
        self._rollout = TemplateRollout(self._planners, automaton, curved)
        self.height_error = HEIGHT_ERROR * self._rollout.scale.length

    def begin(self, section: Section) -> tuple[Planner, Node]:
        """Planner and first node of the stride that the route begins with, at ``section``.

        Everything of an earlier run is forgotten.

        Raises:
            ParameterError: if the route is empty, or there is no planner for that stride.
        """
        self._planners.reset()
        self._rollout.set_ground(self.parameters)
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

    @property
    def _along_curve(self) -> bool:
        """Whether a curve carries the present stride, at least in part."""
        return self.reports[-1].goal.stride in self._curved_kinds

    # -- decisions ----

    def decide(
        self, section: Section, sensed: TemplateState, now: float, estimators: EstimatorState
    ) -> Node:
        """At a section: learn from the stride that ended, choose the next one's controls.

        Args:
            section: that was reached.
            sensed: the robot's state.
            now: time [s].
            estimators: what the controller has learnt, for the report.

        Returns:
            The node that the stride begins in.
        """
        z = section.of(sensed.state)
        report, start, goes_on = self._planners.decide(section, z, now, estimators, self.reports)
        self.arrived = self.arrived or not goes_on
        self._recovering = False
        self._speed_excess = float(z[0] - report.goal.target[0])
        self.reports.append(report)
        node = self.automaton.start(report.goal.stride)
        state = sensed.state.copy()
        if start is not z:
            state[:4] = section.state(start, state[0])
        node = self._follow(node, state, sensed, now)
        if not report.decision.lasting and not self.arrived:
            return self._recover(node, sensed, 0.0, now) or node
        return node

    def _recover(
        self, node: Node, sensed: TemplateState, phase_time: float, now: float
    ) -> Node | None:
        """Break into another stride where the present one cannot go on.

        Arguments as for :meth:`reconsider`.

        Returns:
            The node that the robot is in then, with the path from there; None where the route
            knows no other stride, or the template does not complete it.
        """
        rollout, report = self._rollout, self.reports[-1]
        turn = reachable_turn(rollout.scale, self.time_of(Event.TOUCHDOWN) - phase_time)
        found = find_recovery(rollout, node, report, sensed, excess=self._speed_excess, turn=turn)
        if found is None:
            return None
        node, self.reports[-1] = found
        self._recovering = True
        return self.follow(node, sensed, now)

    def touchdown_overdue(self, node: Node, phase_time: float) -> bool:
        """Whether the swing foot should have found the ground by now.

        Args:
            node: of the automaton, the robot's.
            phase_time: time along the path [s].
        """
        late = phase_time > self.event_times[_TOUCHDOWN] + self.options.patience
        return late and not self.without_touchdown and node.edge(Event.TOUCHDOWN) is not None

    def continue_without_touchdown(self, node: Node, sensed: TemplateState, now: float) -> None:
        """The ground is lower than was thought: the template goes on without a touchdown.

        Arguments as for :meth:`follow`.
        """
        self.follow(node, sensed, now, _ANGLE_DROP)

    def deviates(self, deviation: float, phase_time: float, now: float) -> bool:
        """Whether a disturbance has carried the robot away from its path.

        A path that leads nowhere is one as well, where the robot has broken into its stride, no
        stride went on, or the planner may find another way.

        Args:
            deviation: of the forward speed from the path's [m/s].
            phase_time: time along the path [s].
            now: time [s].
        """
        o = self.options
        if self.without_touchdown or now - self._planned_at <= o.interval:
            return False
        if abs(deviation) > o.speed and phase_time > o.interval:
            self._speed_excess += deviation
            return True
        return not self._viable and (self._recovering or self._retry_planning())

    def _retry_planning(self) -> bool:
        """Whether the planner may find another way. One along a curve is left to it."""
        if self._along_curve:
            return False
        return not self.reports[-1].decision.feasible or self.planner.retries

    def replan(self, node: Node, sensed: TemplateState, phase_time: float, now: float) -> Node:
        """Plan again from here; until a leg lands, the stride's controls are still free.

        From then on the stiffnesses of what is left are, to a planner that has ``land``.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            phase_time: time along the path [s].
            now: time [s].

        Returns:
            The node that the robot is in then.
        """
        rollout, report = self._rollout, self.reports[-1]
        if self._recovering:
            other = self._recover(node, sensed, phase_time, now)
            if other is not None:
                return other
            if self._along_curve:
                self.set_decision(
                    choose_stiffnesses(rollout, node, sensed, report, Cause.DEVIATION)
                )
            return self.follow(node, sensed, now)
        lasting = True
        if node.name != self.automaton.starts[report.goal.stride] or node.name in self.curved:
            self.set_decision(choose_stiffnesses(rollout, node, sensed, report, Cause.DEVIATION))
        else:
            to_go = self.time_of(Event.TOUCHDOWN) - phase_time
            angles = reachable_angles(rollout, node, sensed, report, to_go)
            decision = choose_all_controls(rollout, node, sensed, report, angles, Cause.DEVIATION)
            self.set_decision(decision)
            lasting = decision is None or decision.lasting
        node = self.follow(node, sensed, now)
        if lasting and self._viable:
            return node
        return self._recover(node, sensed, 0.0, now) or node

    def replan_after_touchdown(
        self, node: Node, sensed: TemplateState, now: float, height_error: float, *, choose: bool
    ) -> Node:
        """Plan from where a foot has landed.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            now: time [s].
            height_error: height of the ground over the other foot's [m].
            choose: whether the stiffnesses that are still free are chosen again in any case, and
                not only where the ground is higher or lower than expected.

        Returns:
            As :meth:`follow`.
        """
        rollout, report = self._rollout, self.reports[-1]
        if choose:
            self.set_decision(choose_after_touchdown(rollout, node, sensed, report))
        elif abs(height_error) > self.height_error and node.name not in self.curved:
            self.set_decision(
                choose_on_unexpected_ground(rollout, node, sensed, report, height_error)
            )
        return self.follow(node, sensed, now)

    def set_decision(self, decision: Decision | None) -> None:
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
        report = self.reports[-1]
        # All of them: the strides ahead may be others' than the present one.
        answers = {
            kind: answered_or_none(SlipParameters, planner.on_slope, slope)
            for kind, planner in self.planners.items()
        }
        answer = answers[report.goal.stride]
        self._knows_slopes = answer is not None
        ground = answer or self.parameters
        if self._along_curve and ground.slope:
            # No spring carries along a curve, but in the strides after it.
            assists = (other.assist for other in answers.values() if other is not None)
            ground = replace(ground, assist=next(filter(None, assists), 0.0))
        if self._rollout.set_ground(ground):
            self.set_decision(replace(report.decision, nominal=False))
        return ground.slope

    @property
    def ground(self) -> SlipParameters:
        """The template on its present ground."""
        return self._rollout.ground

    def choose_assist(self, node: Node, sensed: TemplateState) -> None:
        """Choose the assist of a double stance that begins on ground that was not expected.

        Arguments as for :meth:`follow`. The assist is a slope's: it is left to planners of slopes.
        """
        if self._knows_slopes and not self._along_curve:
            choose_assist(self._rollout, node, sensed, self.reports[-1])

    # -- the path ----

    def follow(
        self, node: Node, sensed: TemplateState, now: float, angle_drop: float = 0.0
    ) -> Node:
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
        self, node: Node, state: Array, sensed: TemplateState, now: float, angle_drop: float = 0.0
    ) -> Node:
        report = self.reports[-1]
        u = report.decision.controls
        if angle_drop:
            u = u.copy()
            u[Slot.TOUCHDOWN_ANGLE] -= angle_drop
        self.without_touchdown = angle_drop > 0.0
        if node.name in self.curved:
            self.reports[-1], first = curve_or_step(self._rollout, node.name, sensed, state, report)
            node = self.automaton.node(first.start)
        else:
            first = self._rollout.forward(node.name, sensed, state, u)
        strides, self._viable = self._rollout.strides(node, first, report.goal, now)
        self.path, self.feet = join(strides, self._rollout.scale.time), sensed.feet
        self._look_ahead(0)
        self._planned_at = now
        return node

    def time_of(self, event: Event) -> float:
        """Time on the path at which ``event`` comes next [s], inf if it does not."""
        return self.event_times[event]

    def pass_event(self, event: Event) -> None:
        """The robot has fired ``event``."""
        self._look_ahead(self.path.after(event, self._passed))

    def _look_ahead(self, passed: int) -> None:
        """So many of the path's events are over: note when each comes next."""
        self._passed = passed
        self.event_times = self.path.event_times(passed)

    def landing(self, foot: int) -> Landing:
        """Next touchdown of a foot on the path."""
        return self.path.landings[self.feet.index(foot)]

    @property
    def toe(self) -> float:
        """x of the template's rear toe [m]."""
        return float(self.path.curve.look[0])

    def set_rear_toe(self, foot: int) -> None:
        """The template's rear toe is now the one that was this foot's at the start of the path."""
        self.path.curve.look[0] = self.path.toes[self.feet.index(foot)]
