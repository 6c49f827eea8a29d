"""Decisions of a route's planners at the sections, and the template's strides from there."""

from __future__ import annotations

import time
from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from math import inf, isnan
from typing import Annotated, Any

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.fitting import asked, check, name_of, shown
from template_control.checks.ranges import NotNegative, Range, Shape, Triple
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    Planner,
    Planners,
    curved,
    decided,
)
from template_control.embedding.recovery import Recovery
from template_control.embedding.state import EstimatorState, SectionReport, TemplateState
from template_control.errors import ParameterError
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.control.stride_solver import StrideEnd, rest
from template_control.slip.dynamics.stride import Stride, StrideSimulator
from template_control.slip.maps.return_map import new_workspace
from template_control.slip.maps.section import Section, section_of
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, StrideGoal
from template_control.slip.similarity import SPEED, TIME, Scale, tuned


@dataclass(frozen=True)
class ReplanOptions(Checked):
    """Conditions of a new plan between two sections.

    Attributes:
        speed: deviation of the forward speed from the path's [m/s].
        interval: shortest time between such plans [s].
        patience: a touchdown that is later than this [s] is not waited for on the same path.
    """

    speed: Annotated[float, Range(0.0, endless=True)] = tuned(0.05, SPEED)
    interval: NotNegative = tuned(0.02, TIME)
    patience: Annotated[float, Range(0.0, endless=True)] = tuned(0.01, TIME)


# Shares of dy/dt, tried in turn, of the states that a path starts from where the template cannot
# go on from the robot's: its leg cannot pull, the robot's can.
_CALMER = (0.5, 0.0)
_HIGHEST = 0.99  # of l0: above this height no such path starts
HEIGHT_ERROR = 0.008
"""Height of the ground under the foot that has landed over that under the other one, from which on
it is unexpected [m], for the reference template."""
_TARGETS = {size: Annotated[Array, Shape((size,))] for size in (2, 3)}


