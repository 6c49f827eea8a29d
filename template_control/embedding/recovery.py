"""Recovery: another stride where the present one cannot go on, a step where no curve rests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import asked
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    RestContext,
    decided,
    rest_decided,
)
from template_control.embedding.replanning import free_controls
from template_control.embedding.rollout import TemplateRollout
from template_control.embedding.state import SectionReport, TemplateState
from template_control.slip.automaton.automaton import BREAKS, STEP_OUT
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot
from template_control.slip.dynamics.stride import Stride
from template_control.slip.maps.section import REST, section_of
from template_control.slip.scenario.catching import BreakingRoute
from template_control.slip.scenario.route import StrideGoal

Array = NDArray[np.float64]


# Stiffnesses over k0 with which a slow walk is tried before the robot comes to a stand.
_LEGS = (0.4, 0.6, 0.8, 1.1)


def find_recovery(
    rollout: TemplateRollout,
    node: Node,
    report: SectionReport,
    sensed: TemplateState,
    *,
    excess: float,
    turn: float,
) -> tuple[Node, SectionReport] | None:
    """Another stride from here.

    Args:
        rollout: of the present stride.
        node: of the automaton, the robot's.
        report: of the present stride.
        sensed: the robot's state.
        excess: how far off the robot's speed is [m/s].
        turn: how far the touchdown angle can still be changed [rad].

    Returns:
        The node that the robot is in then, and the report with the new stride in it; None where
        the route knows no other stride, or the template does not complete it.
    """
    route, automaton = rollout.planners.route, rollout.automaton
    if not isinstance(route, BreakingRoute):
        return None
    for goal in asked(route.instead, report.goal, float(sensed.state[2]), excess):
        name = node.name
        if goal.stride != report.goal.stride:
            name = BREAKS.get(goal.stride, {}).get(name, "")
        if name not in automaton.index or goal.stride not in rollout.planners.planners:
            continue
        end = section_of(automaton.sections(name)[1])
        if end is REST and _goes_on(rollout, node, report, sensed):
            continue  # a stand is for a walk that gets no further
        other = automaton.node(name)
        decision = _decision(rollout, other, replace(report, goal=goal), sensed, turn)
        if decision is not None and decision.feasible:
            target = end.padded(goal.target)
            asked(route.take, goal)
            return other, replace(report, goal=goal, target=target, decision=decision)
    return None


def _goes_on(
    rollout: TemplateRollout, node: Node, report: SectionReport, sensed: TemplateState
) -> bool:
    """Whether the template completes the present stride from here, with these legs or others."""
    ahead, u = rollout.ahead(node, sensed), report.decision.controls
    legs = [u]
    free = free_controls(rollout.automaton, node)
    for share in _LEGS:
        other = u.copy()
        other[free] = share * rollout.ground.leg_stiffness
        legs.append(other)
    return any(ahead(other)[1] is Outcome.SECTION for other in legs)


def _decision(
    rollout: TemplateRollout, node: Node, report: SectionReport, sensed: TemplateState, turn: float
) -> Decision | None:
    """Decision where the goal of ``report`` begins at ``node``; None by a planner that has none.

    Its decision is the one of the stride that is left.
    """
    goal, present = report.goal, report.decision
    planner = rollout.planners.of(goal)
    if node.name in rollout.curved:
        return _along_curve(rollout, node, sensed, goal, present)
    slots = free_controls(rollout.automaton, node)
    if node.edge(Event.TOUCHDOWN) is not None:
        slots = [int(Slot.TOUCHDOWN_ANGLE), *slots]
    ahead = rollout.ahead(node, sensed)
    context = RestContext(ahead, present, goal.target, slots, turn, Cause.NO_FUTURE)
    return rest_decided(planner, context)


def _along_curve(
    rollout: TemplateRollout, node: Node, sensed: TemplateState, goal: StrideGoal, present: Decision
) -> Decision:
    """Decision of ``goal``'s planner where a curve leads from here to its section."""
    wanted = section_of(rollout.automaton.sections(node.name)[1]).padded(goal.target)
    u = np.zeros(NUM_SLOTS)
    begun = replace(present, predicted=wanted, nominal=False, controls=u)
    planner = rollout.planners.of(goal)
    decision, stride = rollout.curve(node.name, sensed, sensed.state, planner, begun)
    return replace(decision, feasible=decision.feasible and stride.completed, lasting=True)


def curve_or_step(
    rollout: TemplateRollout, node: str, sensed: TemplateState, state: Array, report: SectionReport
) -> tuple[SectionReport, Stride]:
    """The curve of the stride's planner from here, or else the first step that leads to rest.

    Args:
        rollout: of the present stride.
        node: of the automaton, where a curve carries the robot.
        sensed: the robot, for its toes and the acceleration wanted so far.
        state: (4,) x, y, dx/dt, dy/dt.
        report: of the present stride.

    Returns:
        The report with what holds from now on, and the stride from here. Its first node is
        another one where a step is made instead.
    """
    planner = rollout.planners.of(report.goal)
    decision, stride = rollout.curve(node, sensed, state, planner, report.decision)
    if not decision.feasible:
        for kind in STEP_OUT.get(node, ()):
            other = rollout.planners.planners.get(kind)
            if other is None:
                continue
            start = rollout.automaton.starts[kind]
            first = decided(other.decide, Context(REST.of(state), cause=Cause.NO_FUTURE))
            instead, step = rollout.curve(start, sensed, state, other, first)
            if instead.feasible:
                goal = replace(report.goal, stride=kind)
                return replace(report, goal=goal, decision=instead), step
    return replace(report, decision=decision), stride
