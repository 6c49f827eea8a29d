"""Running planner: the next apex is the target, as far as moderate controls reach it.

One stride ahead, least squares on the exact map: errors of the apex against changes of the
controls, the regularised form of (36). Controls change from those of a gait near the present
speed; a target far from it is approached step by step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from template_control.arrays import Array, Pair
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Index, Interval, Positive
from template_control.compiled import compiled
from template_control.embedding.planners.planner import Cause, Context, Decision, Planner, learnt
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.control.least_squares import Search
from template_control.slip.control.stride_solver import (
    Prior,
    solve_stride,
    solve_within_reach,
    whole,
)
from template_control.slip.gaits.gait import GaitFamily
from template_control.slip.gaits.running_gait import RunningGait, other_runs
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED
from template_control.slip.similarity import SPEED, Scale, scaled, tuned

_SLOTS = [int(Slot.TOUCHDOWN_ANGLE), int(Slot.K_SC), int(Slot.K_SD)]  # the first three
_SAME = 1e-9  # rounding [m/s, m]
# A flatter leg brakes with forces that the hips cannot bear.
_ANGLE_RANGE = (-0.1, 0.1)  # of alpha relative to the gait's [rad]
_TOP_MARGIN = 0.005  # of alpha below asin(y / l0), at which the foot would touch down at once [rad]
_CLIMB = 0.02  # largest way from the present height to the one aimed at, over l0
# For the reference template: dx/dt and y [m/s, m].
_TOLERANCE = np.array([0.02, 0.004])  # errors at the next apex that count as 1
OFFSET_GAIN = 0.2
"""Share of a stride's surprise that enters the offset estimate."""
_OFFSET_BOUND = np.array([0.3, 0.03])  # largest offset believed
SURPRISE_BOUND = np.array([0.06, 0.008])
"""A larger surprise counts as this much [m/s, m], for the reference template: it is a push."""
# Where a stride would miss the speed aimed at by more than this, and by more than half of the
# change, a smaller change is tried.
_MISS = 0.1  # [m/s], for the reference template


@compiled
def leg_bounds(
    z: Array,
    legs: Array,
    angles: Pair,
    rest_length: float,
    change: tuple[float, float, float],
    stiffness_range: Pair,
) -> Array:
    """Controls (4, 3) of a :class:`~.stride_solver.Prior` about a gait's.

    Compiled: a run plans three times a stride, and each plan decides on two strides. ``z`` (2,) is
    the apex that the stride begins at, ``legs`` (3,) alpha [rad], k_sc and k_sd [N/m] of the gait
    near the present speed; ``angles`` the foot can still reach; ``change`` and ``stiffness_range``
    as of the options.
    """
    table = np.empty((4, 3))
    top, low = np.pi, 0.0
    if z[1] < rest_length:
        steepest = np.arcsin(z[1] / rest_length) - _TOP_MARGIN
        if legs[0] > 0.5 * np.pi:
            low = np.pi - steepest
        else:
            top = steepest
    table[1, 0] = change[0]
    for i in range(2):
        angle = max(min(legs[0] + _ANGLE_RANGE[i], top), low)
        table[2 + i, 0] = max(min(max(angle, angles[0]), angles[1], top), low)
    for i in range(1, 3):
        table[1, i] = change[i] * legs[i]
        table[2, i], table[3, i] = stiffness_range[0] * legs[i], stiffness_range[1] * legs[i]
    for i in range(3):
        table[0, i] = min(max(legs[i], table[2, i]), table[3, i])
    return table


@dataclass(frozen=True)
class RunningOptions(Checked):
    """Tuning of the running planner.

    Attributes:
        change: changes of alpha [rad], k_sc and k_sd (shares of the gait's) that count as 1.
        stiffness_range: k_sc and k_sd over the gait's.
        pace: the speed aimed at is at most this far from the present one.
        brake: below the present one at most this far; None: as ``pace``.
        rounds: Gauss-Newton steps.
    """

    kind: ClassVar[str] = "deadbeat"

    change: tuple[Positive, Positive, Positive] = tuned((0.02, 0.15, 0.15))
    stiffness_range: Interval = tuned((0.6, 1.6))
    pace: Positive = tuned(0.09, SPEED)
    brake: Positive | None = tuned(None, SPEED)
    rounds: Index = tuned(4)


