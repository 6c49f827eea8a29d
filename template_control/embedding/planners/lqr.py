"""Discrete LQR on the VLO state about the gait's fixed point, with an offset estimate.

The robot is no template: its swing leg and its impacts add something systematic to each
step. The planner learns it, z_next = P(z, u) + d with a slowly filtered d, and aims at the
fixed point nearest the gait's that the robot then has, so that the walk settles on the
gait and not beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import (
    Count,
    Index,
    Interval,
    NotNegative,
    Positive,
    Range,
    Share,
)
from template_control.embedding.planners.planner import ANY_ANGLE, Ahead, Decision
from template_control.embedding.planners.rest_of_step import choose_rest
from template_control.embedding.planners.step_search import (
    FALL_PRICE,
    Grid,
    Law,
    linear,
    price,
    search,
)
from template_control.embedding.planners.walk_kernels import WALK
from template_control.parts import ready
from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.gaits.gait import WalkingGait, control_units, vlo_jacobians
from template_control.slip.gaits.walking_family import WalkingFamily
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.similarity import (
    LENGTH,
    PER_LENGTH_SQUARED,
    PER_SPEED_SQUARED,
    SPEED,
    TIME,
    Scale,
    scaled,
    tuned,
)

Array = NDArray[np.float64]
_ROUNDS = 2  # of Newton's method for the fixed point; it begins at the last one
_Several = Annotated[int, Range(2)]
_Three = tuple[NotNegative, NotNegative, NotNegative]


@dataclass(frozen=True)
class SearchOptions(Checked):
    """How a step is searched for where the linear law's own is not good enough.

    Attributes:
        first_weight: weight of the cost-to-go after the first step, relative to that after the
            second. Where two steps end alike, it favours the one nearer the gait half-way.
        coarse: numbers of points in alpha, kappa_1 and kappa_2 over all of their ranges. Most are
            in alpha, which decides where the foot lands.
        fine: numbers of points in alpha and kappa_2 of each finer grid about the best so far, at
            least 2. kappa_1, which matters least there, gets two points beside their plane.
        rounds: number of finer grids; with two, alphas end 0.03 rad apart.
        narrowing: half-widths of a finer grid over those of the one before. It is at most half,
            the spacing of that one's alphas: what lies beyond has its neighbour's price.
    """

    first_weight: NotNegative = tuned(0.3)
    coarse: tuple[Count, Count, Count] = tuned((5, 3, 3))
    fine: tuple[_Several, _Several] = tuned((5, 3))
    rounds: Index = tuned(2)
    narrowing: Annotated[float, Range(0.0, 0.5, above=True)] = tuned(0.4)


_Four = tuple[float, NotNegative, NotNegative, NotNegative]


@dataclass(frozen=True)
class PushOffOptions(Checked):
    """Tuning of the fourth control, kappa_p: the rear leg's own stiffness in double stance.

    It counts in steps with push-off, stride "wp". There kappa_p has the bounds of the other
    stiffnesses.

    Attributes:
        cost: of the LQR on kappa_p, as a share of k0.
        points: of kappa_p in the coarse grid of the search.
        settled_price: cost-to-go up to which a step of the linear law may lead further away. Above
            it such a step is searched for: near some gaits the law alone settles beside them, in
            states in which the map is no longer linear.
        second_steps: what :attr:`LqrOptions.second_steps` are in other steps: alpha relative to
            the gait's [rad], kappa_1, kappa_2 and kappa_p over k0. A stiff push-off puts energy in.
    """

    cost: Positive = tuned(2.0)
    points: Count = tuned(3)
    settled_price: NotNegative = tuned(0.01)
    second_steps: tuple[_Four, ...] = tuned(
        (
            (0.0, 1.5, 1.0, 0.75),
            (-0.058, 1.0, 0.75, 0.75),
            (0.025, 1.5, 1.0, 1.0),
            (-0.058, 1.25, 0.75, 1.0),
            (-0.03, 0.75, 1.0, 1.0),
            (0.0, 1.0, 1.25, 1.25),
            (0.045, 0.75, 0.75, 1.25),
        )
    )


_VLO_STATE = (SPEED, LENGTH, SPEED)


@dataclass(frozen=True)
class LqrOptions(Checked):
    """Tuning of the LQR; states in m/s, m, m/s, controls in rad and shares of k0.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales
    them to its gait's by dynamic similarity.

    Attributes:
        state_cost: on dx/dt, y, dy/dt.
        control_cost: on alpha, kappa_1, kappa_2.
        offset_gain: share of a step's surprise that enters the offset estimate.
        offset_bound: largest offset believed, per state.
        surprise_bound: a larger surprise counts as this much: a push is no offset.
        tolerance: errors of the settled state that count as equally bad; decides which
            part of an offset that the controls cannot cancel shows up where.
        control_weight: of the settled controls' squared changes [rad, share of k0], where
            an error of ``tolerance`` in a state counts as 1.
        stiffness_range: kappa_1 and kappa_2 over k0.
        angle_range: touchdown angle relative to the gait's [rad]; steeper ones make steps
            too short in time for the swing leg, flatter ones let the CoM sink lower than the
            knees can carry it.
        top_margin: alpha stays this far [rad] below asin(y / l0), the angle at which the
            foot would touch down at once.
        earliest_touchdown: no foot is to touch down so soon after VLO [s]: in a plane the swing
            leg comes in time, and 0 is no bound; one that has to move aside too needs some.
        trusted_price: the linear law's step is taken without a search below this price.
        spread: half-widths of the search in alpha [rad] and kappa_2 / k0.
        search: points, rounds and weights of the search.
        second_steps: second steps that the search reckons with beside the law's own: alpha relative
            to the gait's [rad], kappa_1 and kappa_2 over k0. A leg that is stiffer before its
            virtual bottom than after takes energy out, the reverse puts some in.
        push_off: tuning of the fourth control, in steps that have it.
    """

    kind: ClassVar[str] = "lqr"

    state_cost: _Three = tuned(
        (10.0, 100.0, 10.0), PER_SPEED_SQUARED, PER_LENGTH_SQUARED, PER_SPEED_SQUARED
    )
    control_cost: tuple[Positive, Positive, Positive] = tuned((5.0, 2.0, 2.0))
    offset_gain: Share = tuned(0.2)
    offset_bound: _Three = tuned((0.06, 0.015, 0.12), *_VLO_STATE)
    surprise_bound: _Three = tuned((0.03, 0.008, 0.06), *_VLO_STATE)
    tolerance: tuple[Positive, Positive, Positive] = tuned((0.011, 0.005, 0.03), *_VLO_STATE)
    control_weight: Positive = tuned(100.0)
    stiffness_range: Interval = tuned((0.5, 1.5))
    angle_range: Interval = tuned((-0.12, 0.065))
    top_margin: NotNegative = tuned(0.01)
    earliest_touchdown: NotNegative = tuned(0.0, TIME)
    trusted_price: NotNegative = tuned(1.0)
    spread: tuple[NotNegative, NotNegative] = tuned((0.16, 0.25))
    search: SearchOptions = field(default_factory=SearchOptions)
    second_steps: tuple[tuple[float, NotNegative, NotNegative], ...] = tuned(
        (
            (0.0, 1.5, 1.0),
            (-0.058, 1.0, 0.75),
            (0.025, 1.5, 1.0),
            (-0.058, 1.25, 0.75),
            (-0.03, 0.75, 1.0),
            (0.0, 1.0, 1.5),
            (0.045, 0.5, 0.75),
        )
    )
    push_off: PushOffOptions = field(default_factory=PushOffOptions)


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
        self._settle_on(gait)

    def _settle_on(self, gait: WalkingGait) -> None:
        """Make ``gait`` the one that the law leads to."""
        self.gait = gait
        self.a, self.b = vlo_jacobians(gait)
        o = self.options
        costs = (*o.control_cost, o.push_off.cost) if self._pushes else o.control_cost
        self._costs = np.array(costs)
        q, r = np.diag(o.state_cost), np.diag(costs)
        self._cost = solve_discrete_are(self.a, self.b, q, r)
        self._gain = np.linalg.solve(
            r + self.b.T @ self._cost @ self.b, self.b.T @ self._cost @ self.a
        )
        self._settling = settling_map(self.a, self.b, np.array(o.tolerance), o.control_weight)
        self._shift = self._settling @ self.offset
        self._law = self._aim()

    def __repr__(self) -> str:
        return f"<LqrPlanner on {self.gait!r}>"

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for, without an offset."""
        self.offset = np.zeros(3)
        self._settle_on(self._family.reset())

    def _aim(self) -> Law:
        """The linear law about the fixed point the robot has with the present offset."""
        p, o = self.gait.parameters, self.options
        shift = self._shift = self._settled()
        slots, units = control_units(self.gait)
        nominal, others = self.gait.controls[slots] / units, len(slots) - 1
        steps = o.push_off.second_steps if self._pushes else o.second_steps
        relative_to = (nominal[0], *[0.0] * others)
        return Law(
            target=self.gait.vlo + shift[:3],
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
            top_margin=o.top_margin,
            earliest=o.earliest_touchdown,
            stiffness=p.leg_stiffness,
            kernel=stride_kernel(p, self.gait.stride),
        )

    def _settled(self) -> Array:
        """(3 + c,) shift of the fixed point by the present offset.

        With push-off the map counts as it is about the shift so far, not as it is about the gait:
        there are gaits near which a small offset asks for so much of the controls that the linear
        map's fixed point is none. No offset would ever be learnt from that.
        """
        linear: Array = self._settling @ self.offset
        if not self._pushes:
            return linear
        o, (slots, units) = self.options, control_units(self.gait)
        shift, step = self._shift, ReturnMap(self.gait.parameters, self.gait.stride)
        for _ in range(_ROUNDS):
            z, u = self.gait.vlo + shift[:3], self.gait.controls.copy()
            u[slots] += shift[3:] * units
            here = step.linearise(z, u)
            if here.outcome is not Outcome.SECTION:
                return linear
            a, b = here.state_jacobian, here.control_jacobian[:, slots] * units
            rest = here.state + self.offset - z + shift[:3] - a @ shift[:3] - b @ shift[3:]
            shift = settling_map(a, b, np.array(o.tolerance), o.control_weight) @ rest
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
        law, s = self._law, self._scratch
        if angles != ANY_ANGLE:
            lower, upper = law.lower.copy(), law.upper.copy()
            lower[0] = min(max(lower[0], angles[0]), upper[0])
            upper[0] = max(min(upper[0], angles[1]), lower[0])
            law = law._replace(lower=lower, upper=upper)
        slots, units = control_units(self.gait)
        u, first = np.empty(len(slots)), np.empty(3)
        linear(law, z, u)
        cost = price(law, True, s, z, u, np.inf, first)
        nominal = cost < self.options.trusted_price
        if not (nominal and self._approaches(law, z, first)):
            other, end = u.copy(), first.copy()
            found = search(law, self._grid, s, z, other, end)
            if not nominal or found < cost:
                u, first, cost, nominal = other, end, found, False
        controls = self.gait.controls.copy()
        controls[slots] = u * units
        nominal = nominal and reachable
        return Decision(controls, first, cost < 2.0 * FALL_PRICE, cost < FALL_PRICE, nominal)

    def _approaches(self, law: Law, z: Array, after: Array) -> bool:
        """Whether a step of the linear law comes nearer to where it leads, or is there."""
        if not self._pushes:
            return True
        before, then = z - law.target, after - law.target
        left = float(then @ law.cost @ then)
        return left <= max(float(before @ law.cost @ before), self.options.push_off.settled_price)

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