@dataclass(frozen=True)
class RoutePlanners:
    """Decisions at the sections of a route; its walks may break into a recovery's strides."""

    route: Route
    planners: Planners
    automaton: Automaton
    recovery: Recovery

    def reset(self) -> None:
        """Forget an earlier run."""
        asked(self.route.reset)
        self.recovery.reset()
        for planner in self.planners.values():
            asked(planner.reset)

    def first_goal(self) -> StrideGoal:
        """The stride that the route begins with; a ParameterError if the route is empty."""
        goal = self.ahead(self.route.section, self.route.start, 0.0)
        if goal is None:
            raise ParameterError("the route ends where it begins: give one with a stride")
        return goal

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """The stride that begins: a recovery's, or the route's; None where the route ends.

        ``z`` (n,) is the state at the section, at the time ``now`` [s]. A ParameterError names the
        route's class, if it asks for no stride that there is.
        """
        goal = self.recovery.goal(section, z)
        if goal is None:
            goal = self._goal(self.route.next, section, z, now)
            self.recovery.follow(goal)
        return goal

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """Goal that :meth:`next` would return here; neither the route nor the recovery goes on."""
        return self.recovery.goal(section, z) or self._goal(self.route.ahead, section, z, now)

    def beyond(self, goal: StrideGoal, section: Section) -> StrideGoal:
        """Goal of a stride from ``section`` after the route's end, which ``goal`` leads to.

        That is the same stride again; after one from gait to gait, the stride that follows it.
        """
        if self._sections(goal.stride)[0] is section or goal.then is None:
            return goal
        return replace(goal, stride=goal.then, then=None)

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
        size = self._sections(goal.stride)[1].dimension
        check(f"{name_of(method)}: the target", goal.target, _TARGETS[size])
        return goal

    def _sections(self, stride: str) -> tuple[Section, Section]:
        """Sections at which a kind of stride begins and ends."""
        begin, end = self.automaton.sections(self.automaton.starts[stride])
        return section_of(begin), section_of(end)

    def of(self, goal: StrideGoal) -> Planner:
        """The planner of a goal's stride; a ParameterError if there is none."""
        if goal.stride not in self.planners:
            raise ParameterError(
                f"the route asks for a stride {goal.stride!r}, and there are planners for"
                f" {', '.join(self.planners)}: give one for it too, or another route"
            )
        return self.planners[goal.stride]

    def decide(
        self,
        section: Section,
        question: Context,
        now: float,
        estimators: EstimatorState,
        last: SectionReport | None,
        reached: Array | None = None,
    ) -> tuple[SectionReport, Array, bool]:
        """Learn from the stride that ended, ask the route for the next one, and plan it.

        ``question`` has the state z (n,) at the section that was reached, at the time ``now`` [s];
        ``estimators`` are for the report, ``last`` is that of the stride that ended, None at the
        start, and ``reached`` (n,) the state in that stride's axes, None: z. Returns what was
        decided, the section state from which its path starts, and whether the route goes on.
        """
        begin, z = time.perf_counter(), question.z
        if last is not None:
            asked(self.of(last.goal).observe, last.decision, z if reached is None else reached)
        wanted = self.next(section, z, now)
        # Strides go on until the loop that drives the robot ends the run.
        goal = wanted or (self.first_goal() if last is None else self.beyond(last.goal, section))
        planner = self.of(goal)
        if last is not None and last.goal.stride != goal.stride:
            asked(planner.forget)
        decision, start = self.plan(section, question, goal)
        instead = None if decision.feasible else self._instead(goal)
        if instead is not None:
            goal, planner = instead, self.of(instead)
            decision, start = self.plan(section, question, goal)
        report = SectionReport(
            time=now,
            section=section,
            state=section.padded(z),
            goal=goal,
            target=self.padded_target(goal),
            decision=decision,
            offset=check(f"{type(planner).__name__}.offset", planner.offset, Triple).copy(),
            estimators=estimators,
            plan_seconds=time.perf_counter() - begin,
        )
        return report, start, wanted is not None

    def _instead(self, goal: StrideGoal) -> StrideGoal | None:
        """The stride after one that cannot be made, where it begins at the same section.

        A stride to another speed, say, is left out: the walk goes on. None: there is no such.
        """
        if goal.then is None or goal.then == goal.stride or goal.then not in self.planners:
            return None
        begin, end = self._sections(goal.stride)
        same = begin is end and self._sections(goal.then) == (begin, end)
        return replace(goal, stride=goal.then, then=None) if same else None

    def padded_target(self, goal: StrideGoal) -> Array:
        """(3,) dx/dt, y, dy/dt where a goal leads to."""
        return self._sections(goal.stride)[1].padded(goal.target)

    def plan(self, section: Section, question: Context, goal: StrideGoal) -> tuple[Decision, Array]:
        """A decision towards a goal, and the section state from which its path starts.

        The template's leg ends at l0, cannot pull, and pushes as its spring does; the robot's need
        not. Where the template would leave the ground or come to no second stride, the path starts
        from a state that does, and the robot is let down or pushed up to it.
        """
        planner, z = self.of(goal), question.z
        question = question._replace(target=goal.target)
        decision = decided(planner, question)
        if decision.lasting:
            return decision, z
        for share in _CALMER:
            start = section.damped(z, share, _HIGHEST * self.route.parameters.rest_length)
            damped = decided(planner, question._replace(z=start))
            if damped.lasting:  # from there; from here a run may be the better way
                feasible = decision.feasible
                return replace(damped, feasible=feasible, lasting=False, nominal=False), start
        return decision, z


