"""What of a stride is chosen again between two sections.

Until a leg lands these are all its controls, from then on the stiffnesses of what is left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import Decision, PricingPlanner, decided, lands
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.planning.unexpected_ground import choose_legs
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.embedding.touchdown import flown_angle, free_controls
from template_control.slip.automaton.hybrid import Node

Array = NDArray[np.float64]


def all_controls(
    rest: RestOfStride,
    node: Node,
    sensed: Sensed,
    report: SectionReport,
    angles: tuple[float, float],
) -> Decision | None:
    """Decide anew at the section state from which the template would have come to here.

    Where no stride goes on from there, the gait's legs may have led to here from another one.

    Args:
        rest: of the present stride.
        node: of the automaton, the first one of a stride.
        sensed: the robot's state.
        report: of the present stride.
        angles: least and greatest touchdown angle that the swing foot can still reach [rad].

    Returns:
        None where the template cannot have come from a section.
    """
    planner = rest.planners.of(report.goal)

    def decide(so_far: Array) -> Decision | None:
        z = rest.back_to_section(node, so_far, sensed)
        return None if z is None else decided(planner.decide, z, report.goal.target, angles)

    decision = decide(report.decision.controls)
    if decision is not None and decision.feasible:
        return decision
    # The template would have flown or sunk with the legs so far; the robot's motors are weaker.
    other = decide(planner.gait.controls)
    return decision if other is None else other


def stiffnesses(
    rest: RestOfStride, node: Node, sensed: Sensed, report: SectionReport
) -> Decision | None:
    """Let the planner choose the stiffnesses that the rest of the stride depends on.

    Args:
        rest: of the present stride.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.

    Returns:
        None of a planner that has no ``land``.
    """
    planner = rest.planners.of(report.goal)
    if not lands(planner):
        return None
    free = free_controls(rest.automaton, node)
    ahead = rest.ahead(node, sensed)
    return decided(planner.land, ahead, report.decision, report.goal.target, free)


def landed(
    rest: RestOfStride, node: Node, sensed: Sensed, report: SectionReport
) -> Decision | None:
    """What is still free as a foot lands, chosen from where it did.

    Arguments as for :func:`stiffnesses`.

    Returns:
        None where what was decided holds on.
    """
    decision = stiffnesses(rest, node, sensed, report)
    if decision is not None:
        return decision
    angle = flown_angle(sensed, rest.planners.route.parameters)
    start = rest.automaton.start(report.goal.stride)
    return all_controls(rest, start, sensed, report, (angle, angle))


def landed_off(
    rest: RestOfStride, node: Node, sensed: Sensed, report: SectionReport, height: float
) -> Decision:
    """The stiffnesses after a foot has landed on ground that is higher or lower than was thought.

    Args:
        rest: of the present stride.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
        height: of the ground over the other foot's [m].
    """
    planner, options = rest.planners.of(report.goal), rest.planners.options.ground
    free = free_controls(rest.automaton, node)
    nominal, ahead = planner.gait.controls, rest.ahead(node, sensed)
    target = report.target[: len(report.goal.target)]
    # After a step up the end nearest to the gait is the best: three steps later the walk is
    # back. The cheapest one goes on with a stride of half the speed.
    price = planner.price if height < 0.0 and isinstance(planner, PricingPlanner) else None
    return choose_legs(ahead, report.decision, target, free, nominal, options, price)
