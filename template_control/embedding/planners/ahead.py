"""Planner of walking steps that looks several steps ahead, and reduces what cannot be had."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive, Range
from template_control.embedding.planners.gait_table import (
    COLUMNS,
    SLOTS,
    STATE,
    STATE_TOLERANCE,
    STEP_DURATION,
    STEP_LENGTH,
    STIFFNESS,
    STRIDE,
    WIDTH,
    GaitTable,
    gait_table,
    row_at,
)
from template_control.embedding.planners.look_ahead import (
    PlanProblem,
    PlanTarget,
    look_ahead,
    new_plan,
)
from template_control.embedding.planners.lqr import (
    KNEE_MOMENT,
    KNEE_STRAIGHT,
    WALK,
    LqrPlanner,
)
from template_control.embedding.planners.planner import ANY_ANGLE, Context, Decision, Planner
from template_control.errors import ScenarioError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.dynamics.stride import StrideSimulator, controls
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.maps.return_map import new_workspace
from template_control.slip.maps.section import PADDED, VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route
from template_control.slip.similarity import SPEED, TIME, Scale, scaled, tuned
from template_control.warm_up import Part, ready

MOST_STEPS = 6
"""That a plan may look ahead."""
RISE = (0.13, 0.01)
"""|dy/dt| at VLO that costs nothing, and what is beyond it and costs 1 [m/s], for the reference
template: from there on the template soon leaves the ground, or the leg sinks."""
SPACING = 0.05
"""Spacing of the speeds at VLO whose gaits the search leads to where no plan is cheap [m/s], for
the reference template; each gait that is made is kept."""
_SHARES = (1.0, 0.65, 0.4, 0.2, 0.0)  # of the wanted change of speed, tried in turn
_ROUNDS = 12  # Gauss-Newton steps of a plan at most: the way to a slower gait took 8
_BEHIND = 0.08  # difference between wanted and accepted speed that is none [m/s], for the reference
_MOST_STRIDES = 1000  # that are rehearsed, of a route that does not end


@dataclass(frozen=True)
class AheadOptions(Checked):
    """Tuning of the plan of several walking steps.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales them.

    Attributes:
        steps: that a plan looks ahead. With two a robot came to a VLO with a dy/dt from which no
            plan led on; with four it gets faster no sooner.
        pace: largest difference between the aimed speed and the present one. A few steps do not
            lead to a gait that is further away.
        cheap: cost of limits and of the last state up to which a plan is taken.
        ease: tolerances of the controls, over the usual ones.
        dearest: cost in all up to which a plan is taken; None: whatever it is.
        earliest: a foot lands so long after VLO at the soonest [s].
    """

    kind: ClassVar[str] = "ahead"

    steps: Annotated[int, Range(1, MOST_STEPS)] = tuned(3)
    pace: Positive = tuned(0.3, SPEED)
    cheap: Positive = tuned(20.0)
    ease: Positive = tuned(1.0)
    dearest: Positive | None = None
    earliest: NotNegative = tuned(0.0, TIME)


FREE_AHEAD = AheadOptions(pace=0.15, ease=0.5, dearest=20.0)
"""Of a quadruped: the sideways motion is that of steps near a gait. Its VLO comes out a little off
its plan's, most where its speed changes most: at 0.3 m/s a step dy/dt there was 0.07 m/s off, the
next plan jumped to make up for it, and Go2 fell as it slowed down to its slowest walk. It comes to
a stand no later.
"""

BIPED_AHEAD = replace(FREE_AHEAD, pace=0.09, earliest=0.12)
"""Of a biped with a floating base: of a gait that is further away no plan was cheap in the second
step, and the search led G1 to a slow one and to a fall, or the foot, on its way down already, was
wanted further ahead than Bolt's hips could take it. G1, slow and sinking, landed 0.06 s after VLO.
"""


class AheadPlanner(Planner):
    """Planner of several steps at once towards a gait of the family by speed.

    A governor tries shares of the wanted change of speed and takes the first whose plan is cheap.
    Its choice is :attr:`~.planner.Decision.accepted`. Where no plan is cheap, as after a push, the
    LQR planner's search finds a step to a gait near the present speed.

    Args:
        parameters: the template; its stiffness k0 counts for nothing, each gait has its own.
        options: tuning.
        speed: dx/dt at VLO of the gait that it is asked for first [m/s]; None: the range's middle.

    Attributes:
        options: scaled to the template.
        table: the gaits.
        gait: that the last plan led to.
    """

    gait: WalkingGait

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        options: AheadOptions | None = None,
        speed: Positive | None = None,
    ) -> None:
        ready((*WALK, *AHEAD))
        scale = Scale.of(parameters)
        o = self.options = scaled(options or AheadOptions(), scale)
        self._spacing = SPACING * scale.speed
        self.parameters = parameters
        self.table: GaitTable = gait_table(parameters)
        self._problem = plan_problem(parameters, self.table, o.ease, o.earliest)
        self._work = new_workspace()
        self._plan = new_plan(o.steps)
        self._first = float(np.clip(speed or np.mean(self.speeds), *self.speeds))
        self._lead_to(self._first)
        self._lqr = LqrPlanner(self.gait)
        self.offset = self._lqr.offset

    @property
    def speeds(self) -> tuple[float, float]:
        """Slowest and fastest dx/dt at VLO [m/s]."""
        return float(self.table.speed[0]), float(self.table.speed[-1])

    def __repr__(self) -> str:
        low, high = self.speeds
        return f"<AheadPlanner of {self.options.steps} steps, {low:.3g} to {high:.3g} m/s at VLO>"

    def reset(self) -> None:
        """See :class:`~.planner.Planner`."""
        self._lead_to(self._first)
        self._lqr.reset()
        self.offset = self._lqr.offset

    def _lead_to(self, speed: float) -> None:
        """Aim at the gait with another speed at VLO [m/s]."""
        self._speed = speed
        row = row_at(self.table, speed)
        k = float(row[STIFFNESS])
        self.gait = WalkingGait(
            "walk",
            replace(self.parameters, leg_stiffness=k),
            row[STATE : STATE + PADDED].copy(),
            controls(float(row[STATE + PADDED]), k, k, k_push=k),
            float(row[STEP_LENGTH]),
            float(row[STEP_DURATION]),
            STRIDE,
        )

    def decide(self, context: Context) -> Decision:
        """See :meth:`~.planner.Planner.decide`; of the target the speed counts.

        The decision is nominal where a plan was cheap, whatever was accepted.
        """
        z, target, angles, _, begun = context
        wanted = self._speed if target is None else float(target[0])
        low, high = self.speeds
        present = min(max(float(z[0]), low), high)
        pace, cheapest = self.options.pace, (np.inf, present)
        change = min(max(min(max(wanted, low), high) - present, -pace), pace)
        aims = [present + share * change for share in _SHARES]
        if begun is not None and begun.nominal:
            # The VLO from which the template would have come here has the speed that the legs'
            # swing adds for a while. A step goes on to where it went, as long as that is cheap.
            aims.insert(0, wanted if begun.accepted is None else begun.accepted)
        for speed in aims:
            cost, excess = self._look(z, speed, angles)
            if excess <= self.options.cheap and cost <= (self.options.dearest or np.inf):
                return self._decision(speed, wanted, True)
            cheapest = min(cheapest, (cost, speed))
        # No plan is cheap: the search's step, or the cheapest plan's if that is better.
        speed = min(max(self._spacing * round(float(z[0]) / self._spacing), low), high)
        decision = self._lqr.decide(Context(z, np.array([speed, 0.0, 0.0]), angles))
        cost, speed = cheapest
        if decision.lasting or not np.isfinite(cost):
            self._lead_to(float(self._lqr.gait.vlo[0]))
            return replace(decision, nominal=False, accepted=self._speed)
        self._look(z, speed, angles)
        return self._decision(speed, wanted, False)

    def _look(self, z: Array, speed: float, angles: tuple[float, float]) -> tuple[float, float]:
        aim = PlanTarget(speed, self.offset, (float(angles[0]), float(angles[1])))
        cost, excess = look_ahead(self._problem, self._work, z, aim, self._plan)
        return float(cost), float(excess)

    def _decision(self, speed: float, wanted: float, nominal: bool) -> Decision:
        """The first step of the last plan."""
        self._lead_to(speed)
        u = np.zeros(NUM_SLOTS)
        u[SLOTS] = self._plan.controls[0]
        u[SLOTS[1:]] *= self._plan.row[STIFFNESS]
        accepted = None if speed == wanted else speed
        return Decision(u, self._plan.states[1].copy(), True, True, nominal, accepted)

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal steps change the offset."""
        self._lqr.observe(decision, z)
        self.offset = self._lqr.offset


