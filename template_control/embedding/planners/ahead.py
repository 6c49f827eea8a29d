"""Planner of walking steps that looks several steps ahead, and reduces what cannot be had."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from template_control.arrays import Array, Pair
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Positive, Range
from template_control.embedding.planners.lqr import WALK, LqrPlanner
from template_control.embedding.planners.planner import Context, Decision, Planner
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.control.least_squares import Search
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning import look_ahead
from template_control.slip.planning.gait_table import (
    CONTROL,
    CONTROLS,
    STATE,
    STEP_DURATION,
    STEP_LENGTH,
    STIFFNESS,
    STRIDE,
    GaitTable,
    gait_table,
    row_at,
)
from template_control.slip.planning.plan_costs import (
    SWING,
    WalkLimits,
    plan_costs,
    usual_knee_moment,
)
from template_control.slip.planning.speed_changes import SpeedChange, speed_changes
from template_control.slip.similarity import SPEED, Scale, scaled, tuned
from template_control.structured import Kept, keep
from template_control.warm_up import ready

SPACING = 0.05
"""Spacing of the speeds at VLO whose gaits the search leads to where no plan is cheap [m/s], for
the reference template; each gait that is made is kept."""
_SHARES = (1.0, 0.65, 0.4, 0.2, 0.0)  # of the wanted change; 1 only if no search near one failed
_HOPELESS = 3.0  # cost after two rounds, over the dearest one's, from which on a search is given up
_NEAR_CHANGE = look_ahead.SEARCH._replace(hopeless=1000.0)  # search near a change of the table
# Points of each control of the first step, from the best of which plans begin where none is cheap.
_GRID = 3
_EFFORT = 12  # linearisations of plans, after which no other change of the table is tried
_OFF = 2.0  # tolerances off a gait, up to which the plan is one near it
_BEARABLE = 3.0  # excess up to which the first plan that has no more is taken
_DEAREST = 60.0  # and its cost
_NEVER = -1.0, 0.0  # excess and cost up to which a step's roughness counts where none is rough
_ROUGHEST = 1.5  # and the roughness of its first step; slow gaits have up to 2, others up to 0.5
# Pace with heavy legs [m/s], for the reference template: with twice as much 2 of 10 random profiles
# of rabbit ended in a fall, with changes of the table 5.
_HEAVY_PACE = 0.15


@dataclass(frozen=True)
class AheadOptions(Checked):
    """Tuning of the plan of several walking steps.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales them.

    Attributes:
        steps: that a plan looks ahead. With two a robot came to a VLO with a dy/dt from which no
            plan led on; with four it gets faster no sooner.
        pace: largest difference between the aimed speed and the present one. A few steps do not
            lead to a gait that is further away.
        changes: so many changes of speed of the library's table are tried at most, where the state
            is off the gait that is wanted; with none the way there leads over gaits.
        cheap: cost of defects, limits and the last state up to which a plan is taken.
        ease: tolerances of the controls, over the usual ones.
        dearest: cost in all up to which a plan is taken; None: whatever it is.
    """

    kind: ClassVar[str] = "ahead"

    steps: Annotated[int, Range(1, 6)] = tuned(3)
    pace: Positive = tuned(0.3, SPEED)
    changes: Annotated[int, Range(0, 10)] = tuned(4)
    cheap: Positive = tuned(20.0)
    ease: Positive = tuned(1.0)
    dearest: Positive | None = None


FREE_AHEAD = AheadOptions(pace=0.15, changes=0, ease=0.5, dearest=20.0)
"""Of a quadruped: the sideways motion is that of steps near a gait. At a pace of 0.3 m/s dy/dt at
VLO was 0.07 m/s off, the next plan jumped to make up for it, and Go2 fell in its slowest walk."""

BIPED_AHEAD = replace(FREE_AHEAD, pace=0.09)
"""Of a biped with a floating base: from further away no plan was cheap in the second step. The
search led G1 to a slow gait and a fall, or a foot of Bolt too far ahead for its hips."""


class _Plan(NamedTuple):
    """Plan to a speed."""

    effort: int  # linearisations
    cost: float
    excess: float
    roughness: float  # of its first step; 0 where it does not count
    speed: float  # dx/dt at VLO of the gait that it leads to [m/s]
    first: tuple[Array, float]  # controls of its first step, as of :func:`.step_controls`
    end: Array  # (3,) of its first step
    changes: bool  # its speed, from one gait to another one, and is not yet in its last step
    price: float  # cost with that of a rough step


class AheadPlanner(Planner):
    """Planner of several steps at once towards a gait of the family by speed.

    A change of speed is planned near one of the library's table, whose steps begin the search.
    Where none leads on, and near the gait, a plan stays near the gait that it leads to: a governor
    tries shares of the wanted change of speed and takes the first whose plan is cheap. Its choice
    is :attr:`~.planner.Decision.accepted`. Where no plan is cheap, as after a push, plans begin
    with other first steps; then the LQR planner's search finds a step to a gait near the present
    speed.

    Args:
        parameters: the template; its stiffness k0 counts for nothing, each gait has its own.
        options: tuning.
        speed: dx/dt at VLO of the gait that it is asked for first [m/s]; None: the range's middle.
        limits: of the robot's walks (:func:`.walk_limits`); None: of five-link's legs, and the
            speeds of all gaits.

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
        *,
        limits: WalkLimits | None = None,
    ) -> None:
        ready((*WALK, *look_ahead.AHEAD))
        scale = Scale.of(parameters)
        o = self.options = scaled(options or AheadOptions(), scale)
        self._spacing = SPACING * scale.speed
        self.parameters = parameters
        self.table: GaitTable = gait_table(parameters)
        usual = usual_knee_moment(parameters), self.speeds, SWING * scale.time
        self.limits = limits or WalkLimits(*usual)
        if not self.limits.light:
            pace = min(o.pace, _HEAVY_PACE * scale.speed)
            o = self.options = replace(o, changes=0, pace=pace)
        self._costs = plan_costs(parameters, self.limits, o.ease)
        self._problems: dict[int, tuple[look_ahead.PlanProblem, Kept]] = {}
        self._changes, self._map = speed_changes(parameters), ReturnMap(parameters, STRIDE)
        self._first = float(np.clip(speed or np.mean(self.speeds), *self.speeds))
        self._lead_to(self._first)
        self._lqr = LqrPlanner(self.gait)
        self.offset = self._lqr.offset

    @property
    def speeds(self) -> Pair:
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
        z, target, angles, *_ = context
        wanted, (low, high) = self._speed if target is None else float(target[0]), self.speeds
        aim = float(np.clip(wanted, *self.limits.speeds))
        best, cheapest = self._plans(context, aim, 0)
        if best is None:
            best, _ = self._plans(context, aim, _GRID)
        if best is not None:
            return self._begin(best, z, wanted)
        # No plan is cheap: the search's step, or the cheapest plan's if that is better.
        speed = min(max(self._spacing * round(float(z[0]) / self._spacing), low), high)
        decision = self._lqr.decide(Context(z, np.array([speed, 0.0, 0.0]), angles))
        if decision.lasting or cheapest is None:
            self._lead_to(float(self._lqr.gait.vlo[0]))
            return replace(decision, nominal=False, accepted=self._speed)
        return replace(self._begin(cheapest, z, wanted), nominal=False)

    def _plans(self, context: Context, aim: float, grid: int) -> tuple[_Plan | None, _Plan | None]:
        """The best of the cheap plans that lead towards a speed [m/s], and the cheapest of others.

        ``grid`` are points of each control of the first step, see :class:`.Search`.
        """
        z, begun, (low, high), o = context.z, context.decision, self.speeds, self.options
        present = min(max(float(z[0]), low), high)
        change = min(max(aim - present, -o.pace), o.pace)
        next_best, cheapest, price, effort = None, None, np.inf, 0
        for goal, way in self._towards(z, aim):
            if effort >= _EFFORT:
                break
            search = _NEAR_CHANGE._replace(grid=grid)
            plan = self._look(context, goal, way, search, (_BEARABLE, _DEAREST))
            effort += plan.effort
            if plan.excess > _BEARABLE or plan.cost > _DEAREST:
                continue
            if plan.roughness <= _ROUGHEST:
                return plan, None
            if next_best is None or plan.price < price:
                next_best, price = plan, plan.price
        aims = list(dict.fromkeys(present + share * change for share in _SHARES[effort > 0 :]))
        begun_to = None
        if begun is not None and begun.nominal:
            # The VLO from which the template would have come here has the speed that the legs'
            # swing adds for a while. A step goes on to where it went, as long as that is cheap.
            begun_to = aim if begun.accepted is None else begun.accepted
            aims.insert(0, begun_to)
        dearest = o.dearest or np.inf
        judged = _NEVER if next_best is None else (o.cheap, dearest)
        for speed in aims:
            hopeless = np.inf if speed == begun_to else _HOPELESS * min(price, _DEAREST)
            search = look_ahead.SEARCH._replace(grid=grid, hopeless=hopeless)
            plan = self._look(context, speed, None, search, judged)
            if plan.excess <= o.cheap and plan.cost <= dearest and plan.price < price:
                if plan.excess <= _BEARABLE:
                    return plan, None
                next_best, price = plan, plan.price
            if plan.cost < (np.inf if cheapest is None else cheapest.cost):
                cheapest = plan
        return next_best, cheapest

    def _towards(self, z: Array, aim: float) -> Iterator[tuple[float, SpeedChange]]:
        """Changes of speed that may lead from a VLO state near a speed [m/s], and where they lead.

        There are none from near the gait with this speed, or near the gait of the table that is
        nearest to it: slower gaits bear no errors as large as those at the end of a change.
        """
        changes = self._changes
        goal = min(max(aim, changes.speeds[0]), changes.speeds[1])
        gaits = [row_at(self.table, speed)[STATE:CONTROL] for speed in (aim, goal)]
        if min(np.linalg.norm((z - gait) / changes.tolerance) for gait in gaits) > _OFF:
            for way in changes.towards(z, goal, self.options.changes):
                yield goal, way

    def _look(
        self, context: Context, speed: float, way: SpeedChange | None, search: Search, judged: Pair
    ) -> _Plan:
        """A plan to a speed, near a change of speed or near its gait.

        ``judged`` are the excess and the cost up to which its roughness counts.
        """
        steps = self.options.steps if way is None else len(way.controls)
        if steps not in self._problems:
            problem = look_ahead.new_problem(self._costs, steps)
            self._problems[steps] = problem, keep(problem)
        p, kept = self._problems[steps]
        p.start[:], p.offset[:], p.linearised[0] = context.z, self.offset, 0
        lifted, due = context.lifted, context.due
        if 0.0 < due < np.inf:
            # The quickest swing brings the foot as far as it is in as large a share of its time.
            lifted = min(lifted, self.limits.swing * lifted / (lifted + due))
        p.lifted[0] = lifted
        states, free, stiffness, *_ = p.reference
        if way is not None:
            states[:], free[:], stiffness[:] = way.states[1:], way.controls, way.stiffness
        x, (least, most) = np.empty(len(p.lower)), context.angles
        goal, angles = (speed, way is None), (float(least), float(most))
        cost, excess, error = look_ahead.make_plan(kept, goal, angles, search, judged, x)
        return _Plan(
            effort=int(p.linearised[0]),
            cost=float(cost),
            excess=float(excess),
            roughness=float(error),
            speed=speed,
            first=(x[:CONTROLS], float(stiffness[0])),
            end=p.ends[0].copy(),
            changes=way is not None and steps > 1,
            price=float(cost + error**2),
        )

    def _begin(self, plan: _Plan, z: Array, wanted: float) -> Decision:
        """The first step of a plan; of a change of speed it accepts as much as the step does."""
        if plan.speed != self._speed:
            self._lead_to(plan.speed)
        u = look_ahead.step_controls(*plan.first)
        end, outcome = self._map.step(z, u)  # the plan's is not exact
        end = end + self.offset if outcome is Outcome.SECTION else plan.end
        speed = float(end[0]) if plan.changes else plan.speed
        return Decision(u, end, True, True, True, None if speed == wanted else speed)

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal steps change the offset."""
        self._lqr.observe(decision, z)
        self.offset = self._lqr.offset
