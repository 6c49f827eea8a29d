"""Supervision of a stride: decision at its section, the template's path, new plans on the way.

The path is planned at a section, again where a foot has landed, and again when a disturbance has
carried the robot away from it.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from math import hypot
from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.checks.fitting import answered_or_none
from template_control.embedding import replanning
from template_control.embedding.planned_path import KEPT, PATH, plan_is_due
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    Planner,
    Planners,
    settled,
)
from template_control.embedding.recovery import Recovery
from template_control.embedding.replanning import Situation
from template_control.embedding.rollout import ReplanOptions, RoutePlanners, TemplateRollout
from template_control.embedding.standing.planners import STEPS, CurvePlanner
from template_control.embedding.state import EstimatorState, SectionReport, TemplateState
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import Event, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride
from template_control.slip.maps.section import Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.path import TemplatePath, join
from template_control.slip.planning.catching import CatchingStep
from template_control.slip.scenario.route import Route, StrideGoal
from template_control.structured import Number

_BARELY_BEYOND, _JUST_BEYOND = 1.002, 1.01
"""Lengths of a leg over l0 up to which a path that begins lets it go at once: any, and one that
extends slowly. One further out that extends fast is being pushed off: where it was let go
(1.005, half of sqrt(g l0)), `five-link`'s trunk turned over in the flight of a walk that broke into
a run. Solo12's slow legs (up to 1.009, 0.2 of sqrt(g l0)) stayed down with 2 % of the weight, and
it fell.
"""
_SLOW = 0.3  # extension of a leg over sqrt(g l0)


class StrideSupervisor:
    """Supervisor of a stride.

    In ``curved`` nodes the planner's curve is followed, not the template's springs; ``recovery`` is
    what a walk that cannot go on breaks into, None: nothing. ``data`` (1,), of ``PATH``, is where
    ticks follow the path.

    Attributes:
        goal, decision: of the present stride, as they are from now on.
        log: one report for each stride that has ended.
        path: the template's, from the last plan on.
        feet: that were the rear and the front leg's where the path starts.
        arrived: the route has ended.
        height_error: of the ground under a foot that has landed, from which on it is unexpected
            [m].
    """

    phase_time, planned_at = Number("time"), Number("planned_at")
    without_touchdown, _viable = Number("without_touchdown"), Number("viable")
    goal: StrideGoal
    decision: Decision
    path: TemplatePath

    def __init__(
        self,
        route: Route,
        planners: Planners,
        options: ReplanOptions,
        automaton: Automaton = AUTOMATON,
        curved: Set[str] = frozenset(),
        recovery: Recovery | None = None,
        data: Any = None,
    ) -> None:
        self.route, self.planners = route, planners
        self.automaton, self.curved = automaton, curved
        self.parameters: SlipParameters = route.parameters
        self.data = np.zeros(1, PATH) if data is None else data
        for name in ("patience", "interval", "speed"):
            self.data[name] = getattr(options, name)
        self._body: Array = self.data["body"][0]
        self._body[[0, 3]] = self.parameters.mass, self.parameters.rest_length
        self._event_times: Array = self.data["event_times"][0]
        self._event_times[:] = np.inf
        self._viable = True
        self.log: list[SectionReport] = []
        self.feet = (0, 1)
        self.arrived = False
        self._begun: SectionReport | None = None  # the present stride, as it was decided first
        self._passed = 0  # so many of the path's events are over
        self._recovering = False  # into the present stride
        self._knows_slopes = False  # the present stride's planner
        # Speed at the stride's section less the wanted, and what came on top.
        self._speed_excess = 0.0
        self._recovery = recovery
        breaks = recovery or Recovery(self.parameters)  # into nothing, as nothing is taken
        self._planners = RoutePlanners(route, planners, automaton, breaks)
        self._rollout = TemplateRollout(self._planners, curved)
        self.height_error = self._rollout.height_error

    def begin(self, section: Section) -> tuple[Planner, Node]:
        """Planner and first node of the stride that the route begins with, at ``section``.

        Everything of an earlier run is forgotten. A ParameterError if the route is empty, or there
        is no planner for that stride.
        """
        self._planners.reset()
        self._stand_on(self.parameters)
        self.log.clear()
        self._begun = None
        self.arrived = False
        self.goal = self.first_goal()
        return self.planner, self.automaton.start(self.goal.stride)

    def first_goal(self) -> StrideGoal:
        """The stride that the route begins with; a ParameterError if the route is empty."""
        return self._planners.first_goal()

    @property
    def planner(self) -> Planner:
        """The planner of the present stride."""
        return self._planners.of(self.goal)

    @property
    def reports(self) -> list[SectionReport]:
        """One report a section, the start's included and the present stride's last."""
        if self._begun is None:
            return []
        target = self._planners.padded_target(self.goal)
        now = replace(self._begun, goal=self.goal, target=target, decision=self.decision)
        return [*self.log, now]

    @property
    def begun_at(self) -> float:
        """Time at which the present stride was decided first [s]."""
        return 0.0 if self._begun is None else self._begun.time

    @property
    def _along_curve(self) -> bool:
        """True if a curve carries the present stride, at least in part."""
        nodes = self.automaton.stride(self.automaton.starts[self.goal.stride])
        return any(node.name in self.curved for node in nodes)

    def decide(
        self,
        section: Section,
        sensed: TemplateState,
        now: float,
        estimators: EstimatorState,
        reached: Array | None = None,
    ) -> Node:
        """At a section: learn from the stride that ended, choose the next one; its first node.

        ``estimators`` are for the report. Where the axes have turned at the section, ``reached``
        (n,) is the state before, from which is learnt.
        """
        z = section.of(sensed.state)
        ended = self.reports
        last = ended[-1] if ended else None
        if last is not None and reached is not None:
            z = self._rollout.at_section(section, sensed, last)
        foot, path = sensed.feet[1], self.data[0]
        due = np.inf if last is None else float(path["landing_time"][foot] - path["time"])
        question = Context(z, lifted=float(sensed.swung[foot]), due=due)
        report, start, goes_on = self._planners.decide(
            section, question, now, estimators, last, reached
        )
        self.log = ended
        self._begun, self.goal, self.decision = report, report.goal, report.decision
        self.arrived = self.arrived or not goes_on
        self._recovering = False
        self._speed_excess = float(z[0] - report.goal.target[0])
        node = self.automaton.start(report.goal.stride)
        state = sensed.state.copy()
        if start is not z:
            state[:4] = section.state(start, state[0])
        node = self.follow(node, sensed, now, state=state)
        next_to = reached is not None and report.decision.feasible
        if next_to and not self.path.strides[0].completed:
            # It leads on from the section, and does not from the robot, which is next to it.
            return self.replan(Cause.NO_FUTURE, node, sensed, now)
        if not report.decision.lasting and not self.arrived:
            return self._recover(self._situation(node, sensed), now) or node
        return node

    def surprise(self, node: Node, deviation: float, phase_time: float, now: float) -> Cause | None:
        """Cause to plan again, if there is one: see :func:`.plan_is_due`.

        Of a path that leads nowhere it is none, unless the robot has broken into its stride, no
        stride went on, or the planner may find another way.
        """
        lands = node.edge(Event.TOUCHDOWN) is not None
        due = plan_is_due(self.data[0], lands, deviation, phase_time, now)
        if due == KEPT:
            return None
        cause = Cause(due)
        if cause is Cause.DEVIATION:
            self._speed_excess += deviation
        if cause is Cause.NO_FUTURE and not self._recovering:
            goes_on = self.decision.feasible and self.path.strides[0].completed
            retries = self.planner.retries or not goes_on
            if self._along_curve or not retries:  # a curve is left to its planner
                return None
        return cause

    def replan(
        self,
        cause: Cause,
        node: Node,
        sensed: TemplateState,
        now: float,
        *,
        phase_time: float = 0.0,
        height_error: float = 0.0,
    ) -> Node:
        """Plan again from here, as the table of causes says; the node that the robot is in then.

        ``phase_time`` is along the path [s]; ``height_error`` is of the ground under a foot that
        has landed over the other foot's [m].
        """
        rule, s = replanning.RULES[cause], self._situation(node, sensed, phase_time)
        s = s._replace(cause=cause, height_error=height_error)
        if self._recovering and rule.recovers:
            other = self._recover(s, now)
            if other is not None:
                return other
            # A stride on the springs keeps what was chosen as the robot broke into it.
            if self._along_curve:
                self.decision = replanning.choose_rest(self._rollout, s) or self.decision
            return self.follow(node, sensed, now)
        decision = rule.choose(self._rollout, s)
        self.decision = decision or self.decision
        node = self.follow(node, sensed, now, angle_drop=rule.angle_drop)
        lasts = not s.whole or decision is None or decision.lasting
        if not rule.recovers or (lasts and self._viable):
            return node
        return self._recover(self._situation(node, sensed), now) or node

    def _situation(self, node: Node, sensed: TemplateState, phase_time: float = 0.0) -> Situation:
        begins = node.name == self.automaton.starts[self.goal.stride]
        whole = begins and node.name not in self.curved
        to_go = self.time_of(Event.TOUCHDOWN) - phase_time
        return Situation(node, sensed, self.goal, self.decision, whole, to_go)

    def _recover(self, s: Situation, now: float) -> Node | None:
        """Break into another stride, if the template completes one; the robot's node in it."""
        if self._recovery is None:
            return None
        found = replanning.find_recovery(self._rollout, s, self._recovery, self._speed_excess)
        if found is None:
            return None
        self.goal, self.decision = found.goal, found.decision
        self._recovering = True
        return self.follow(found.node, s.sensed, now)

    def on_slope(self, slope: float) -> float:
        """Plan for another slope [rad] from now on; the slope that is planned for.

        That is 0 by a planner that knows none, or where no gait is.
        """
        # All of them: the strides ahead may be others' than the present one.
        answers = {
            kind: answered_or_none(SlipParameters, planner.on_slope, slope)
            for kind, planner in self.planners.items()
        }
        answer = answers[self.goal.stride]
        self._knows_slopes = answer is not None
        ground = answer or self.parameters
        if self._along_curve and ground.slope:
            # No spring carries along a curve, but in the strides after it.
            assists = (other.assist for other in answers.values() if other is not None)
            ground = replace(ground, assist=next(filter(None, assists), 0.0))
        if self._stand_on(ground):
            self.decision = replace(self.decision, nominal=False)
        return ground.slope

    def _stand_on(self, ground: SlipParameters) -> bool:
        """Let the template's ground be this one from now on; whether it was another."""
        changes = self._rollout.set_ground(ground)
        self._body[1:3], self._body[4] = self.ground.gravity_parts, self.ground.assist
        return changes

    @property
    def ground(self) -> SlipParameters:
        """The template on its present ground."""
        return self._rollout.ground

    def choose_assist(self, node: Node, sensed: TemplateState) -> None:
        """Choose the assist of a double stance that begins on ground that was not expected.

        The assist is a slope's: it is left to planners of slopes.
        """
        if self._knows_slopes and not self._along_curve:
            replanning.choose_assist(self._rollout, self._situation(node, sensed))
            self._stand_on(self.ground)

    def follow(
        self,
        node: Node,
        sensed: TemplateState,
        now: float,
        *,
        state: Array | None = None,
        angle_drop: float = 0.0,
    ) -> Node:
        """Follow the template from here to the touchdown after the next section; the node now.

        That is of another stride where a curve led to no rest. ``state`` (4,) is the template's
        where it is not the robot's; ``angle_drop`` is how much lower the touchdown angle is than
        decided [rad].
        """
        u, state = self.decision.controls, sensed.state if state is None else state
        if angle_drop:
            u = u.copy()
            u[Slot.TOUCHDOWN_ANGLE] -= angle_drop
        self.without_touchdown = angle_drop > 0.0
        if node.name in self.curved:
            s = Situation(node, sensed, self.goal, self.decision)
            self.goal, self.decision, first = replanning.curve_or_step(self._rollout, s, state)
            node = self.automaton.node(first.start)
        else:
            first = self._rollout.simulator.run(node.name, state, u, sensed.toes)
        return self._take(node, first, state, sensed, now)

    def step(
        self, node: Node, catching: CatchingStep | None, sensed: TemplateState, now: float
    ) -> Node | None:
        """Make a step to a stand, if a planner makes it; the node that it begins in.

        ``catching`` is one that catches the robot; None: the planner's own, forward.
        """
        kind, begins = self.goal.stride, node.name
        if len(node.stance) > 1:
            ahead = catching is None or catching.foot == sensed.feet[0]
            kind = StrideKind.STEP_FORWARD if ahead else StrideKind.STEP_BACK
            begins = self.automaton.starts[kind]
        planner = self.planners.get(kind)
        if kind not in STEPS or not isinstance(planner, CurvePlanner):
            return None
        start = np.column_stack((sensed.state[:2], sensed.state[2:4], sensed.acceleration))
        toes = float(sensed.toes[0]), float(sensed.toes[1])
        self.decision, first = planner.curve(begins, start, toes, settled(planner.gait), catching)
        self.goal = replace(self.goal, stride=kind, target=planner.gait.state)
        self.without_touchdown = False
        return self._take(self.automaton.node(first.start), first, sensed.state, sensed, now)

    def _take(
        self, node: Node, first: Stride, state: Array, sensed: TemplateState, now: float
    ) -> Node:
        strides, self._viable = self._rollout.strides(node, first, self.goal, now)
        self.path, self.feet = join(strides, self._rollout.scale.time), sensed.feet
        gait, data = self.planner.gait, self.data[0]
        data["time"], data["offset"], data["fresh"] = 0.0, 0.0, 1
        for foot, landing in zip(self.feet, self.path.landings, strict=True):
            data["landing_x"][foot], data["landing_time"][foot] = landing
        data["touchdown_angle"] = self.decision.controls[Slot.TOUCHDOWN_ANGLE]
        data["step_length"], data["step_duration"] = gait.step_length, gait.step_duration
        data["toe"], data["planned_at"] = self.path.toes[0], now
        self._look_ahead(0)
        if self._lets_go(node, state, sensed):
            # On the path that leg pulls, which the template's cannot, and comes back to l0 later.
            self._event_times[Event.REAR_LIFTOFF] = 0.0
        return node

    def _lets_go(self, node: Node, state: Array, sensed: TemplateState) -> bool:
        """True if the rear leg is just beyond l0, on springs, and is to lift off."""
        edge, p = node.edge(Event.REAR_LIFTOFF), self.parameters
        if edge is None or edge.target not in self.automaton.index or node.name in self.curved:
            return False
        ahead, height, *speed = state[0] - sensed.toes[0], *state[1:]
        length = hypot(ahead, height)
        extends = (ahead * speed[0] + height * speed[1]) / length
        most = _JUST_BEYOND if extends < _SLOW * p.speed_unit else _BARELY_BEYOND
        return 1.0 < length / p.rest_length < most

    def time_of(self, event: Event) -> float:
        """Time on the path at which ``event`` comes next [s], inf if it does not."""
        return float(self._event_times[event])

    def pass_event(self, event: Event) -> None:
        """The robot has fired ``event``."""
        self._look_ahead(self.path.after(event, self._passed))

    def _look_ahead(self, passed: int) -> None:
        """So many of the path's events are over: note when each comes next."""
        self._passed = passed
        self._event_times[:] = self.path.event_times(passed)

    def set_rear_toe(self, foot: int) -> None:
        """The template's rear toe is now the one that was this foot's at the start of the path."""
        self.path.curve.look[0] = self.data["toe"] = self.path.toes[self.feet.index(foot)]
