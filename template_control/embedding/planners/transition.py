"""Planner of a stride that leads from one gait to the other, (39) to (44).

Least squares on the exact map, as (41) and (44), but against moderate controls: the exact
solutions ask for legs of up to 110 kN/m, which no knee can be. What such a stride misses of its
target, the next gait's planner makes good.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from template_control.arrays import Array, BoolArray, Pair
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Interval, Positive
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    Planner,
    RestContext,
    decided,
)
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.control.least_squares import Search
from template_control.slip.control.stride_solver import Prior, StrideEnd, solve_stride, whole
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.similarity import Scale, scaled, tuned

_LEGS = (Slot.K_SC, Slot.K_SD)  # of a gait, before and after the bottom
TOLERANCE = np.array([0.05, 0.01, 0.1])
"""Errors of dx/dt, y, dy/dt at the end that count as 1 [m/s, m, m/s], of the reference."""
_TOP_MARGIN = 0.005  # of alpha below asin(y / l0), at which the foot would touch down at once [rad]
_SEARCH = Search(rounds=6)
# When a foot has landed: shares of the stiffnesses chosen before.
_AGAIN = 0.3  # change that counts as 1
_AGAIN_BOUNDS = (0.5, 2.0)
# Where the robot breaks into the stride.
_BROKEN_TURN = 0.05  # change of alpha that counts as 1 [rad]
_BROKEN_ANGLES = (-0.2, 0.1)  # of alpha, relative to the gait's [rad]
_BROKEN_BOUNDS = (0.35, 2.0)  # of the stiffnesses, over those of the gait that it leads to


@dataclass(frozen=True)
class TransitionOptions(Checked):
    """Tuning of a transition's planner.

    Attributes:
        slots: the controls that are free.
        base: what they change from: alpha [rad], and stiffnesses over m g / l0.
        change: changes of each that count as 1 [rad, shares of the base].
        bounds: of each: alpha relative to the base [rad], shares of the base.

    Raises:
        ParameterError: if there are not as many of each as there are free controls.
    """

    slots: tuple[Slot, ...] = tuned((Slot.K_SC_WR, Slot.K_SD_WR))
    base: tuple[Positive, ...] = tuned((12.2, 20.8))
    change: tuple[Positive, ...] = tuned((0.3, 0.3))
    bounds: tuple[Interval, ...] = tuned(((0.5, 2.0), (0.5, 2.0)))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("base", "change", "bounds"):
            entries = len(getattr(self, name))
            if entries != len(self.slots):
                raise ParameterError(
                    f"TransitionOptions.{name} has {entries} entries: give {len(self.slots)}, one"
                    " for each slot"
                )


WALK_TO_RUN = TransitionOptions()
"""The front leg's stiffnesses; angle and rear leg are those of the walk, as in Section IV-C1."""

RUN_TO_WALK = TransitionOptions(
    slots=(Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD),
    base=(1.34, 24.0, 20.0),
    change=(0.05, 0.3, 0.3),
    bounds=((-0.12, 0.1), (0.5, 2.0), (0.5, 2.0)),
)
"""Angle and both stiffnesses, as in Section IV-C2."""


