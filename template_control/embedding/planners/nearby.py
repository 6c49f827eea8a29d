"""A stride close to one that is solved already: the same least squares, on that one's derivatives.

In a run that goes on as it did, states change by millimetres and mm/s from decision to decision.
The map's derivatives at one solution then serve many; they are most of a solution's cost. Where a
run is to change its speed, or was pushed, every stride is solved on its own.
"""

from __future__ import annotations

from collections import deque
from operator import gt, lt, sub

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.gauss_newton import Linear, improve
from template_control.embedding.planners.regularised import FromSection, Prior, solve_stride
from template_control.slip.maps.section import PADDED

Array = NDArray[np.float64]

_STEADY = 1.5  # a run that is to change its state by this many tolerances is not steady
_TURN = 0.3  # controls this far from a solution's, in units of change, are another stride's
_KEPT = 4  # solutions: of the stride that begins, as its foot lands, of the next, and one to come


class _Solution:
    """A stride that was solved; its derivatives are not taken before a second one comes near."""

    def __init__(self, z: Array, u: Array, turns: bool, tolerance: Array) -> None:
        self.z, self.u, self.turns = z, u, turns
        self.place: list[float] = (z / tolerance).tolist()
        self.linear: Linear | None = None

    def about(self, stride: FromSection) -> Linear:
        """To first order."""
        if self.linear is None:
            step, n, slots = stride.step, len(self.z), stride.slots
            m, columns = step.dimensions[1], np.array([*range(n), *(PADDED + s for s in slots)])
            end, jacobian, _ = step.derivatives(self.z, self.u, columns)
            by_state, by_controls = jacobian[:m, :n].copy(), jacobian[:m, n:].copy()
            self.linear = Linear(self.z, self.u[slots], end[:m], by_state, by_controls)
        return self.linear


class NearbyStrides:
    """Solves strides, and keeps the last solutions.

    Args:
        tolerance: (m,) errors at the end that count as 1. The section that a stride begins at is
            that which it ends at.
        near: a state that is this many tolerances away is another stride's; 0: every one is.
    """

    def __init__(self, tolerance: Array, near: float) -> None:
        self.tolerance = tolerance
        self.near = near
        self._steady: list[float] = (_STEADY * tolerance).tolist()
        self._known: deque[_Solution] = deque(maxlen=_KEPT)

    def forget(self) -> None:
        """Solve the next stride on its own."""
        self._known.clear()

    def solve(self, stride: FromSection, aim: Array, prior: Prior) -> tuple[Array, Array | None]:
        """As :func:`~.planners.regularised.solve_stride`.

        Args:
            stride: its P.
            aim: (m,) where the stride should end.
            prior: the free controls.
        """
        change = map(abs, (aim - stride.z).tolist())
        if not all(map(lt, change, self._steady)):
            return solve_stride(stride, aim, prior, self.tolerance)
        turns = all(map(gt, prior.upper.tolist(), prior.lower.tolist()))
        known = self._nearest(stride.z, turns)
        found = known and self._nearby(known.about(stride), stride.z, aim, prior)
        if found:
            return found
        u, end = solve_stride(stride, aim, prior, self.tolerance)
        if end is not None:
            self._known.append(_Solution(stride.z.copy(), u.copy(), turns, self.tolerance))
        return u, end

    def _nearest(self, z: Array, turns: bool) -> _Solution | None:
        least, best = self.near, None
        here = (z / self.tolerance).tolist()
        for known in self._known:
            if known.turns is turns:
                away = max(map(abs, map(sub, here, known.place)))
                if away < least:
                    least, best = away, known
        return best

    def _nearby(
        self, linear: Linear, z: Array, aim: Array, prior: Prior
    ) -> tuple[Array, Array] | None:
        """On the derivatives of a solution that is known; None where they do not hold."""
        _, turn, x, end = improve(tuple(linear), z, aim, self.tolerance, prior.table)
        if turn > _TURN:
            return None
        u = prior.controls.copy()
        for slot, value in zip(prior.slots, x.tolist(), strict=True):
            u[slot] = value
        return u, end
