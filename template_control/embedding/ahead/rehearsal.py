"""A route tried on the template first: whether all changes of speed that it wants can be had."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.ranges import Count, NotNegative
from template_control.embedding.ahead.planner import AheadPlanner
from template_control.errors import ScenarioError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.maps.section import VLO
from template_control.slip.scenario.route import Route
from template_control.slip.similarity import SPEED, Scale, scaled, tuned


@dataclass(frozen=True)
class RehearsalOptions(Checked):
    """What counts as having a speed.

    Attributes:
        behind: largest difference between the wanted and the accepted speed [m/s].
        strides: that are tried at most, of a route that does not end.
    """

    behind: NotNegative = tuned(0.08, SPEED)
    strides: Count = tuned(1000)


def rehearse(route: Route, planner: AheadPlanner, options: RehearsalOptions | None = None) -> None:
    """Walk a route on the template, and refuse it where the planner would reduce its changes.

    Args:
        route: of walking steps; it is reset before and after.
        planner: of these steps; it learns nothing.
        options: what counts as a reduction.

    Raises:
        ScenarioError: naming the first speed that cannot be had in time.
    """
    o = scaled(options or RehearsalOptions(), Scale.of(route.parameters))
    simulator = StrideSimulator(route.parameters, AUTOMATON)
    route.reset()
    z, now = np.array(route.start), 0.0
    for _ in range(o.strides):
        goal = route.next(VLO, z, now)
        if goal is None:
            break
        decision = planner.decide(z, goal.target)
        wanted = float(goal.target[0])
        accepted = wanted if decision.accepted is None else decision.accepted
        if not decision.feasible or abs(accepted - wanted) > o.behind:
            raise ScenarioError(
                f"segment {goal.segment + 1} wants {wanted:.3g} m/s at VLO {now:.1f} s after the"
                f" start, and {accepted:.3g} m/s can be had then: give a smaller acceleration or"
                " change of speed, or leave out --strict"
            )
        node = AUTOMATON.start(goal.stride).name
        stride = simulator.run(node, VLO.state(z), decision.controls)
        z, now = VLO.of(stride.state), now + stride.duration
    route.reset()
    planner.reset()
