"""Running planner: the next apex is the target, as far as moderate controls reach it.

One stride ahead, least squares on the exact map: errors of the apex against changes of the
controls, the regularised form of (36). Controls change from those of a gait near the present
speed; a target far from it is approached step by step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Index, Interval, NotNegative, Positive, Share
from template_control.embedding.planners.nearby import NearbyStrides
from template_control.embedding.planners.planner import ANY_ANGLE, Decision
from template_control.embedding.planners.regularised import FromSection, Prior
from template_control.embedding.planners.running_limits import RunningLimits, aim_and_bounds
from template_control.embedding.planners.within_reach import solve_within_reach
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.gaits.running_gait import RunningFamily, RunningGait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED
from template_control.slip.similarity import LENGTH, SPEED, Scale, scaled, tuned

Array = NDArray[np.float64]

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
