"""Running planner: the next apex is the target, as far as moderate controls reach it.

One stride ahead, least squares on the exact map: errors of the apex against changes of the
controls, the regularised form of (36). Controls change from those of a gait near the present
speed; a target far from it is approached step by step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Index, Interval, NotNegative, Positive, Share
from template_control.compiled import compiled
from template_control.embedding.planners.planner import ANY_ANGLE, Decision
from template_control.embedding.planners.stride_solver import (
    FromSection,
    NearbyStrides,
    Prior,
    solve_within_reach,
)
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.gaits.running_gait import RunningFamily, RunningGait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED
from template_control.slip.similarity import LENGTH, SPEED, Scale, scaled, tuned

Array = NDArray[np.float64]

_SAME = 1e-9  # rounding [m/s, m]


class RunningLimits(NamedTuple):
    """The numbers of a running planner; compiled code takes a plain tuple of them.

    Attributes:
        rest_length: l0 [m].
        top_margin: alpha stays this far [rad] below asin(y / l0).
        flatter, steeper: least and greatest alpha, relative to the gait's [rad].
        softest, stiffest: least and greatest stiffness, over the gait's.
        turn, sooner, later: changes of alpha [rad], k_sc and k_sd (shares) that count as 1.
        faster, higher, slower, lower: how far the aim may be from the present apex [m/s, m].
    """

    rest_length: float
    top_margin: float
    flatter: float
    steeper: float
    softest: float
    stiffest: float
    turn: float
    sooner: float
    later: float
    faster: float
    higher: float
    slower: float
    lower: float


@compiled
def aim_and_bounds(
    z: Array,
    wanted: Array,
    offset: Array,
    legs: Array,
    angles: tuple[float, float],
    limits: tuple[float, ...],
) -> tuple[Array, Array, bool]:
    """Where the template's stride is to end, and the controls that it may have.

    Args:
        z: (2,) apex that the stride begins at, dx/dt and y [m/s, m].
        wanted: (2,) apex that the route asks for.
        offset: (3,) what the robot adds to the template's next apex.
        legs: (3,) alpha [rad], k_sc and k_sd [N/m] of the gait near the present speed.
        angles: least and greatest alpha that the swing foot can still reach [rad].
        limits: of :class:`RunningLimits`.

    Returns:
        (2,) the aim, less the offset; (4, 3) of a :class:`~.stride_solver.Prior`; whether the aim
        is what was wanted.
    """
    l0, margin, flatter, steeper, softest, stiffest = limits[:6]
    turn, sooner, later, faster, higher, slower, lower = limits[6:]
    goal, table = np.empty(2), np.empty((4, 3))
    at_target = True
    for i in range(2):
        up, down = (faster, slower) if i == 0 else (higher, lower)
        aim = min(max(wanted[i], z[i] - down), z[i] + up)
        at_target = at_target and abs(wanted[i] - aim) < _SAME
        goal[i] = aim - offset[i]
    top = np.arcsin(min(z[1] / l0, 1.0)) - margin
    table[1, 0] = turn
    table[2, 0] = min(max(min(legs[0] + flatter, top), angles[0]), angles[1], top)
    table[3, 0] = min(max(min(legs[0] + steeper, top), angles[0]), angles[1], top)
    for i in range(1, 3):
        table[1, i] = (sooner if i == 1 else later) * legs[i]
        table[2, i], table[3, i] = softest * legs[i], stiffest * legs[i]
    for i in range(3):
        table[0, i] = min(max(legs[i], table[2, i]), table[3, i])
    return goal, table, at_target


_SLOTS = [int(Slot.TOUCHDOWN_ANGLE), int(Slot.K_SC), int(Slot.K_SD)]  # the first three


@dataclass(frozen=True)
class RunningOptions(Checked):
    """Tuning of the running planner.

    Attributes:
        tolerance: errors of dx/dt and y at the next apex that count as 1.
        change: changes of alpha [rad], k_sc and k_sd (shares of the gait's) that count as 1.
        angle_range: alpha relative to the gait's [rad]. A flatter leg brakes with forces that the
            hips cannot bear.
        stiffness_range: k_sc and k_sd over the gait's.
        top_margin: alpha stays this far [rad] below asin(y / l0), the angle at which the foot
            would touch down at once.
        pace: the speed aimed at is at most this far from the present one.
        brake: below the present one at most this far; None: as ``pace``.
        miss: where a stride would miss the speed aimed at by more than this, and by more than half
            of the change, a smaller change is tried.
        climb: the height aimed at is at most this far from the present one.
        offset_gain: share of a stride's surprise that enters the offset estimate.
        offset_bound: largest offset believed.
        surprise_bound: a larger surprise counts as this much: a push is no offset.
        rounds: Gauss-Newton steps.
        near: in a steady run, a state that is this many tolerances from that of a stride which is
            solved already is solved to first order about it; 0: every stride is solved anew.
    """

    kind: ClassVar[str] = "deadbeat"

    tolerance: tuple[Positive, Positive] = tuned((0.02, 0.004), SPEED, LENGTH)
    change: tuple[Positive, Positive, Positive] = tuned((0.02, 0.15, 0.15))
    angle_range: Interval = tuned((-0.1, 0.1))
    stiffness_range: Interval = tuned((0.6, 1.6))
    top_margin: NotNegative = tuned(0.005)
    pace: Positive = tuned(0.09, SPEED)
    brake: Positive | None = tuned(None, SPEED)
    miss: Positive = tuned(0.1, SPEED)
    climb: Positive = tuned(0.02, LENGTH)
    offset_gain: Share = tuned(0.2)
    offset_bound: tuple[NotNegative, NotNegative] = tuned((0.3, 0.03), SPEED, LENGTH)
    surprise_bound: tuple[NotNegative, NotNegative] = tuned((0.06, 0.008), SPEED, LENGTH)
    rounds: Index = tuned(4)
    near: NotNegative = tuned(0.5)


AGILE = RunningOptions(
    change=(0.03, 0.3, 0.3),
    stiffness_range=(0.4, 2.5),
    pace=0.45,
    brake=0.35,
    rounds=10,
    near=0.0,
)
"""For great accelerations: the legs change their stiffness further. Motors are at their limits,
where the smallest difference counts."""


class RunningPlanner:
    """min |(P(z, u) + d - z*) / tolerance|^2 + |(u - u_g) / change|^2 over bounded u.

    Args:
        gait: to settle on.
        options: tuning.

    Attributes:
        gait: the one of the last target.
        offset: (3,) the estimate of d.
    """

    @checked
    def __init__(self, gait: RunningGait, options: RunningOptions | None = None) -> None:
        self.gait = gait
        self.options = scaled(options or RunningOptions(), Scale.of(gait.parameters))
        self.offset: Array = np.zeros(PADDED)
        self._family = RunningFamily(gait)
        self._map = ReturnMap(gait.parameters, gait.stride)
        o = self.options
        self._grid = 0.5 * o.pace
        slower = o.pace if o.brake is None else o.brake
        ranges = *o.angle_range, *o.stiffness_range, *o.change
        reach = o.pace, o.climb, slower, o.climb
        limits = RunningLimits(gait.parameters.rest_length, o.top_margin, *ranges, *reach)
        self._limits = tuple(map(float, limits))
        self._strides = NearbyStrides(np.array(o.tolerance), o.near)
        # Compile now what a stride would otherwise wait for.
        self.decide(gait.apex)

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for, without an offset."""
        self.offset = np.zeros(PADDED)
        self.gait = self._family.reset()
        self._strides.forget()

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :meth:`~.planner.Planner.decide`; the stride is a running step from apex to apex."""
        if target is not None and target[0] != self.gait.apex[0]:
            self.gait = self._family.at(float(target[0]))
        wanted = self.gait.apex if target is None else target
        near = self._near(z, wanted)
        legs = near.controls[: len(_SLOTS)]
        numbers = wanted, self.offset, legs, angles, self._limits
        goal, table, at_target = aim_and_bounds(z, *numbers)
        prior = Prior(near.controls, _SLOTS, table, self.options.rounds)
        stride = FromSection(self._map, z, _SLOTS)

        def solve(goal: Array) -> tuple[Array, Array | None]:
            return self._strides.solve(stride, goal, prior)

        u, end = solve_within_reach(solve, z, goal, self.options.miss)
        completed = end is not None
        predicted = self.offset.copy()
        predicted[:2] += z if end is None else end
        return Decision(u, predicted, completed, completed, completed and at_target)

    def _near(self, z: Array, wanted: Array) -> RunningGait:
        """The gait about which the controls change, near the present speed."""
        if abs(wanted[0] - z[0]) <= self.options.pace:
            return self._family.at(float(wanted[0]))
        return self._family.at(self._grid * round(float(z[0]) / self._grid))

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal strides teach."""
        if not (decision.feasible and decision.nominal):
            return
        o, come, told = self.options, z.tolist(), decision.predicted.tolist()
        for i, (limit, bound) in enumerate(zip(o.surprise_bound, o.offset_bound, strict=True)):
            surprise = min(max(come[i] - told[i], -limit), limit)
            offset = self.offset.item(i) + o.offset_gain * surprise
            self.offset[i] = min(max(offset, -bound), bound)
