"""Along the planner's curve; where the CoM cannot come to rest on it, a step is made instead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import CurvePlanner, decided
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.slip.automaton.automaton import STEP_OUT
from template_control.slip.dynamics.stride import Stride
from template_control.slip.maps.section import REST

Array = NDArray[np.float64]


def follow_curve(
    rest: RestOfStride, node: str, sensed: Sensed, state: Array, report: SectionReport
) -> tuple[SectionReport, Stride]:
    """The curve of the stride's planner from here, or else the first step that leads to rest.

    Args:
        rest: of the present stride.
        node: of the automaton, where a curve carries the robot.
        sensed: the robot, for its toes and the acceleration wanted so far.
        state: (4,) x, y, dx/dt, dy/dt.
        report: of the present stride.

    Returns:
        The report with what holds from now on, and the stride from here. Its first node is
        another one where a step is made instead.
    """
    planner = rest.planners.of(report.goal)
    decision, stride = rest.curve(node, sensed, state, planner, report.decision)
    if not decision.feasible:
        for kind in STEP_OUT.get(node, ()):
            other = rest.planners.planners.get(kind)
            if not isinstance(other, CurvePlanner):
                continue
            start = rest.automaton.starts[kind]
            first = decided(other.decide, REST.of(state))
            instead, step = rest.curve(start, sensed, state, other, first)
            if instead.feasible:
                goal = replace(report.goal, stride=kind)
                return replace(report, goal=goal, decision=instead), step
    return replace(report, decision=decision), stride
