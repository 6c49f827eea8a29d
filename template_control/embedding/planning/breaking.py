"""Breaking into another stride where the present one cannot go on."""

from __future__ import annotations

from dataclasses import dataclass, replace

from template_control.embedding.planners.planner import BreakingPlanner, Free
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.embedding.touchdown import free_controls
from template_control.slip.automaton.breaking import RUN_ON
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Event, Slot
from template_control.slip.maps.section import section_of
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
    goal = route.instead(report.goal, float(sensed.state[2]), excess)
    if goal is None:
        return None
    planner, name = rest.planners.of(goal), node.name
    if goal.stride != report.goal.stride:
        name = RUN_ON.get(name, "")
    if name not in automaton.index or not isinstance(planner, BreakingPlanner):
        return None
    other = automaton.node(name)
    slots = free_controls(automaton, other)
    if other.edge(Event.TOUCHDOWN) is not None:
        slots = [int(Slot.TOUCHDOWN_ANGLE), *slots]
    ahead = rest.ahead(other, sensed)
    decision = planner.break_into(ahead, report.decision.controls, goal.target, Free(slots, turn))
    if not decision.feasible:
        return None
    target = section_of(automaton.sections(name)[1]).padded(goal.target)
    return Break(other, goal, replace(report, goal=goal, target=target, decision=decision))
