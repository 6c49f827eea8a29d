"""The template's strides through where the robot is: onward, and back to the section before."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import (
    Ahead,
    CurvePlanner,
    Decision,
    Planner,
    curved,
    decided,
)
from template_control.embedding.planning.route_planners import RoutePlanners
from template_control.embedding.sensing import Sensed
from template_control.errors import ParameterError
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.dynamics.stride import Stride, StrideSimulator
from template_control.slip.maps.section import section_of
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import StrideGoal

Array = NDArray[np.float64]


class RestOfStride:
    """Runs the template from the robot's state.

    Args:
        planners: of the route.
        automaton: of the strides.
        curved: nodes in which the planner's curve is followed, not the template's springs.
    """

    def __init__(self, planners: RoutePlanners, automaton: Automaton, curved: Set[str]) -> None:
        self.planners = planners
        self.automaton = automaton
        self.curved = curved
        self._parameters = planners.route.parameters
        self._simulator = self._mirrored = StrideSimulator(self._parameters, automaton)

    def stand_on(self, ground: SlipParameters) -> bool:
        """Run the template on other ground.

        Args:
            ground: whose slope and assist count.

        Returns:
            Whether it is other ground.
        """
        p = replace(self._parameters, slope=ground.slope, assist=ground.assist)
        if p == self._simulator.parameters:
            return False
        self._simulator = StrideSimulator(p, self.automaton)
        # Uphill is downhill for one who walks back.
        self._mirrored = StrideSimulator(replace(p, slope=-p.slope), self.automaton)
        return True

    @property
    def ground(self) -> SlipParameters:
        """The template on its present ground."""
        return self._simulator.parameters

    def onward(self, node: str, sensed: Sensed, state: Array, u: Array) -> Stride:
        """The template's stride from ``node`` on.

        Args:
            node: of the automaton, where its springs carry it.
            sensed: the robot, for its toes.
            state: (4,) x, y, dx/dt, dy/dt.
            u: controls by Slot.
        """
        return self._simulator.run(node, state, u, _toes(sensed))

    def curve(
        self, node: str, sensed: Sensed, state: Array, planner: Planner, decision: Decision
    ) -> tuple[Decision, Stride]:
        """The planner's curve from here; what it decides on the way holds from now on.

        Args:
            node: of the automaton, where a curve carries the robot.
            sensed: the robot, for its toes and the acceleration wanted so far.
            state: (4,) x, y, dx/dt, dy/dt.
            planner: of the stride.
            decision: what holds so far.

        Raises:
            ParameterError: if the planner has none.
        """
        if not isinstance(planner, CurvePlanner):
            raise ParameterError(
                f"{type(planner).__name__} plans no curve for node {node}: give it a method curve"
            )
        start = np.column_stack((state[:2], state[2:4], sensed.acceleration))
        return curved(planner.curve, node, start, _toes(sensed), decision)

    def strides(
        self, node: Node, first: Stride, goal: StrideGoal, now: float
    ) -> tuple[list[Stride], bool]:
        """A stride and those after it whose footholds must be known.

        The next foothold must be known when the swing begins, before the next section. Where
        no foot stands, the second one's is still further.

        Args:
            node: that the first stride begins in.
            first: the first stride.
            goal: of strides after the route's end.
            now: time at which the first stride begins [s].

        Returns:
            The strides, and whether the template completes them all and lasts.
        """
        strides, whole, start, at = [first], True, node.name, now
        more = 1 if node.stance or node.name in self.automaton.starts.values() else 2
        while more and strides[-1].completed:
            last = strides[-1]
            at += last.duration
            section = section_of(self.automaton.sections(start)[1])
            z = section.of(last.state)
            then = self.planners.ahead(section, z, at) or goal
            ahead = decided(self.planners.of(then).decide, z, then.target)
            whole = whole and ahead.lasting
            start = self.automaton.start(then.stride).name
            if start in self.curved:
                break  # both feet stand: there is no foothold to know
            toes = (float(last.toes[0]), float(last.toes[1]))
            strides.append(self._simulator.run(start, last.state, ahead.controls, toes))
            more -= 1
        return strides, whole and all(stride.completed for stride in strides)

    def ahead(self, node: Node, sensed: Sensed) -> Ahead:
        """Where the present stride ends from here, by its controls.

        Args:
            node: of the automaton, the robot's.
            sensed: the robot's state.
        """
        toes, state = _toes(sensed), sensed.state.copy()
        end = section_of(self.automaton.sections(node.name)[1])

        def ahead(u: Array) -> tuple[Array, Outcome]:
            stride = self._simulator.run(node.name, state, u, toes)
            return end.of(stride.state), stride.outcome

        return ahead

    def back_to_section(self, node: Node, controls: Array, sensed: Sensed) -> Array | None:
        """The section state from which the template would have come to where the robot is.

        The template's dynamics are the same forward and backward: its past is the mirror
        image of the future of the mirrored state.

        Args:
            node: of the automaton, the robot's.
            controls: (NUM_SLOTS,) that the stride so far had.
            sensed: the robot's state.

        Returns:
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


def _toes(sensed: Sensed) -> tuple[float, float]:
    return float(sensed.toes[0]), float(sensed.toes[1])