class TransitionPlanner(Planner):
    """Planner of a stride from one gait to another.

    It minimises over bounded u::

        |(P(z, u) - z*) / tolerance|^2 + |(u - u_0) / change|^2

    Args:
        stride: kind of the stride, a key of the automaton's ``starts``.
        before: planner of the gait that the stride begins in. Controls that are not free are those
            of its stride from the same state.
        after: makes the gait that it leads to, from dx/dt at its section [m/s].
        options: tuning.

    Attributes:
        gait: the one of the last target.
    """

    @checked
    def __init__(
        self,
        stride: str,
        before: Planner,
        after: Callable[[float], Gait],
        options: TransitionOptions,
    ) -> None:
        self._before, self._after = before, after
        p = before.gait.parameters
        scale = Scale.of(p)
        self.options = scaled(options, scale)
        self._weights = np.diag(1.0 / (TOLERANCE * scale.state))
        self._map = ReturnMap(p, stride)
        self.gait = self._first = after(float(before.gait.state[0]))

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for."""
        self.gait = self._first

    def decide(self, context: Context) -> Decision:
        """See :meth:`~.planner.Planner.decide`."""
        z, target, angles, *_ = context
        if target is not None and target[0] != self.gait.state[0]:
            self.gait = self._after(float(target[0]))
        wanted = self.gait.state if target is None else target
        return self._solved(whole(self._map, z), wanted, self._prior(z, angles))

    def decide_rest(self, context: RestContext) -> Decision:
        """See :meth:`~.planner.Planner.decide_rest`."""
        if context.cause is Cause.RECOVERY:
            prior = self._broken_into(context)
        else:
            controls = context.decision.controls
            slots = [slot for slot in context.free if slot != Slot.TOUCHDOWN_ANGLE]
            base, (low, high) = controls[slots], _AGAIN_BOUNDS
            table = np.array([base, _AGAIN * base, low * base, high * base])
            prior = Prior(controls, slots, table, _SEARCH)
        return self._solved(context.ahead, context.target, prior)

    def _broken_into(self, context: RestContext) -> Prior:
        """From another stride. u_0 is the next gait's; what is not free here stays."""
        gait, u = self._after(float(context.target[0])), context.decision.controls.copy()
        own = [slot for slot in self.options.slots if slot != Slot.TOUCHDOWN_ANGLE]
        chosen = {Slot.TOUCHDOWN_ANGLE: Slot.TOUCHDOWN_ANGLE} | dict(zip(own, _LEGS, strict=False))
        slots = [slot for slot in context.free if slot in chosen]
        base, turns = gait.controls[[chosen[Slot(slot)] for slot in slots]], _turns(slots)
        now, wanted = float(u[Slot.TOUCHDOWN_ANGLE]), gait.controls[Slot.TOUCHDOWN_ANGLE]
        flattest = max(now - context.turn, min(now, wanted + _BROKEN_ANGLES[0]))
        steepest = min(now + context.turn, max(now, wanted + _BROKEN_ANGLES[1]))
        softest, stiffest = _BROKEN_BOUNDS
        lower = np.where(turns, flattest, softest * base)
        upper = np.where(turns, steepest, stiffest * base)
        base = np.clip(base, lower, upper)
        change = np.where(turns, _BROKEN_TURN, _AGAIN * base)
        u[own] = gait.controls[[chosen[slot] for slot in own]]
        return Prior(u, slots, np.array([base, change, lower, upper]), _SEARCH)

    def _solved(self, stride: StrideEnd, wanted: Array, prior: Prior) -> Decision:
        size = len(wanted)
        u, end = solve_stride(stride, wanted, prior, self._weights[:size, :size])
        predicted = self._map.sections[1].padded(wanted if end is None else end)
        return Decision(u, predicted, end is not None, end is not None, False)

    def _prior(self, z: Array, angles: Pair) -> Prior:
        o, p = self.options, self._before.gait.parameters
        slots, turns = [int(slot) for slot in o.slots], _turns(o.slots)
        base = np.array(o.base) * np.where(turns, 1.0, p.mass * p.gravity / p.rest_length)
        low, high = np.array(o.bounds).T
        lower = np.where(turns, base + low, base * low)
        upper = np.where(turns, base + high, base * high)
        controls = decided(self._before, Context(z)).controls.copy()
        if angles[0] == angles[1]:
            controls[Slot.TOUCHDOWN_ANGLE] = angles[0]
            lower[turns] = upper[turns] = angles[0]
        top = np.arcsin(min(z[1] / p.rest_length, 1.0)) - _TOP_MARGIN
        upper[turns] = np.minimum(upper[turns], top)
        lower[turns] = np.minimum(lower[turns], upper[turns])
        change = np.array(o.change) * np.where(turns, 1.0, base)
        table = np.array([np.clip(base, lower, upper), change, lower, upper])
        return Prior(controls, slots, table, _SEARCH)


def _turns(slots: Sequence[int]) -> BoolArray:
    """(f,) which of the controls is the touchdown angle."""
    return np.array(slots) == Slot.TOUCHDOWN_ANGLE
