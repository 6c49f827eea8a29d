"""From one section to the next: the planner's decision, and new plans after a disturbance.

The path is planned at a section, again where a foot has landed (:mod:`.planning.stride_path`), and
again when a disturbance has carried the robot away from it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import asked
from template_control.embedding.planners.planner import (
    BreakingPlanner,
    CurvePlanner,
    PricingPlanner,
)
from template_control.embedding.planning import choosing_again
from template_control.embedding.planning.breaking import find_break
from template_control.embedding.planning.reachable_angles import reachable_angles, reachable_turn
from template_control.embedding.planning.stride_path import StridePath
from template_control.embedding.section_report import Learnt
from template_control.embedding.sensing import Sensed
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.maps.section import Section
from template_control.slip.scenario.catching import BreakingRoute

Array = NDArray[np.float64]

_TOUCHDOWN = int(Event.TOUCHDOWN)


class StridePlanning(StridePath):
    """Decides at the sections, and plans again where the robot does not come along its path.

    Arguments and attributes are those of :class:`~.planning.stride_path.StridePath`.
    """

    _broken = False  # into the present stride
    _excess = 0.0  # speed at the stride's section less the wanted, and what came on top

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
        report, start, goes_on = self._planners.decide(section, z, now, learnt, self.reports)
        self.arrived = self.arrived or not goes_on
        self._broken = False
        self._excess = float(z[0] - report.goal.target[0])
        self.reports.append(report)
        node = self.automaton.start(report.goal.stride)
        state = sensed.state.copy()
        if start is not z:
            state[:4] = section.state(start, state[0])
        node = self._follow(node, state, sensed, now)
        if not report.decision.lasting and not self.arrived:
            return self._break(node, sensed, 0.0, now) or node
        return node

    def _break(self, node: Node, sensed: Sensed, phase_time: float, now: float) -> Node | None:
        """Break into another stride where the present one cannot go on.

        Arguments as for :meth:`reconsider`.

        Returns:
            The node that the robot is in then, with the path from there; None where the route
            knows no other stride, or the template does not complete it.
        """
        turn = reachable_turn(self.options, self.due(Event.TOUCHDOWN) - phase_time)
        found = find_break(self._rest, node, self.reports[-1], sensed, (self._excess, turn))
        if found is None or not isinstance(self.route, BreakingRoute):
            return None
        self.reports[-1] = found.report
        self._broken = True
        asked(self.route.take, found.goal)
        return self.follow(found.node, sensed, now)

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

        A path that leads nowhere is one as well, where the robot has broken into its stride, no
        stride went on, or the planner may find another way.

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
        return not self._whole and (self._broken or self._gave_up())

    def _gave_up(self) -> bool:
        """Whether no stride went on, or the planner knows what the next ones are worth.

        Such a planner may find another way. One along a curve is left to it.
        """
        if isinstance(self.planner, CurvePlanner):
            return False
        return not self.reports[-1].decision.feasible or isinstance(self.planner, PricingPlanner)

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
        rest, report = self._rest, self.reports[-1]
        if self._broken:
            other = self._break(node, sensed, phase_time, now)
            if other is not None:
                return other
            if not isinstance(self.planner, BreakingPlanner):
                self.hold(choosing_again.stiffnesses(rest, node, sensed, report))
            return self.follow(node, sensed, now)
        lasting = True
        if node.name != self.automaton.starts[report.goal.stride] or node.name in self.curved:
            self.hold(choosing_again.stiffnesses(rest, node, sensed, report))
        else:
            to_go = self.due(Event.TOUCHDOWN) - phase_time
            angles = reachable_angles(rest, node, sensed, report, to_go)
            decision = choosing_again.all_controls(rest, node, sensed, report, angles)
            self.hold(decision)
            lasting = decision is None or decision.lasting
        node = self.follow(node, sensed, now)
        if lasting and self._whole:
            return node
        return self._break(node, sensed, 0.0, now) or node
