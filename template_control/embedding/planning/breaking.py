"""Breaking into another stride where the present one cannot go on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from template_control.checks.fitting import asked
from template_control.embedding.planners.planner import BreakingPlanner, Decision, Free, decided
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.embedding.touchdown import free_controls
from template_control.slip.automaton.automaton import BREAKS
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot
from template_control.slip.maps.section import REST, section_of
from template_control.slip.scenario.catching import BreakingRoute
from template_control.slip.scenario.route import StrideGoal


@dataclass(frozen=True)
class Break:
    """A stride that the robot breaks into.

    Attributes:
        node: that the robot is in then.
        goal: the stride.
        report: of the present section, with this stride in it.
    """

    node: Node
    goal: StrideGoal
    report: SectionReport


def find_break(
    rest: RestOfStride, node: Node, report: SectionReport, sensed: Sensed, gap: tuple[float, float]
) -> Break | None:
    """Another stride from here.

    Args:
        rest: of the present stride.
        node: of the automaton, the robot's.
        report: of the present stride.
        sensed: the robot's state.
        gap: how far off the robot's speed is [m/s], and how far the touchdown angle can still be
            changed [rad].

    Returns:
        None where the route knows no other stride, or the template does not complete it.
    """
    route, automaton = rest.planners.route, rest.automaton
    excess, turn = gap
    if not isinstance(route, BreakingRoute):
        return None
    for goal in asked(route.instead, report.goal, float(sensed.state[2]), excess):
        name = node.name
        if goal.stride != report.goal.stride:
            name = BREAKS.get(goal.stride, {}).get(name, "")
        if name not in automaton.index or goal.stride not in rest.planners.planners:
            continue
        end = section_of(automaton.sections(name)[1])
        if end is REST and _goes_on(rest, node, report, sensed):
            continue  # a stand is for a walk that gets no further
        other = automaton.node(name)
        decision = _decision(rest, other, replace(report, goal=goal), sensed, turn)
        if decision is not None and decision.feasible:
            target = end.padded(goal.target)
            return Break(other, goal, replace(report, goal=goal, target=target, decision=decision))
    return None


def _goes_on(rest: RestOfStride, node: Node, report: SectionReport, sensed: Sensed) -> bool:
    """Whether the template completes the present stride from here, with these legs or others."""
    ahead, u = rest.ahead(node, sensed), report.decision.controls
    legs = [u]
    free = free_controls(rest.automaton, node)
    for share in rest.planners.options.legs:
        other = u.copy()
        other[free] = share * rest.ground.leg_stiffness
        legs.append(other)
    return any(ahead(other)[1] is Outcome.SECTION for other in legs)


def _decision(
    rest: RestOfStride, node: Node, report: SectionReport, sensed: Sensed, turn: float
) -> Decision | None:
    """What is decided where the goal of ``report`` begins at ``node``; None by no such planner.

    Its decision is the one of the stride that is left.
    """
    goal, present = report.goal, report.decision
    planner = rest.planners.of(goal)
    if node.name in rest.curved:
        return _along_curve(rest, node, sensed, goal, present)
    if not isinstance(planner, BreakingPlanner):
        return None
    slots = free_controls(rest.automaton, node)
    if node.edge(Event.TOUCHDOWN) is not None:
        slots = [int(Slot.TOUCHDOWN_ANGLE), *slots]
    ahead = rest.ahead(node, sensed)
    free = Free(slots, turn)
    return decided(planner.break_into, ahead, present.controls, goal.target, free)


def _along_curve(
    rest: RestOfStride, node: Node, sensed: Sensed, goal: StrideGoal, present: Decision
) -> Decision:
    """What the planner of ``goal`` decides where a curve leads from here to its section."""
    wanted = section_of(rest.automaton.sections(node.name)[1]).padded(goal.target)
    u = np.zeros(NUM_SLOTS)
    begun = replace(present, predicted=wanted, nominal=False, controls=u)
    planner = rest.planners.of(goal)
    decision, stride = rest.curve(node.name, sensed, sensed.state, planner, begun)
    return replace(decision, feasible=decision.feasible and stride.completed, lasting=True)
