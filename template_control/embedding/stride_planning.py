"""From one section to the next: the planner's decision, and the template's path that follows it.

The path is planned at a section, again where a foot has landed, and again when a disturbance
has carried the robot away from it.
"""

from __future__ import annotations

import time
from collections.abc import Set
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.fitting import check
from template_control.checks.ranges import NotNegative, Positive, Range, Share, Triple
from template_control.embedding.planners.planner import (
    Ahead,
    BreakingPlanner,
    CurvePlanner,
    Decision,
    Free,
    LandingPlanner,
    Planner,
    Planners,
)
from template_control.embedding.references.template_path import (
    Landing,
    PathOptions,
    TemplatePath,
    join,
)
from template_control.embedding.section_report import Learnt, SectionReport
from template_control.embedding.sensing import Sensed
from template_control.embedding.touchdown import flown_angle, free_controls
from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.breaking import RUN_ON
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event, Outcome, Slot
from template_control.slip.dynamics.stride import Stride, StrideSimulator
from template_control.slip.maps.section import Section, section_of
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.catching import BreakingRoute
from template_control.slip.scenario.route import Route, StrideGoal
from template_control.slip.similarity import RATE_SQUARED, SPEED, TIME, tuned

Array = NDArray[np.float64]

_TOUCHDOWN = int(Event.TOUCHDOWN)


@dataclass(frozen=True)
class ReplanOptions(Checked):
    """When a stride is planned anew between two sections, and from where.

    Attributes:
        speed: deviation of the forward speed from the path's [m/s].
        interval: shortest time between such plans [s].
        patience: a touchdown that is later than this [s] is not waited for on the same path.
        angle_drop: the touchdown angle is then taken to be lower by this [rad].
        agility: a touchdown in t seconds can still be planned anew with an angle that differs
            from the old one by this times t^2 [rad/s^2]; the swing foot cannot do more.
        foresight: t counts as this at most [s]; where no touchdown is due it has no bound.
        calmer: shares of dy/dt, tried in turn, of the states that a path starts from where the
            template cannot go on from the robot's: its leg cannot pull, the robot's can.
        highest: height over l0 above which no such path starts.
        path: how the robot's place on the path is looked for.
    """

    speed: Annotated[float, Range(0.0, endless=True)] = tuned(0.05, SPEED)
    interval: NotNegative = tuned(0.02, TIME)
    patience: Annotated[float, Range(0.0, endless=True)] = tuned(0.01, TIME)
    angle_drop: NotNegative = tuned(0.15)
    agility: NotNegative = tuned(8.0, RATE_SQUARED)
    foresight: NotNegative = tuned(1.0, TIME)
    calmer: tuple[Share, ...] = tuned((0.5, 0.0))
    highest: Positive = tuned(0.99)
    path: PathOptions = field(default_factory=PathOptions)


