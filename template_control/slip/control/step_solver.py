"""Least squares for the controls of one stride: the optimisation problem (36)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import leastsq

from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_FAILED = 10.0  # residual of a stride that fails, in each component
_PENALTY = 10.0  # slope of the penalty on a control (in units of its scale) out of bounds
_REAR_BOTTOM = 4  # of a map's results: length of the rear leg at the bottom


@dataclass(frozen=True)
class StepSolution:
    """Controls of one stride, and what they are predicted to do.

    Attributes:
        controls: (NUM_SLOTS,) u by Slot.
        predicted: (m,) state at the next section, on the map the controls were found on.
        residual: root of the weighted sum of squared errors in (36).
        outcome: how the predicted stride ends.
        reached: whether it ends at the target (and, running, at the wanted compression).
    """

    controls: Array
    predicted: Array
    residual: float
    outcome: Outcome
    reached: bool


@dataclass(frozen=True)
class Unknowns:
    """Free slots of the control vector, with ``lower`` and ``upper`` bounds (n,) [rad, N/m].

    ``scale`` (n,) are changes of each that count as equally large [rad, N/m].
    """

    slots: tuple[Slot, ...]
    lower: Array
    upper: Array
    scale: Array


class Step(Protocol):
    """Return map as a controller needs it; ``ReturnMap`` is one.

    ``evaluate`` and ``derivatives`` may complete the controls they are given in place.
    ``dimensions`` are the sizes n and m of the states at the sections a stride starts from and ends
    at.
    """

    parameters: SlipParameters
    dimensions: tuple[int, int]

    def evaluate(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """One stride from z (n,) with controls u (NUM_SLOTS,), by Slot [rad, N/m].

        Returns (RESULTS,) of :func:`~template_control.slip.maps.return_map.section_map`, and its
        outcome.
        """

    def evaluate_many(self, z: Array, u: Array) -> tuple[Array, IntArray]:
        """Strides from one state z (n,) with rows u (count, NUM_SLOTS) of controls.

        Returns (count, RESULTS) as :meth:`evaluate`, and (count,) values of the outcomes.
        """

    def derivatives(self, z: Array, u: Array, columns: IntArray) -> tuple[Array, Array, Outcome]:
        """One stride as :meth:`evaluate`, with (RESULTS, c) derivatives before the outcome.

        ``columns`` (c,) are what to differentiate by: 3 + slot for a control.
        """


class StepProblem:
    """Find the free controls that bring a stride to a target.

    Args:
        step: the return map.
        unknowns: the free controls; bounds are penalised, as the paper does.
        weights: (m,) rho of (36); one more where ``compression`` is given.
        compression: wanted length of the stance leg at the bottom, (34) [m].
        tolerance: residual that counts as reached.
        acceptable: residual below which no further start is tried.
        evaluations: of the map from each start, at most; the default takes about 0.5 ms.
    """

    def __init__(
        self,
        step: Step,
        unknowns: Unknowns,
        weights: Sequence[float] | None = None,
        compression: float | None = None,
        tolerance: float = 1e-3,
        acceptable: float = 0.05,
        evaluations: int = 14,
    ) -> None:
        self.step = step
        self.unknowns = unknowns
        self.compression = compression
        self.tolerance = tolerance
        self.acceptable = acceptable
        self._evaluations = evaluations
        self.size = step.dimensions[1]
        rows = self.size + (compression is not None)
        self._weights = np.sqrt(np.ones(rows) if weights is None else np.asarray(weights))
        self._rows = [*range(self.size)] + ([_REAR_BOTTOM] if compression is not None else [])
        self._slots = np.array([int(s) for s in unknowns.slots])
        self._columns = self._slots + 3
        # Errors are target - result; one row for the compression, none for the penalties.
        self._aim = np.zeros(rows)

    def solve(self, z: Array, target: Array, starts: Sequence[Array]) -> StepSolution:
        """Best controls found from ``starts``, tried in turn until one is acceptable.

        ``z`` (n,) is the state at the section, ``target`` (m,) is wanted at the next; the fixed
        controls are those of the starts (NUM_SLOTS,).
        """
        self._set(target)
        best: StepSolution | None = None
        for start in starts:
            solution = self._descend(z, start)
            if best is None or solution.residual < best.residual:
                best = solution
            if best.residual <= self.acceptable:
                break
        assert best is not None
        if self.tolerance < best.residual <= self.acceptable:
            # Near, but its evaluations were used up, or it came to rest at a bound.
            best = min(best, self._descend(z, best.controls), key=lambda found: found.residual)
        return best

    def costs(self, z: Array, target: Array, grid: Array) -> Array:
        """(count,) weighted squared errors, as in (36), of the rows of ``grid`` (count, NUM_SLOTS).

        ``z`` (n,) is the state at the section, ``target`` (m,) is wanted at the next; inf where the
        stride fails.
        """
        self._set(target)
        results, outcomes = self.step.evaluate_many(z, grid)
        costs = np.sum((self._weights * (self._aim - results[:, self._rows])) ** 2, axis=1)
        costs[outcomes != Outcome.SECTION] = np.inf
        return costs

    def _set(self, target: Array) -> None:
        self._aim[: self.size] = target
        if self.compression is not None:
            self._aim[-1] = self.compression

    def _controls(self, start: Array, x: Array) -> Array:
        """The controls within the bounds that are nearest to ``x``."""
        u, b = start.copy(), self.unknowns
        u[self._slots] = np.clip(x * b.scale, b.lower, b.upper)
        return u

    def _errors(self, x: Array, z: Array, start: Array) -> Array:
        result, outcome = self.step.evaluate(z, self._controls(start, x))
        if outcome is not Outcome.SECTION:
            errors = np.full(len(self._aim), _FAILED)
        else:
            errors = self._weights * (self._aim - result[self._rows])
        return np.concatenate((errors, self._excess(x)))

    def _jacobian(self, x: Array, z: Array, start: Array) -> Array:
        u = self._controls(start, x)
        _, jacobian, outcome = self.step.derivatives(z, u, self._columns)
        slopes = -self._weights[:, None] * jacobian[self._rows] * self.unknowns.scale
        if outcome is not Outcome.SECTION:
            slopes[:] = 0.0
        out = np.sign(self._excess(x))
        slopes[:, out != 0.0] = 0.0  # the map stays what it is at the bound
        return np.vstack((slopes, np.diag(_PENALTY * out * out)))

    def _excess(self, x: Array) -> Array:
        """Penalty of each control out of its bounds."""
        b = self.unknowns
        inside = np.clip(x, b.lower / b.scale, b.upper / b.scale)
        return _PENALTY * (x - inside)

    def _descend(self, z: Array, start: Array) -> StepSolution:
        x0 = start[self._slots] / self.unknowns.scale
        x, *_ = leastsq(
            self._errors,
            x0,
            args=(z, start),
            Dfun=self._jacobian,
            ftol=1e-10,
            xtol=1e-10,
            gtol=1e-12,
            maxfev=self._evaluations,
            full_output=True,
        )
        u = self._controls(start, x)
        result, outcome = self.step.evaluate(z, u)
        error = self._weights * (self._aim - result[self._rows])
        residual = float(np.linalg.norm(error)) if outcome is Outcome.SECTION else np.inf
        return StepSolution(
            u, result[: self.size].copy(), residual, outcome, residual <= self.tolerance
        )
