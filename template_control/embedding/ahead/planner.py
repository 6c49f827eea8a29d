"""The planner that looks several steps ahead, and reduces what cannot be had."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.checks.ranges import Positive
from template_control.embedding.ahead.gait_row import (
    CONTROLS,
    DURATION,
    LENGTH,
    STATE,
    STIFFNESS,
    WIDTH,
    GaitTable,
)
from template_control.embedding.ahead.gait_table import (
    COLUMNS,
    SLOTS,
    STRIDE,
    control_tolerance,
    gait_table,
    row_at,
)
from template_control.embedding.ahead.look_ahead import look_ahead
from template_control.embedding.ahead.options import AheadOptions
from template_control.embedding.ahead.prospect import Aim, Plan, Prospect, Workspace
from template_control.embedding.planners.planner import ANY_ANGLE, Decision
from template_control.embedding.planners.walking.lqr import LqrPlanner
from template_control.embedding.planners.walking.walk_kernels import WALK
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.gait import WalkingGait, with_push_off
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, scaled
from template_control.warm_up import Part, ready

Array = NDArray[np.float64]

_STANDARD = SlipParameters()


class AheadPlanner:
    """Plans several steps at once towards a gait of the family by speed, any at any time.

    A governor tries shares of the wanted change of speed and takes the first whose plan is cheap.
    What it takes is told as :attr:`~.planner.Decision.accepted`. Where no plan is cheap, as after
    a push, the LQR planner's search finds a step to a gait near the present speed.

    Args:
        parameters: the template; its stiffness k0 counts for nothing, each gait has its own.
        options: tuning.
        speed: dx/dt at VLO of the gait that it is asked for first [m/s]; None: the range's middle.

    Attributes:
        options: scaled to the template.
        table: the gaits.
    """

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        options: AheadOptions | None = None,
        speed: Positive | None = None,
    ) -> None:
        ready((*WALK, *AHEAD))
        o = self.options = scaled(options or AheadOptions(), Scale.of(parameters))
        self.parameters = parameters
        self.table: GaitTable = gait_table(parameters, o)
        self._prospect = prospect(parameters, o, self.table)
        self._work = Workspace(new_scratch(), new_scratch(complex))
        self._plan = Plan(
            np.empty((o.steps + 1, PADDED)), np.empty((o.steps, CONTROLS)), np.empty(WIDTH)
        )
        self._first = float(np.clip(speed or np.mean(self.speeds), *self.speeds))
        self._speed = self._first
        self._lqr = LqrPlanner(self.gait, o.lqr)

    @property
    def speeds(self) -> tuple[float, float]:
        """Slowest and fastest dx/dt at VLO [m/s]."""
        return float(self.table.speed[0]), float(self.table.speed[-1])

    @property
    def gait(self) -> WalkingGait:
        """The gait that the last plan led to."""
        row = row_at(self.table, self._speed)
        k = float(row[STIFFNESS])
        own = replace(self.parameters, leg_stiffness=k)
        u = controls(float(row[STATE + PADDED]), k, k)
        z, length, duration = row[STATE : STATE + PADDED], float(row[LENGTH]), float(row[DURATION])
        return with_push_off(WalkingGait("walk", own, z.copy(), u, length, duration))

    @property
    def offset(self) -> Array:
        """(3,) estimate of the robot's VLO state less the template's after one step."""
        return self._lqr.offset

    def __repr__(self) -> str:
        low, high = self.speeds
        return f"<AheadPlanner of {self.options.steps} steps, {low:.3g} to {high:.3g} m/s at VLO>"

    def reset(self) -> None:
        """See :class:`~.planner.Planner`."""
        self._speed = self._first
        self._lqr.reset()

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :meth:`~.planner.Planner.decide`; of the target the speed counts.

        The decision is nominal where a plan was cheap, whatever was accepted.
        """
        wanted = self._speed if target is None else float(target[0])
        low, high = self.speeds
        present = min(max(float(z[0]), low), high)
        pace, cheapest = self.options.pace, (np.inf, present)
        change = min(max(min(max(wanted, low), high) - present, -pace), pace)
        for share in self.options.shares:
            speed = present + share * change
            cost = self._look(z, speed, angles)
            if cost <= self.options.cheap:
                return self._decision(speed, wanted, True)
            cheapest = min(cheapest, (cost, speed))
        return self._otherwise(z, wanted, cheapest, angles)

    def _look(self, z: Array, speed: float, angles: tuple[float, float]) -> float:
        aim = Aim(speed, self.offset, (float(angles[0]), float(angles[1])))
        return float(look_ahead(self._prospect, self._work, z, aim, self._plan))

    def _decision(self, speed: float, wanted: float, nominal: bool) -> Decision:
        """The first step of the last plan."""
        self._speed = speed
        u = np.zeros(NUM_SLOTS)
        u[SLOTS] = self._plan.controls[0]
        u[SLOTS[1:]] *= self._plan.row[STIFFNESS]
        accepted = None if speed == wanted else speed
        return Decision(u, self._plan.states[1].copy(), True, True, nominal, accepted)

    def _otherwise(
        self, z: Array, wanted: float, cheapest: tuple[float, float], angles: tuple[float, float]
    ) -> Decision:
        """A step where no plan is cheap: the search's, or the cheapest plan's if that is better."""
        spacing = self.options.spacing
        low, high = self.speeds
        speed = min(max(spacing * round(float(z[0]) / spacing), low), high)
        decision = self._lqr.decide(z, np.array([speed, 0.0, 0.0]), angles)
        cost, near = cheapest
        if decision.lasting or not np.isfinite(cost):
            self._speed = float(self._lqr.gait.vlo[0])
            return replace(decision, nominal=False, accepted=self._speed)
        self._look(z, near, angles)
        return self._decision(near, wanted, False)

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal steps change the offset."""
        self._lqr.observe(decision, z)


def prospect(parameters: SlipParameters, o: AheadOptions, table: GaitTable) -> Prospect:
    """What the compiled plans read.

    Args:
        parameters: the template.
        o: tuning, scaled to it.
        table: its gaits.
    """
    softest, stiffest = o.lqr.stiffness_range
    lowest, highest = o.lqr.angle_range
    others = CONTROLS - 1
    return Prospect(
        kernel=stride_kernel(parameters, STRIDE),
        table=table,
        tolerance=np.array(o.tolerance),
        control_tolerance=control_tolerance(o),
        rise=(o.rise, o.rise_tolerance),
        bounds=np.array([[lowest, *[softest] * others], [highest, *[stiffest] * others]]),
        top_margin=o.lqr.top_margin,
        rounds=o.rounds,
        done=o.done,
        slots=SLOTS,
        columns=COLUMNS,
    )


def plan_ahead() -> None:
    """The compiled plan, so that a helper process can compile it."""
    options = AheadOptions(rounds=1)
    row = np.ones((1, WIDTH))
    known = prospect(_STANDARD, options, GaitTable(np.ones(1), row))
    plan = Plan(np.empty((2, PADDED)), np.empty((1, CONTROLS)), np.empty(WIDTH))
    aim = Aim(1.0, np.zeros(PADDED), ANY_ANGLE)
    work = Workspace(new_scratch(), new_scratch(complex))
    look_ahead(known, work, np.ones(PADDED), aim, plan)


AHEAD = (Part(plan_ahead, 10.0),)
"""What this planner calls, further than a walk."""
