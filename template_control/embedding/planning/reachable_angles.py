"""Touchdown angles that a swing foot can still land with, once it is on its way."""

from __future__ import annotations

from template_control.embedding.planning.replan_options import ReplanOptions
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.embedding.touchdown import angle_later
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Event, Slot

_AT_ONCE = 2e-3  # [s] from its start: no path comes to an event at which it begins


def reachable_turn(options: ReplanOptions, time_to_go: float) -> float:
    """How far the swing foot can still change the touchdown angle [rad].

    Args:
        options: how fast it is.
        time_to_go: until the touchdown is due [s].
    """
    return options.agility * min(max(time_to_go, 0.0), options.foresight) ** 2


def reachable_angles(
    rest: RestOfStride, node: Node, sensed: Sensed, report: SectionReport, time_to_go: float
) -> tuple[float, float]:
    """Least and greatest touchdown angle that the swing foot can still land with [rad].

    Args:
        rest: of the present stride.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
        time_to_go: until the touchdown is due [s].
    """
    planners, u = rest.planners, report.decision.controls
    o = planners.options
    change, angle = reachable_turn(o, time_to_go), float(u[Slot.TOUCHDOWN_ANGLE])
    most = angle + change
    if node.rear is not None and node.edge(Event.TOUCHDOWN) is not None:
        step = planners.of(report.goal).gait.step_duration
        soonest = min(o.soonest, o.soonest_share * step)
        time = max(min(time_to_go, soonest), _AT_ONCE)
        stiffness = float(u[node.rear])
        most = min(most, angle_later(sensed, planners.route.parameters, stiffness, time))
    return min(angle - change, most), most