AGILE = RunningOptions(
    change=(0.03, 0.3, 0.3),
    stiffness_range=(0.4, 2.5),
    pace=0.45,
    brake=0.35,
    rounds=10,
)
"""For great accelerations: the legs change their stiffness further. Motors are at their limits,
where the smallest difference counts."""


class RunningPlanner(Planner):
    """Planner of a run by its controls of one stride.

    It minimises over bounded u::

        |(P(z, u) + d - z*) / tolerance|^2 + |(u - u_g) / change|^2

    Args:
        gait: to settle on.
        options: tuning.

    Attributes:
        gait: the one of the last target.
        offset: (3,) the estimate of d.
    """

    gait: RunningGait

    @checked
    def __init__(self, gait: RunningGait, options: RunningOptions | None = None) -> None:
        self.gait = gait
        self._scale = Scale.of(gait.parameters)
        self.options = scaled(options or RunningOptions(), self._scale)
        self.offset: Array = np.zeros(PADDED)
        self._family = GaitFamily(gait, other_runs)
        self._map = ReturnMap(gait.parameters, gait.stride)
        o = self.options
        self._grid = 0.5 * o.pace
        self._slower = o.pace if o.brake is None else o.brake
        self._climb = _CLIMB * gait.parameters.rest_length
        self._miss = _MISS * self._scale.speed
        self._weights = np.diag(1.0 / (_TOLERANCE * self._scale.state[:2]))
        # Compile now what a stride would otherwise wait for.
        self.decide(Context(gait.apex))

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for, without an offset."""
        self.offset = np.zeros(PADDED)
        self.gait = self._family.reset()

    def decide(self, context: Context) -> Decision:
        """See :meth:`~.planner.Planner.decide`; the stride is a running step from apex to apex."""
        z, target, angles, cause, begun, *_ = context
        if target is not None and target[0] != self.gait.apex[0]:
            self.gait, _ = self._family.towards(self.gait, target)
        wanted = self.gait.apex if target is None else target
        near = self._near(z, wanted)
        goal, at_target = self._aim(z, wanted)
        if cause is Cause.TOUCHDOWN and begun is not None and begun.nominal:
            # What the legs' swing adds to the speed as a foot lands is in the apex from which the
            # template would have come there, and takes no pace: the stride goes where it went.
            goal, at_target = wanted - self.offset[:2], True
        o, length, legs = self.options, near.parameters.rest_length, near.controls[: len(_SLOTS)]
        reach = float(angles[0]), float(angles[1])
        table = leg_bounds(z, legs, reach, length, o.change, o.stiffness_range)
        prior = Prior(near.controls, _SLOTS, table, Search(o.rounds))
        stride = whole(self._map, z)

        def solve(goal: Array) -> tuple[Array, Array | None]:
            return solve_stride(stride, goal, prior, self._weights)

        u, end = solve_within_reach(solve, z, goal, self._miss)
        completed = end is not None
        predicted = self.offset.copy()
        predicted[:2] += z if end is None else end
        return Decision(u, predicted, completed, completed, completed and at_target)

    def _aim(self, z: Array, wanted: Array) -> tuple[Array, bool]:
        """(2,) the template's next apex, less the offset; whether it is what was wanted."""
        speed, height = z.tolist()
        fastest, highest = wanted.tolist()
        fast = min(max(fastest, speed - self._slower), speed + self.options.pace)
        high = min(max(highest, height - self._climb), height + self._climb)
        # On its way down over several strides each teaches what it adds to the height: a robot with
        # 10 % less mass may rise by more in each than the aim comes down.
        at_target = abs(fastest - fast) < _SAME
        return np.array([fast, high]) - self.offset[:2], at_target

    def _near(self, z: Array, wanted: Array) -> RunningGait:
        """The gait about which the controls change, near the present speed."""
        if abs(wanted[0] - z[0]) <= self.options.pace:
            return self._family.towards(self.gait, wanted)[0]
        near = self._grid * round(float(z[0]) / self._grid)
        return self._family.towards(self.gait, [near])[0]

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`; only feasible, nominal strides teach."""
        if not (decision.feasible and decision.nominal):
            return
        unit, surprise = self._scale.state[:2], z[:2] - decision.predicted[:2]
        limits = SURPRISE_BOUND * unit, _OFFSET_BOUND * unit
        self.offset[:2] = learnt(self.offset[:2], surprise, OFFSET_GAIN, limits)