class TemplateRollout:
    """Strides of the template from the robot's state.

    In ``curved`` nodes the planner's curve is followed, not the template's springs. ``scale`` are
    the template's units, by which tuned numbers are multiplied; ``height_error`` is that of the
    ground under a foot that has landed, from which on it is unexpected [m]. ``ground`` is the
    template on its present ground, ``simulator`` runs it.
    """

    def __init__(self, planners: RoutePlanners, curved: Set[str]) -> None:
        self.planners, self.automaton, self.curved = planners, planners.automaton, curved
        self._level = self.ground = planners.route.parameters
        self.scale = Scale.of(self.ground)
        self.height_error = HEIGHT_ERROR * self.scale.length
        self.simulator = self._mirrored = StrideSimulator(self.ground, self.automaton)
        self._work = new_workspace()

    def set_ground(self, ground: SlipParameters) -> bool:
        """Run the template on ground of this slope and assist; True if it is other ground."""
        p = replace(self._level, slope=ground.slope, assist=ground.assist)
        if p == self.ground:
            return False
        self.ground, self.simulator = p, StrideSimulator(p, self.automaton)
        # Uphill is downhill for one who walks back.
        self._mirrored = StrideSimulator(replace(p, slope=-p.slope), self.automaton)
        return True

    def curve(
        self, node: str, sensed: TemplateState, state: Array, planner: Planner, decision: Decision
    ) -> tuple[Decision, Stride]:
        """The planner's curve from here; what it decides on the way holds from now on.

        A curve carries the robot in ``node``; ``sensed`` has the toes and the acceleration wanted
        so far; ``state`` (4,) is x, y, dx/dt, dy/dt. A ParameterError if the planner has none.
        """
        start = np.column_stack((state[:2], state[2:4], sensed.acceleration))
        rear, front = sensed.toes.tolist()
        return curved(planner, node, start, (rear, front), decision)

    def strides(
        self, node: Node, first: Stride, goal: StrideGoal, now: float
    ) -> tuple[list[Stride], bool]:
        """A stride and those after it whose footholds must be known.

        The next foothold must be known when the swing begins, before the next section. Where no
        foot stands, the second one's is still further. ``first``, in ``node``, begins at the time
        ``now`` [s]; ``goal`` is its own. Also returns whether the template completes them all and
        lasts.
        """
        strides, whole, start, at, then = [first], True, node.name, now, goal
        more = 1 if node.stance or node.name in self.automaton.starts.values() else 2
        while more and strides[-1].completed:
            last = strides[-1]
            at += last.duration
            section = section_of(self.automaton.sections(start)[1])
            z = section.of(last.state)
            then = self.planners.ahead(section, z, at) or self.planners.beyond(then, section)
            swung = last.duration - last.time_of(Event.REAR_LIFTOFF)
            lifted = inf if isnan(swung) else swung
            context = Context(z, then.target, cause=Cause.FUTURE, lifted=lifted)
            ahead = decided(self.planners.of(then), context)
            whole = whole and ahead.lasting
            start = self.automaton.start(then.stride).name
            if start in self.curved:
                break  # both feet stand: there is no foothold to know
            strides.append(self.simulator.run(start, last.state, ahead.controls, last.toes))
            more -= 1
        return strides, whole and all(stride.completed for stride in strides)

    def ahead(self, node: Node, sensed: TemplateState) -> StrideEnd:
        """End of the present stride from here, by its controls."""
        return rest(self.simulator, node.name, sensed.state, sensed.toes, self._work)

    def at_section(self, section: Section, sensed: TemplateState, last: SectionReport) -> Array:
        """(n,) section state that the template passes through, a little before or after it.

        Axes that turn about the foot move a CoM that is next to it along them. The legs are those
        of the ``last`` stride; where they do not lead to the section, it is the state as it is.
        """
        here = section.of(sensed.state)
        nodes = self.automaton.stride(self.automaton.starts[last.goal.stride])
        node = next(node for node in nodes if node.edge(section.event) is not None)
        x, y, dx, dy = sensed.state.tolist()
        ahead = x - float(sensed.toes[0])
        if not node.stance:
            return here
        past = ahead > 0.0
        simulator, dy = (self._mirrored, -dy) if past else (self.simulator, dy)
        stride = simulator.run(node.name, [-abs(ahead), y, dx, dy], last.decision.controls)
        if not stride.completed:
            return here
        there = section.of(stride.state)
        return section.mirror(there) if past else there

    def backward_to_section(
        self, node: Node, controls: Array, sensed: TemplateState
    ) -> Array | None:
        """The section state from which the template would have come to where the robot is.

        The template's dynamics are the same forward and backward: its past is the mirror image of
        the future of the mirrored state. ``controls`` (NUM_SLOTS,) are those of the stride so far.
        None where the template cannot have come from there.
        """
        x, y, dx, dy = sensed.state.tolist()
        before = self.automaton.before(node.name)
        u = controls.copy()
        if before.rear is not None and node.rear is not None:
            u[before.rear] = u[node.rear]
        mirrored = [float(sensed.toes[0]) - x, y, dx, -dy]
        past = self._mirrored.run(before.name, mirrored, u)
        if not past.completed:
            return None
        section = section_of(self.automaton.sections(before.name)[1])
        return section.mirror(section.of(past.state))
