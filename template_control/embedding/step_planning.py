"""From one VLO to the next: the planner's decision, and the template's path that follows it.

The path is planned at VLO, again where a foot has landed, and again when a disturbance has
carried the robot away from it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.guards import Sensed
from template_control.embedding.plan import Plan, chain
from template_control.embedding.planners.planner import Decision, Planner
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Event, Slot
from template_control.slip.dynamics.stride import StrideSimulator

Array = NDArray[np.float64]

_CALMER = (0.5, 0.0)  # of dy/dt, tried in turn
_TOP = 0.99  # of l0: no higher may the path start then

VLO_STATE = [2, 1, 3]
"""dx/dt, y, dy/dt of a state x, y, dx/dt, dy/dt."""


@dataclass(frozen=True)
class ReplanOptions:
    """When a step is planned anew between two sections.

    Attributes:
        speed: deviation of the (momentum-based) forward speed from the plan's [m/s].
        interval: shortest time between such plans [s].
        patience: a touchdown that is later than this [s] is not waited for on the same path.
        reach: the touchdown angle is then taken to be lower by this [rad].
        agility: a touchdown in t seconds can still be planned anew with an angle that differs
            from the old one by this times t^2 [rad/s^2]; the swing foot cannot do more.
    """

    speed: float = 0.05
    interval: float = 0.02
    patience: float = 0.01
    reach: float = 0.15
    agility: float = 8.0


@dataclass(frozen=True)
class StepReport:
    """What the controller knew and chose at a VLO.

    Attributes:
        time: of the VLO [s].
        state: (3,) dx/dt (angular-momentum based), y, dy/dt.
        decision: the planner's choice for the step that begins.
        offset: (3,) the planner's offset estimate.
        load: the load factor.
        trim: the momentum trim [m/s^2].
        plan_seconds: wall-clock time of the plan.
    """

    time: float
    state: Array
    decision: Decision
    offset: Array
    load: float
    trim: float
    plan_seconds: float


class StepPlanning:
    """Keeps the present step's decision and the path the robot follows.

    Args:
        planner: chooses each step's controls and owns the gait.
        options: when to plan again.

    Attributes:
        steps: one report a VLO, the start's included.
        path: the template's, from the last plan on.
        toe: x of the rear toe the path's phase is measured from [m].
        reaching: the swing foot is overdue, and the path goes on without it.
    """

    def __init__(self, planner: Planner, options: ReplanOptions) -> None:
        self.planner = planner
        self.options = options
        self.parameters = planner.gait.parameters
        self.steps: list[StepReport] = []
        self.path: Plan
        self.toe = 0.0
        self.reaching = False
        self._planned_at = 0.0
        self._template = StrideSimulator(self.parameters)

    def decide(self, node: Node, sensed: Sensed, now: float, load: float, trim: float) -> None:
        """At VLO: learn from the step that ended, choose the next one's controls.

        Args:
            node: of the automaton, where the step begins.
            sensed: the robot's state.
            now: time [s].
            load, trim: what the controller has learnt, for the report.
        """
        z = sensed.state[VLO_STATE].copy()
        begin = time.perf_counter()
        if self.steps:
            self.planner.observe(self.steps[-1].decision, z)
        decision, start = self._plan(z)
        seconds = time.perf_counter() - begin
        offset = self.planner.offset.copy()
        self.steps.append(StepReport(now, z, decision, offset, load, trim, seconds))
        self.follow(node, sensed, now, start=start)

    def _plan(self, z: Array) -> tuple[Decision, Array]:
        """A decision at ``z`` (3,), and the VLO state (3,) from which its path starts.

        The template's leg ends at l0, cannot pull, and pushes as its spring does; the robot's
        need not. Where the template would leave the ground or come to no second step, the path
        starts from a state that does, and the robot is let down or pushed up to it.
        """
        decision = self.planner.decide(z)
        if decision.lasting:
            return decision, z
        for share in _CALMER:
            height = min(z[1], _TOP * self.parameters.rest_length)
            start = np.array([z[0], height, share * z[2]])
            calmer = self.planner.decide(start)
            if calmer.lasting:
                return replace(calmer, feasible=decision.feasible, reached=False), start
        return decision, z

    def follow(
        self,
        node: Node,
        sensed: Sensed,
        now: float,
        reach: float = 0.0,
        start: Array | None = None,
    ) -> None:
        """Template path from here to the touchdown after the next VLO.

        Args:
            node, sensed, now: see :meth:`decide`.
            reach: how much lower the touchdown angle is than decided [rad].
            start: (3,) dx/dt, y, dy/dt to start from; None for the robot's.
        """
        state = sensed.state
        if start is not None:
            state = np.array([state[0], start[1], start[0], start[2]])
        toes = (float(sensed.toes[0]), float(sensed.toes[1]))
        u = self.steps[-1].decision.controls.copy()
        u[Slot.TOUCHDOWN_ANGLE] -= reach
        self.reaching = reach > 0.0
        first = self._template.run(node.name, state, u, toes)
        strides = [first]
        if first.completed:
            # The next foothold must be known when the swing begins, before the next VLO.
            ahead = self.planner.decide(first.state[VLO_STATE])
            strides.append(self._template.run(first.node, first.state, ahead.controls, first.toes))
        self.path = chain(strides)
        self.toe = toes[0]
        self._planned_at = now

    def overdue(self, node: Node, phase_time: float) -> bool:
        """Whether the swing foot should have found the ground by now.

        Args:
            node: of the automaton, the robot's.
            phase_time: time along the path [s].
        """
        awaited = any(edge.event is Event.TOUCHDOWN for edge in node.edges)
        late = phase_time > self.path.touchdown + self.options.patience
        return awaited and late and not self.reaching

    def reach_on(self, node: Node, sensed: Sensed, now: float) -> None:
        """The ground is lower than was thought: the template stays in single stance."""
        self.follow(node, sensed, now, self.options.reach)

    def surprised(self, deviation: float, phase_time: float, now: float) -> bool:
        """Whether a disturbance has carried the robot away from its path.

        Args:
            deviation: of the forward speed from the path's [m/s].
            phase_time: time along the path [s].
            now: time [s].
        """
        o = self.options
        return (
            not self.reaching
            and abs(deviation) > o.speed
            and phase_time > o.interval
            and now - self._planned_at > o.interval
        )

    def reconsider(self, node: Node, sensed: Sensed, phase_time: float, now: float) -> None:
        """Plan again from here; before touchdown the step's controls are still free."""
        if node.name == STRIDE_START["w"]:
            z = self._back_to_vlo(sensed)
            if z is not None:
                left = max(self.path.touchdown - phase_time, 0.0)
                change = self.options.agility * min(left, 1.0) ** 2
                angle = float(self.steps[-1].decision.controls[Slot.TOUCHDOWN_ANGLE])
                decision = self.planner.decide(z, (angle - change, angle + change))
                self.steps[-1] = replace(self.steps[-1], decision=decision)
        self.follow(node, sensed, now)

    def _back_to_vlo(self, sensed: Sensed) -> Array | None:
        """The VLO state from which the template would have come to where the robot is.

        The template's dynamics are the same forward and backward: its past is the mirror
        image of the future of the mirrored state.
        """
        x, y, dx, dy = sensed.state
        u = self.steps[-1].decision.controls.copy()
        u[Slot.K_SD] = u[Slot.K_SC]
        before_vlo = AUTOMATON.node("SS_bv^w").name
        mirrored = [sensed.toes[0] - x, y, dx, -dy]
        past = self._template.run(before_vlo, mirrored, u)
        return past.state[VLO_STATE] * [1.0, 1.0, -1.0] if past.completed else None
