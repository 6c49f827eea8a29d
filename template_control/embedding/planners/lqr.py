"""Discrete LQR on the VLO state about the gait's fixed point, with an offset estimate.

The robot is no template: its swing leg and its impacts add something systematic to each
step. The planner learns it, z_next = P(z, u) + d with a slowly filtered d, and aims at the
fixed point nearest the gait's that the robot then has, so that the walk settles on the
gait and not near it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    Planner,
    RestContext,
    learnt,
)
from template_control.errors import GaitError
from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.control.least_squares import Search
from template_control.slip.control.lqr import (
    CONTROL_WEIGHT,
    SETTLED_TOLERANCE,
    lqr,
    settling_map,
)
from template_control.slip.control.stride_kernels import STRIDES
from template_control.slip.control.stride_solver import Prior, solve_stride
from template_control.slip.gaits.gait import (
    GaitFamily,
    WalkingGait,
    control_units,
    on_slope,
    vlo_jacobians,
)
from template_control.slip.gaits.walking_by_speed import other_walks
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.plan_costs import (
    ANGLE_RANGE,
    KNEE_STRAIGHT,
    STIFFNESS_RANGE,
    usual_knee_moment,
)
from template_control.slip.planning.step_search import (
    EFFORT,
    FALL_PRICE,
    SEARCH,
    Law,
    choose,
)
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
from template_control.warm_up import ready

_Three = tuple[NotNegative, NotNegative, NotNegative]
_VLO_STATE = (SPEED, LENGTH, SPEED)

# A loaded leg that gets softer takes energy out, and sinks so low that the knee does not lift it.
_SOFTEST_REST = 0.75  # over k0, for the rest of a step that has begun and ends slow

_PUSH_OFF_COST = 2.0  # of the LQR on kappa_p, as a share of k0
# The fastest gaits bear no large change of their controls: with less weight the walk sways.
_STRAIGHT = 0.004  # bend of the leg at VLO, 1 - y/l0, at which CONTROL_WEIGHT counts twice

# The offset estimate, for the reference template: dx/dt, y, dy/dt [m/s, m, m/s].
_OFFSET_BOUND = np.array((0.06, 0.015, 0.12))  # largest offset believed
# A larger surprise counts as this much: a push is no offset.
_SURPRISE_BOUND = np.array((0.03, 0.008, 0.06))
_KEPT = (0.0, 1.0, 1.0)  # what of an offset outlives another way of moving
_ROUNDS = 2  # of Newton's method for the fixed point; it begins at the last one

# A template that flies on to this far above l0 is in flight: no walking step begins there. A robot
# is a few millimetres above l0 in steady walks too.
_FLIGHT = 0.005  # [m], for the reference template
# Second steps that are tried after the law's own: alpha relative to the gait's [rad], kappa_1,
# kappa_2 (and kappa_p) over k0. A leg that is stiffer before its virtual bottom than after takes
# energy out, the reverse puts some in; so does a stiff push-off.
_SECOND_STEPS = (
    (0.0, 1.5, 1.0),
    (-0.058, 1.0, 0.75),
    (0.025, 1.5, 1.0),
    (-0.058, 1.25, 0.75),
    (-0.03, 0.75, 1.0),
    (0.0, 1.0, 1.5),
    (0.045, 0.5, 0.75),
)
_SECOND_PUSH_OFF_STEPS = (
    (0.0, 1.5, 1.0, 0.75),
    (-0.058, 1.0, 0.75, 0.75),
    (0.025, 1.5, 1.0, 1.0),
    (-0.058, 1.25, 0.75, 1.0),
    (-0.03, 0.75, 1.0, 1.0),
    (0.0, 1.0, 1.25, 1.25),
    (0.045, 0.75, 0.75, 1.25),
)
_REST_ROUNDS = 6  # of Gauss and Newton's method; most choices take three


WALK = (*STRIDES, *SEARCH)
"""Compiled functions of the planner."""


@dataclass(frozen=True)
class LqrOptions(Checked):
    """Tuning of the LQR; states in m/s, m, m/s, controls in rad and shares of k0.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales
    them to its gait's by dynamic similarity.

    Attributes:
        state_cost: on dx/dt, y, dy/dt.
        control_cost: on alpha, kappa_1, kappa_2.
        offset_gain: share of a step's surprise that enters the offset estimate.
        tolerance: errors of the settled state that count as equally bad; decides which
            part of an offset that the controls cannot cancel shows up where.
        earliest_touchdown: no foot is to touch down so soon after VLO [s]: the swing leg passes the
            other one about then, and is not in front yet. 0 is no bound.
        earliest_share: of the gait's step duration, which counts in its place where it is less:
            fast gaits swing their legs faster.
        trusted_price: the linear law's step is taken without a search below this price.
        knee_load_price: of a searched step with twice the knee moment that costs nothing; the
            LQR's cost-to-go is the unit.
    """

    kind: ClassVar[str] = "lqr"

    state_cost: _Three = tuned(
        (10.0, 100.0, 10.0), PER_SPEED_SQUARED, PER_LENGTH_SQUARED, PER_SPEED_SQUARED
    )
    control_cost: tuple[Positive, Positive, Positive] = tuned((5.0, 2.0, 2.0))
    offset_gain: Share = tuned(0.2)
    tolerance: tuple[Positive, Positive, Positive] = tuned(SETTLED_TOLERANCE, *_VLO_STATE)
    earliest_touchdown: NotNegative = tuned(0.12, TIME)
    earliest_share: Share = tuned(0.2)
    trusted_price: NotNegative = tuned(1.0)
    knee_load_price: NotNegative = tuned(100.0)


class LqrPlanner(Planner):
    """u = u_s - K (z - z_s), where the template completes its step; else a search.

    Args:
        gait: to settle on.
        options: tuning.

    Attributes:
        gait: the one of the last target.
        offset: (3,) the estimate of d.
        a, b: (3, 3), (3, c) state and control Jacobians of the VLO map at the gait.
    """

    gait: WalkingGait
    retries = True

    @checked
    def __init__(self, gait: WalkingGait, options: LqrOptions | None = None) -> None:
        ready(WALK)
        self._scale = Scale.of(gait.parameters)
        self.options = scaled(options or LqrOptions(), self._scale)
        self.offset: Array = np.zeros(3)
        self._family = GaitFamily(gait, other_walks)
        self._knee_moment = usual_knee_moment(gait.parameters)
        self._slope = 0.0
        self._settle_on(gait)

    def _settle_on(self, gait: WalkingGait) -> None:
        """Make ``gait`` the one that the law leads to, on the present slope."""
        self.gait = here = gait
        try:
            here = on_slope(gait, self._slope)
        except GaitError:
            self._slope = 0.0
        self._here, (self._slots, self._units) = here, control_units(here)
        self._map = ReturnMap(here.parameters, here.stride)
        self._pushes = int(Slot.K_PUSH) in self._slots
        self.a, self.b = vlo_jacobians(here)
        o = self.options
        self._costs = np.array([*o.control_cost, _PUSH_OFF_COST][: len(self._slots)])
        q, r = np.diag(o.state_cost), np.diag(self._costs)
        self._cost, self._gain = lqr(self.a, self.b, q, r)
        # With push-off changes of the controls count more, the straighter the leg is at VLO.
        bend = 1.0 - here.vlo[1] / here.parameters.rest_length
        share = _STRAIGHT / bend if self._pushes else 0.0
        self._change_weight = float(CONTROL_WEIGHT * (1.0 + share**2))
        self._settling = settling_map(self.a, self.b, np.array(o.tolerance), self._change_weight)
        self._aim(self._settling @ self.offset)

    def __repr__(self) -> str:
        return f"<LqrPlanner on {self.gait!r}>"

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for, without an offset."""
        self.offset = np.zeros(3)
        self._slope = 0.0
        self._settle_on(self._family.reset())

    def forget(self) -> None:
        """See :meth:`~.planner.Planner.forget`.

        What the robot adds to dx/dt depends on how its trunk moves. A five-link robot that leans
        for a run to come gains 0.02 m/s in each walking step; after the run it stands up, and
        loses up to 0.04 m/s. What it adds to y and dy/dt is much the same.
        """
        self.offset = self.offset * _KEPT
        self._aim(self._settling @ self.offset)

    def on_slope(self, slope: float) -> SlipParameters:
        """See :meth:`~.planner.Planner.on_slope`; without a gait there the ground is level."""
        if slope != self._slope:
            self._slope = slope
            self._settle_on(self.gait)
        return self._here.parameters

    def _aim(self, shift: Array) -> None:
        """Make the linear law about the fixed point the robot has with the present offset.

        Its ``shift`` (3 + c,) so far is where it is looked for.
        """
        p, o, slots = self._here.parameters, self.options, self._slots
        shift = self._shift = self._settled(shift)
        nominal, others = self._here.controls[slots] / self._units, len(slots) - 1
        steps = _SECOND_PUSH_OFF_STEPS if self._pushes else _SECOND_STEPS
        self._law = Law(
            target=self._here.vlo + shift[:3],
            control=nominal + shift[3:],
            gain=self._gain,
            cost=self._cost,
            offset=self.offset,
            lower=np.array([nominal[0] + ANGLE_RANGE[0], *[STIFFNESS_RANGE[0]] * others]),
            upper=np.array([nominal[0] + ANGLE_RANGE[1], *[STIFFNESS_RANGE[1]] * others]),
            slots=np.array(slots),
            second_steps=np.add(steps, (nominal[0], *[0.0] * others)),
            trusted_price=o.trusted_price,
            effort=EFFORT * self._costs,
            highest=p.rest_length + _FLIGHT * self._scale.length,
            earliest=min(o.earliest_touchdown, o.earliest_share * self.gait.step_duration),
            stiffness=p.leg_stiffness,
            knee_reach=KNEE_STRAIGHT * self._scale.length,
            knee_moment=self._knee_moment,
            knee_price=o.knee_load_price,
            kernel=self._map.kernel[0],
        )

    def _settled(self, shift: Array) -> Array:
        """(3 + c,) shift of the fixed point by the present offset.

        With push-off the map counts as it is about the shift so far, not as it is about the gait:
        there are gaits near which a small offset asks for so much of the controls that the linear
        map's fixed point is none. No offset would ever be learnt from that.
        """
        linear: Array = self._settling @ self.offset
        if not self._pushes:
            return linear
        slots, units, tolerance = self._slots, self._units, np.array(self.options.tolerance)
        for _ in range(_ROUNDS):
            z, u = self._here.vlo + shift[:3], self._here.controls.copy()
            u[slots] += shift[3:] * units
            here = self._map.linearise(z, u)
            if here.outcome is not Outcome.SECTION:
                return linear
            a, b = here.state_jacobian, here.control_jacobian[:, slots] * units
            rest = here.state + self.offset - z + shift[:3] - a @ shift[:3] - b @ shift[3:]
            shift = settling_map(a, b, tolerance, self._change_weight) @ rest
        return shift

    def decide(self, context: Context) -> Decision:
        """See :meth:`~.planner.Planner.decide`; the stride is a walking step from VLO to VLO.

        The law leads to the symmetric gait with the target's speed, and with that gait's
        height. Where no gait is that slow or fast it leads to the nearest, and the decision is
        not nominal.
        """
        gait, reachable = self._family.towards(self.gait, context.target)
        if gait is not self.gait:
            self._settle_on(gait)
        angles, lower, upper = context.angles, self._law.lower.copy(), self._law.upper.copy()
        lower[0] = min(max(lower[0], angles[0]), upper[0])
        upper[0] = max(min(upper[0], angles[1]), lower[0])
        law = self._law._replace(lower=lower, upper=upper)
        u, first = np.empty(len(lower)), np.empty(3)
        cost, own = choose(law, self._map.work.scratch, context.z, u, first)
        controls = self._here.controls.copy()
        controls[self._slots] = u * self._units
        nominal = own and reachable
        return Decision(controls, first, cost < 2.0 * FALL_PRICE, cost < FALL_PRICE, nominal)

    def cost(self, z: Array) -> float:
        """See :meth:`~.planner.Planner.cost`: with the step after the next."""
        u, first = np.empty(len(self._slots)), np.empty(3)
        return float(choose(self._law, self._map.work.scratch, z, u, first)[0])

    def decide_rest(self, context: RestContext) -> Decision | None:
        """See :meth:`~.planner.Planner.decide_rest`; nothing breaks into a walking step.

        Without push-off there is too little to choose. With it, the end has the least cost-to-go,
        and the controls the least change. The offset is still learnt from the whole step: its
        prediction moves by as much as the choice does.
        """
        decision, law = context.decision, self._law
        if context.cause is Cause.RECOVERY:
            return None
        if not self._pushes:
            return decision
        ahead, controls = context.ahead, decision.controls
        before, outcome = ahead(controls)
        completed = outcome is Outcome.SECTION
        slow = before[0] < law.target[0] if completed else outcome is not Outcome.UNWANTED_FLIGHT
        softest = _SOFTEST_REST if slow else 0.0
        places = [place for place, slot in enumerate(law.slots) if place and slot in context.free]
        slots = [int(law.slots[place]) for place in places]
        change = law.stiffness / np.sqrt(self._costs[places])
        lower = np.maximum(law.lower[places], softest) * law.stiffness
        upper = law.upper[places] * law.stiffness
        table = np.array([controls[slots], change, lower, upper])
        # What the robot adds to a step has mostly come in by then. The cost-to-go of the end is the
        # square of its length times this.
        root: Array = np.linalg.cholesky(law.cost).T.astype(np.float64)
        prior = Prior(controls, slots, table, Search(_REST_ROUNDS))
        u, end = solve_stride(ahead, law.target, prior, root)
        if end is None:
            return replace(decision, feasible=False, nominal=False)
        if not completed:
            return Decision(u, end, True, True, False)
        return replace(decision, controls=u, predicted=decision.predicted + (end - before))

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal steps change the offset."""
        if not (decision.feasible and decision.nominal):
            return  # far from the gait the surprise says little about it
        unit, surprise = self._scale.state, z - decision.predicted
        limits = _SURPRISE_BOUND * unit, _OFFSET_BOUND * unit
        self.offset = learnt(self.offset, surprise, self.options.offset_gain, limits)
        self._aim(self._shift)