class StridePlanning:
    """Keeps the present stride's decision and the path the robot follows.

    Args:
        route: which stride comes next, and towards which state.
        planners: one for each kind of stride of the route.
        options: when to plan again.
        automaton: of the strides.
        curved: nodes in which the planner's curve is followed, not the template's springs.

    Attributes:
        reports: one a section, the start's included.
        path: the template's, from the last plan on.
        dues: time on the path at which each :class:`Event` comes next [s], inf if it does not.
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
        self.route = route
        self.planners = planners
        self.options = options
        self.automaton = automaton
        self.curved = curved
        self.parameters: SlipParameters = route.parameters
        self.reports: list[SectionReport] = []
        self.path: TemplatePath
        self.dues = [np.inf] * NUM_EVENTS
        self.reaching = False
        self.arrived = False
        self._planned_at = 0.0
        self._whole = True
        self._broken = False
        self._excess = 0.0  # speed at the stride's section less the wanted, and what came on top
        self._passed = 0  # so many of the path's events are over
        self._feet = (0, 1)  # rear and front leg's at the start of the path
        self._simulator = StrideSimulator(route.parameters, automaton)

    def begin(self, section: Section) -> tuple[Planner, Node]:
        """Planner and first node of the stride that the route begins with, at ``section``.

        Everything of an earlier run is forgotten.

        Raises:
            ParameterError: if the route is empty, or there is no planner for that stride.
        """
        self.route.reset()
        for planner in self.planners.values():
            planner.reset()
        self.reports.clear()
        self.arrived = False
        goal = self.first_goal()
        return self.planner_of(goal), self.automaton.start(goal.stride)

    def first_goal(self) -> StrideGoal:
        """The stride that the route begins with.

        Raises:
            ParameterError: if the route is empty.
        """
        goal = self.route.ahead(self.route.section, self.route.start, 0.0)
        if goal is None:
            raise ParameterError("the route ends where it begins: give one with a stride")
        return goal

    @property
    def planner(self) -> Planner:
        """The planner of the present stride."""
        return self.planner_of(self.reports[-1].goal)

    def planner_of(self, goal: StrideGoal) -> Planner:
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

    def decide(self, section: Section, sensed: Sensed, now: float, learnt: Learnt) -> Node:
        """At a section: learn from the stride that ended, choose the next one's controls.

        Args:
            section: that was reached.
            sensed: the robot's state.
            now: time [s].
            learnt: what the controller has learnt, for the report.

        Returns:
            The node that the stride begins in.
        """
        z = section.of(sensed.state)
        begin = time.perf_counter()
        if self.reports:
            last = self.reports[-1]
            self.planner_of(last.goal).observe(last.decision, z)
        goal = self.route.next(section, z, now)
        if goal is None:
            # The last stride goes on until whoever drives the robot ends the run.
            self.arrived, goal = True, self.reports[-1].goal
        self._broken = False
        self._excess = float(z[0] - goal.target[0])
        decision, start = self._plan(section, z, goal)
        seconds = time.perf_counter() - begin
        node = self.automaton.start(goal.stride)
        end = section_of(self.automaton.sections(node.name)[1])
        self.reports.append(
            SectionReport(
                time=now,
                section=section,
                state=section.padded(z),
                goal=goal,
                target=end.padded(goal.target),
                decision=decision,
                offset=check("the planner's offset", self.planner_of(goal).offset, Triple).copy(),
                learnt=learnt,
                plan_seconds=seconds,
            )
        )
        state = sensed.state.copy()
        if start is not z:
            state[:4] = section.state(start, state[0])
        self._follow(node, state, sensed, now)
        if not decision.lasting and not self.arrived:
            return self._break(node, sensed, 0.0, now)
        return node

    def _plan(self, section: Section, z: Array, goal: StrideGoal) -> tuple[Decision, Array]:
        """A decision at ``z``, and the section state from which its path starts.

        The template's leg ends at l0, cannot pull, and pushes as its spring does; the robot's
        need not. Where the template would leave the ground or come to no second stride, the
        path starts from a state that does, and the robot is let down or pushed up to it.
        """
        o, planner = self.options, self.planner_of(goal)
        decision = planner.decide(z, goal.target)
        if decision.lasting:
            return decision, z
        for share in o.calmer:
            start = section.calmer(z, share, o.highest * self.parameters.rest_length)
            calmer = planner.decide(start, goal.target)
            if calmer.lasting:
                return replace(calmer, feasible=decision.feasible, nominal=False), start
        return decision, z

    def follow(self, node: Node, sensed: Sensed, now: float, angle_drop: float = 0.0) -> None:
        """Template path from here to the touchdown after the next section.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            now: time [s].
            angle_drop: how much lower the touchdown angle is than decided [rad].
        """
        self._follow(node, sensed.state, sensed, now, angle_drop)

    def _follow(
        self, node: Node, state: Array, sensed: Sensed, now: float, angle_drop: float = 0.0
    ) -> None:
        toes = (float(sensed.toes[0]), float(sensed.toes[1]))
        report = self.reports[-1]
        u = report.decision.controls.copy()
        u[Slot.TOUCHDOWN_ANGLE] -= angle_drop
        self.reaching = angle_drop > 0.0
        start = node.name
        if start in self.curved:
            first = self._curve(start, state, toes, sensed)
        else:
            first = self._simulator.run(start, state, u, toes)
        strides = [first]
        self._whole = True
        # The next foothold must be known when the swing begins, before the next section. Where
        # no foot stands, the second one's is still further.
        more = 1 if node.stance or node.name in self.automaton.starts.values() else 2
        at = now
        while more and strides[-1].completed:
            last = strides[-1]
            at += last.duration
            section = section_of(self.automaton.sections(start)[1])
            z = section.of(last.state)
            goal = self.route.ahead(section, z, at) or report.goal
            ahead = self.planner_of(goal).decide(z, goal.target)
            self._whole = self._whole and ahead.lasting
            start = self.automaton.start(goal.stride).name
            if start in self.curved:
                break  # both feet stand: there is no foothold to know
            toes = (float(last.toes[0]), float(last.toes[1]))
            strides.append(self._simulator.run(start, last.state, ahead.controls, toes))
            more -= 1
        self._whole = self._whole and all(stride.completed for stride in strides)
        self.path = join(strides, self.options.path)
        self._feet = sensed.feet
        self._planned_at = now
        self._look_ahead(0)

    def _curve(self, node: str, state: Array, toes: tuple[float, float], sensed: Sensed) -> Stride:
        """The planner's curve from here; what it decides on the way holds from now on.

        Raises:
            ParameterError: if the planner has none.
        """
        report, planner = self.reports[-1], self.planner
        if not isinstance(planner, CurvePlanner):
            raise ParameterError(
                f"{type(planner).__name__} plans no curve for node {node}: give it a method curve"
            )
        start = np.column_stack((state[:2], state[2:4], sensed.acceleration))
        decision, stride = planner.curve(node, start, toes, report.decision)
        self.reports[-1] = replace(report, decision=decision)
        return stride

    def land(self, node: Node, sensed: Sensed, now: float) -> None:
        """A foot has landed: choose again what is still free, from where it did.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
            now: time [s].
        """
        report, planner = self.reports[-1], self.planner
        if isinstance(planner, LandingPlanner):
            self._choose_again(planner, node, sensed)
        else:
            z = self._back_to_section(self.automaton.start(report.goal.stride), report, sensed)
            if z is not None:
                angle = flown_angle(sensed, self.parameters)
                decision = planner.decide(z, report.goal.target, (angle, angle))
                self.reports[-1] = replace(report, decision=decision)
        self.follow(node, sensed, now)

    def _choose_again(self, planner: LandingPlanner, node: Node, sensed: Sensed) -> None:
        """Let the planner choose the stiffnesses that the rest of the stride depends on."""
        report = self.reports[-1]
        free = free_controls(self.automaton, node)
        ahead = self._ahead(node, sensed)
        decision = planner.land(ahead, report.decision, report.goal.target, free)
        self.reports[-1] = replace(report, decision=decision)

    def _ahead(self, node: Node, sensed: Sensed) -> Ahead:
        """Where the present stride ends from here, by its controls."""
        toes = (float(sensed.toes[0]), float(sensed.toes[1]))
        state = sensed.state.copy()
        end = section_of(self.automaton.sections(node.name)[1])

        def ahead(u: Array) -> tuple[Array, Outcome]:
            stride = self._simulator.run(node.name, state, u, toes)
            return end.of(stride.state), stride.outcome

        return ahead

    def _break(self, node: Node, sensed: Sensed, phase_time: float, now: float) -> Node:
        """Break into another stride where the present one cannot go on.

        Arguments as for :meth:`reconsider`.

        Returns:
            The node that the robot is in then, with the path from there; ``node`` where the route
            knows no other stride, or the template does not complete it.
        """
        report, route = self.reports[-1], self.route
        if not isinstance(route, BreakingRoute):
            return node
        goal = route.instead(report.goal, float(sensed.state[2]), self._excess)
        if goal is None:
            return node
        planner, name = self.planner_of(goal), node.name
        if goal.stride != report.goal.stride:
            name = RUN_ON.get(name, "")
        if name not in self.automaton.index or not isinstance(planner, BreakingPlanner):
            return node
        other = self.automaton.node(name)
        slots = free_controls(self.automaton, other)
        if other.edge(Event.TOUCHDOWN) is not None:
            slots = [int(Slot.TOUCHDOWN_ANGLE), *slots]
        free = Free(slots, self._turn(phase_time))
        ahead = self._ahead(other, sensed)
        decision = planner.break_into(ahead, report.decision.controls, goal.target, free)
        if not decision.feasible:
            return node
        target = section_of(self.automaton.sections(name)[1]).padded(goal.target)
        self.reports[-1] = replace(report, goal=goal, target=target, decision=decision)
        self._broken = True
        route.take(goal)
        self.follow(other, sensed, now)
        return other

    def _turn(self, phase_time: float) -> float:
        """How far the swing foot can still change the touchdown angle [rad]."""
        left = max(self.due(Event.TOUCHDOWN) - phase_time, 0.0)
        return self.options.agility * min(left, self.options.foresight) ** 2

    def due(self, event: Event) -> float:
        """Time on the path at which ``event`` comes next [s], inf if it does not."""
        return self.dues[event]

    def pass_event(self, event: Event) -> None:
        """The robot has fired ``event``."""
        self._look_ahead(self.path.after(event, self._passed))

    def _look_ahead(self, passed: int) -> None:
        """So many of the path's events are over: note when each comes next."""
        self._passed = passed
        self.dues = [self.path.due(event, passed) for event in Event]

    def landing(self, foot: int) -> Landing:
        """Where and when on the path a foot next touches down."""
        return self.path.landings[self._feet.index(foot)]

    @property
    def toe(self) -> float:
        """x of the template's rear toe [m]."""
        return float(self.path.curve.look[0])

    def stand_on(self, foot: int) -> None:
        """The template's rear toe is now the one that was this foot's at the start of the path."""
        self.path.curve.look[0] = self.path.toes[self._feet.index(foot)]

    def overdue(self, node: Node, phase_time: float) -> bool:
        """Whether the swing foot should have found the ground by now.

        Args:
            node: of the automaton, the robot's.
            phase_time: time along the path [s].
        """
        late = phase_time > self.dues[_TOUCHDOWN] + self.options.patience
        return late and not self.reaching and node.edge(Event.TOUCHDOWN) is not None

    def reach_on(self, node: Node, sensed: Sensed, now: float) -> None:
        """The ground is lower than was thought: the template goes on without a touchdown.

        Arguments as for :meth:`follow`.
        """
        self.follow(node, sensed, now, self.options.angle_drop)

    def surprised(self, deviation: float, phase_time: float, now: float) -> bool:
        """Whether a disturbance has carried the robot away from its path.

        Where the robot has broken into a stride, a path that leads nowhere is one as well.

        Args:
            deviation: of the forward speed from the path's [m/s].
            phase_time: time along the path [s].
            now: time [s].
        """
        o = self.options
        if self.reaching or now - self._planned_at <= o.interval:
            return False
        if abs(deviation) > o.speed and phase_time > o.interval:
            self._excess += deviation
            return True
        return self._broken and not self._whole

    def reconsider(self, node: Node, sensed: Sensed, phase_time: float, now: float) -> Node:
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
        report, planner = self.reports[-1], self.planner
        if self._broken:
            other = self._break(node, sensed, phase_time, now)
            if self._planned_at < now:
                self.follow(node, sensed, now)
            return other
        lasting = True
        starts = node.name == self.automaton.starts[report.goal.stride]
        if starts and node.name not in self.curved:
            z = self._back_to_section(node, report, sensed)
            if z is not None:
                change = self._turn(phase_time)
                angle = float(report.decision.controls[Slot.TOUCHDOWN_ANGLE])
                decision = planner.decide(z, report.goal.target, (angle - change, angle + change))
                self.reports[-1] = replace(report, decision=decision)
                lasting = decision.lasting
        elif isinstance(planner, LandingPlanner):
            self._choose_again(planner, node, sensed)
        self.follow(node, sensed, now)
        return node if lasting and self._whole else self._break(node, sensed, 0.0, now)

    def _back_to_section(self, node: Node, report: SectionReport, sensed: Sensed) -> Array | None:
        """The section state from which the template would have come to where the robot is.

        The template's dynamics are the same forward and backward: its past is the mirror
        image of the future of the mirrored state.
        """
        x, y, dx, dy = sensed.state
        before = self.automaton.before(node.name)
        u = report.decision.controls.copy()
        if before.rear is not None and node.rear is not None:
            u[before.rear] = u[node.rear]
        mirrored = [sensed.toes[0] - x, y, dx, -dy]
        past = self._simulator.run(before.name, mirrored, u)
        if not past.completed:
            return None
        return report.section.mirror(report.section.of(past.state))