def plan_problem(
    parameters: SlipParameters, table: GaitTable, ease: float = 1.0, earliest: float = 0.0
) -> PlanProblem:
    """Model and costs of the plans on a template, with the table of its gaits."""
    scale = Scale.of(parameters)
    beyond, tolerance = RISE
    return PlanProblem(
        kernel=stride_kernel(parameters, STRIDE),
        table=table,
        tolerance=STATE_TOLERANCE * scale.state,
        ease=ease,
        rise=(beyond * scale.speed, tolerance * scale.speed),
        knee_reach=KNEE_STRAIGHT * scale.length,
        knee_moment=KNEE_MOMENT * scale.length * parameters.mass * parameters.gravity,
        earliest=earliest,
        rounds=_ROUNDS,
        columns=COLUMNS,
    )


def plan_ahead() -> None:
    """The compiled plan, so that a helper process can compile it."""
    row = np.ones((1, WIDTH))
    known = plan_problem(SlipParameters(), GaitTable(np.ones(1), row))._replace(rounds=1)
    aim = PlanTarget(1.0, np.zeros(PADDED), ANY_ANGLE)
    look_ahead(known, new_workspace(), np.ones(PADDED), aim, new_plan(1))


AHEAD = (Part(plan_ahead, 10.0),)
"""Compiled functions of this planner, in addition to a walk's."""


def check_feasibility(route: Route, planner: AheadPlanner) -> None:
    """Walk a route on the template, and refuse it where the planner would reduce its changes.

    Args:
        route: of walking steps; it is reset before and after.
        planner: of these steps; it learns nothing.

    Raises:
        ScenarioError: naming the first speed that cannot be had in time.
    """
    behind = _BEHIND * Scale.of(route.parameters).speed
    simulator = StrideSimulator(route.parameters, AUTOMATON)
    route.reset()
    z, now = np.array(route.start), 0.0
    for _ in range(_MOST_STRIDES):
        goal = route.next(VLO, z, now)
        if goal is None:
            break
        decision = planner.decide(Context(z, goal.target))
        wanted = float(goal.target[0])
        accepted = wanted if decision.accepted is None else decision.accepted
        if not decision.feasible or abs(accepted - wanted) > behind:
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
