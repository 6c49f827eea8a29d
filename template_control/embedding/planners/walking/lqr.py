"""Discrete LQR on the VLO state about the gait's fixed point, with an offset estimate.

The robot is no template: its swing leg and its impacts add something systematic to each
step. The planner learns it, z_next = P(z, u) + d with a slowly filtered d, and aims at the
fixed point nearest the gait's that the robot then has, so that the walk settles on the
gait and not beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from template_control.checks.checked import checked
from template_control.embedding.planners.planner import ANY_ANGLE, Ahead, Decision
from template_control.embedding.planners.walking.lqr_options import LqrOptions
from template_control.embedding.planners.walking.rest_of_step import choose_rest
from template_control.embedding.planners.walking.step_law import Law, Strain
from template_control.embedding.planners.walking.step_search import FALL_PRICE, Grid, Trust, choose
from template_control.embedding.planners.walking.walk_kernels import WALK
from template_control.errors import GaitError
from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.gaits.gait import WalkingGait, control_units, vlo_jacobians
from template_control.slip.gaits.slope_gait import on_slope
from template_control.slip.gaits.walking_by_speed import WalkingFamily
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import (
    Scale,
    scaled,
)
from template_control.warm_up import ready

Array = NDArray[np.float64]
_LASTING = (0.0, 1.0, 1.0)  # what of an offset outlives another way of moving
_ROUNDS = 2  # of Newton's method for the fixed point; it begins at the last one


class LqrPlanner:
    """u = u_s - K (z - z_s), where the template completes its step; else a search.

    Args:
        gait: to settle on.
        options: tuning.

    Attributes:
        gait: the one of the last target.
        offset: (3,) the estimate of d.
        a, b: (3, 3), (3, c) state and control Jacobians of the VLO map at the gait.
    """

    @checked
    def __init__(self, gait: WalkingGait, options: LqrOptions | None = None) -> None:
        ready(WALK)
        self.options = scaled(options or LqrOptions(), Scale.of(gait.parameters))
        self.offset: Array = np.zeros(3)
        self._family = WalkingFamily(gait)
        self._scratch = new_scratch()
        self._pushes = int(Slot.K_PUSH) in control_units(gait)[0]
        grid, spread = self.options.search, self.options.spread
        points = (*grid.coarse, self.options.push_off.points)[: 4 if self._pushes else 3]
        self._grid = Grid(np.array(points), grid.fine, grid.rounds, *spread, grid.narrowing)
        o = self.options
        settled = o.push_off.settled_price if self._pushes else np.inf
        self._trust = Trust(o.trusted_price, settled)
        self._slope = 0.0
        self._settle_on(gait)

    def _settle_on(self, gait: WalkingGait) -> None:
        """Make ``gait`` the one that the law leads to, on the present slope."""
        self.gait = gait
        gait = self._here = self._sloped()
        self.a, self.b = vlo_jacobians(gait)
        o = self.options
        costs = (*o.control_cost, o.push_off.cost) if self._pushes else o.control_cost
        self._costs = np.array(costs)
        q, r = np.diag(o.state_cost), np.diag(costs)
        self._cost = solve_discrete_are(self.a, self.b, q, r)
        self._gain = np.linalg.solve(
            r + self.b.T @ self._cost @ self.b, self.b.T @ self._cost @ self.a
        )
        self._change_weight = self._weight_of_change()
        self._settling = settling_map(self.a, self.b, np.array(o.tolerance), self._change_weight)
        self._shift = self._settling @ self.offset
        self._law = self._aim()

    def __repr__(self) -> str:
        return f"<LqrPlanner on {self.gait!r}>"

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for, without an offset."""
        self.offset = np.zeros(3)
        self._slope = 0.0
        self._settle_on(self._family.reset())

    def forget(self) -> None:
        """See :meth:`~.planner.ForgettingPlanner.forget`.

        What the robot adds to dx/dt depends on how its trunk moves. A five-link robot that leans
        for a run to come gains 0.02 m/s in each walking step; after the run it stands up, and
        loses up to 0.04 m/s. What it adds to y and dy/dt is much the same.
        """
        self.offset = self.offset * _LASTING
        self._shift = self._settling @ self.offset
        self._law = self._aim()

    def on_slope(self, slope: float) -> SlipParameters:
        """See :meth:`~.planner.SlopePlanner.on_slope`; without a gait there the ground is level."""
        if slope != self._slope:
            self._slope = slope
            self._settle_on(self.gait)
        return self._here.parameters

    def _sloped(self) -> WalkingGait:
        """The gait on the present slope."""
        try:
            return on_slope(self.gait, self._slope)
        except GaitError:
            self._slope = 0.0
            return self.gait

    def _aim(self) -> Law:
        """The linear law about the fixed point the robot has with the present offset."""
        p, o = self._here.parameters, self.options
        shift = self._shift = self._settled()
        slots, units = control_units(self._here)
        nominal, others = self._here.controls[slots] / units, len(slots) - 1
        steps = o.push_off.second_steps if self._pushes else o.second_steps
        relative_to = (nominal[0], *[0.0] * others)
        return Law(
            target=self._here.vlo + shift[:3],
            control=nominal + shift[3:],
            gain=self._gain,
            cost=self._cost,
            offset=self.offset,
            lower=np.array([nominal[0] + o.angle_range[0], *[o.stiffness_range[0]] * others]),
            upper=np.array([nominal[0] + o.angle_range[1], *[o.stiffness_range[1]] * others]),
            slots=np.array(slots),
            second_steps=np.add(np.array(steps).reshape(-1, len(slots)), relative_to),
            enough=o.trusted_price,
            first_weight=o.search.first_weight,
            effort=o.search.effort * self._costs,
            highest=p.rest_length + o.search.flight,
            top_margin=o.top_margin,
            earliest=min(o.earliest_touchdown, o.earliest_share * self.gait.step_duration),
            stiffness=p.leg_stiffness,
            softest=o.softest_rest,
            strain=Strain(o.strain.reach, o.strain.moment * p.mass * p.gravity, o.strain.price),
            kernel=stride_kernel(p, self._here.stride),
        )

    def _weight_of_change(self) -> float:
        """Of the settled controls' changes: with push-off more, the straighter the leg at VLO."""
        o, bend = self.options, 1.0 - self._here.vlo[1] / self._here.parameters.rest_length
        share = o.push_off.straight / bend if self._pushes else 0.0
        return float(o.control_weight * (1.0 + share**2))

    def _settled(self) -> Array:
        """(3 + c,) shift of the fixed point by the present offset.

        With push-off the map counts as it is about the shift so far, not as it is about the gait:
        there are gaits near which a small offset asks for so much of the controls that the linear
        map's fixed point is none. No offset would ever be learnt from that.
        """
        linear: Array = self._settling @ self.offset
        if not self._pushes:
            return linear
        o, (slots, units) = self.options, control_units(self._here)
        shift, step = self._shift, ReturnMap(self._here.parameters, self._here.stride)
        for _ in range(_ROUNDS):
            z, u = self._here.vlo + shift[:3], self._here.controls.copy()
            u[slots] += shift[3:] * units
            here = step.linearise(z, u)
            if here.outcome is not Outcome.SECTION:
                return linear
            a, b = here.state_jacobian, here.control_jacobian[:, slots] * units
            rest = here.state + self.offset - z + shift[:3] - a @ shift[:3] - b @ shift[3:]
            shift = settling_map(a, b, np.array(o.tolerance), self._change_weight) @ rest
        return shift

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :meth:`~.planner.Planner.decide`; the stride is a walking step from VLO to VLO.

        The law leads to the symmetric gait with the target's speed, and with that gait's
        height. Where no gait is that slow or fast it leads to the nearest, and the decision is
        not nominal.
        """
        gait, reachable = self._family.towards(self.gait, target)
        if gait is not self.gait:
            self._settle_on(gait)
        law = self._law
        if angles != ANY_ANGLE:
            lower, upper = law.lower.copy(), law.upper.copy()
            lower[0] = min(max(lower[0], angles[0]), upper[0])
            upper[0] = max(min(upper[0], angles[1]), lower[0])
            law = law._replace(lower=lower, upper=upper)
        u, first, cost, nominal = self._best(law, z)
        slots, units = control_units(self._here)
        controls = self._here.controls.copy()
        controls[slots] = u * units
        nominal = nominal and reachable
        return Decision(controls, first, cost < 2.0 * FALL_PRICE, cost < FALL_PRICE, nominal)

    def price(self, z: Array) -> float:
        """See :meth:`~.planner.PricingPlanner.price`: with the step after the next."""
        return self._best(self._law, z)[2]

    def _best(self, law: Law, z: Array) -> tuple[Array, Array, float, bool]:
        """Controls, where they lead, their price, and whether they are the linear law's."""
        s, u, first = self._scratch, np.empty(len(law.slots)), np.empty(3)
        cost, own = choose(law, self._grid, self._trust, s, z, u, first)
        return u, first, cost, own

    def land(
        self, ahead: Ahead, decision: Decision, target: Array, free: Sequence[int]
    ) -> Decision:
        """See :meth:`~.planner.LandingPlanner.land`.

        Without push-off there is too little to choose. The offset is still learnt from the whole
        step: its prediction moves by as much as the choice does.
        """
        if not self._pushes:
            return decision
        u, end, change = choose_rest(self._law, self._costs, ahead, decision.controls, free)
        if end is None:
            return replace(decision, feasible=False, nominal=False)
        if change is None:
            return Decision(u, end, True, True, False)
        return replace(decision, controls=u, predicted=decision.predicted + change)

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal steps change the offset."""
        if not (decision.feasible and decision.nominal):
            return  # far from the gait the surprise says little about it
        o = self.options
        limit = np.array(o.surprise_bound)
        surprise = np.clip(z - decision.predicted, -limit, limit)
        bound = np.array(o.offset_bound)
        self.offset = np.clip(self.offset + o.offset_gain * surprise, -bound, bound)
        self._law = self._aim()


def settling_map(a: Array, b: Array, tolerance: Array, control_weight: float) -> Array:
    """(3 + c, 3) map from an offset d to the shift (dz, du) of the fixed point.

    Minimises |dz / tolerance|^2 + control_weight |du|^2 subject to (I - A) dz = B du + d. Without
    push-off the controls act in two directions only, so not every offset can be cancelled with
    dz = 0.

    Args:
        a, b: (3, 3), (3, c) Jacobians of the VLO map.
        tolerance: (3,) changes of the state that cost 1.
        control_weight: cost of a change of a control by 1.
    """
    weight = np.concatenate((1.0 / tolerance**2, np.full(b.shape[1], control_weight)))
    constraint, n = np.hstack((np.eye(3) - a, -b)), len(weight)
    kkt = np.zeros((n + 3, n + 3))
    kkt[:n, :n] = np.diag(weight)
    kkt[n:, :n] = constraint
    kkt[:n, n:] = constraint.T
    solution = np.linalg.solve(kkt, np.vstack((np.zeros((n, 3)), np.eye(3))))
    return np.asarray(solution[:n], dtype=np.float64)
