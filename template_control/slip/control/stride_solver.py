"""Controls of one stride: bounded least squares on a return map, the optimisation problem (36).

The paper's controllers look for a target and nothing else; planners weigh it against changes of the
controls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numba import types

from template_control.arrays import Array, IntArray
from template_control.compiled import inner_by_type
from template_control.slip.automaton.vocabulary import MapKind, Outcome, Slot
from template_control.slip.control.least_squares import Search, evaluate, least_squares, slopes
from template_control.slip.control.modified_walking import (
    NO_AIM,
    Aim,
    modified_jacobian,
    modified_step,
)
from template_control.slip.dynamics.model import Kernel
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.maps.return_map import RESULTS, Derivatives, MapWorkspace, ReturnMap
from template_control.slip.maps.section import PADDED, section_of

LEAST_PULL = 1e-6
"""Weight of changes where only the target counts: what changes nothing is left alone."""


class StrideEnd(NamedTuple):
    """Map from the controls of a stride, or of the rest of one that has begun, to its end.

    The first three fields are arguments of
    :func:`~template_control.slip.maps.return_map.one_stride`.
    """

    kernel: Kernel
    kind: int
    start: Array
    ends: IntArray  # (m,) which of the map's results are its end
    work: MapWorkspace
    energy: Aim = NO_AIM  # by which kappa_2 is chosen, (38)

    def __call__(self, u: Array) -> tuple[Array, Outcome]:
        """(m,) where it ends, and how, with (NUM_SLOTS,) controls ``u``; (38) completes them."""
        result = np.empty(RESULTS)
        outcome = modified_step(*self[:3], self.energy, u, self.work.scratch, result)
        return result[self.ends], Outcome(outcome)


def whole(step: ReturnMap, z: Array, also: tuple[int, ...] = ()) -> StrideEnd:
    """A whole stride from z (n,), whose end has ``also`` these of the map's results."""
    ends = np.array([*range(step.dimensions[1]), *also])
    return StrideEnd(*step.kernel, step.sections[0].padded(z), ends, step.work)


def rest(
    simulator: StrideSimulator,
    node: str,
    state: Sequence[float] | Array,
    toes: Sequence[float] | Array,
    work: MapWorkspace,
) -> StrideEnd:
    """The rest of a stride from a node on, where ``state`` (4,) and ``toes`` (2,) are its own."""
    x, y, dx, dy = state
    start, end = np.array([dx, y, dy, x, *toes]), simulator.automaton.sections(node)[1]
    ends = np.arange(section_of(end).dimension)
    return StrideEnd(simulator.kernel(node), int(MapKind.EXACT), start, ends, work)


class StrideProblem(NamedTuple):
    """Least |W (P(x) - aim)|^2 + |pull (x - base) / change|^2 by a stride's free controls x."""

    stride: StrideEnd  # P
    aim: Array  # (m,) where it should end
    weights: Array  # (m, m) W
    controls: Array  # (NUM_SLOTS,) u, of which the free ones are overwritten
    slots: IntArray  # (f,) of the free ones, whose the next four are
    base: Array
    change: Array
    lower: Array
    upper: Array
    pull: float  # weight of their changes
    result: Array  # (RESULTS,) overwritten
    columns: IntArray  # (f,) of the map's derivatives, and one more of a kappa_2 by (38)
    jacobian: Array  # (RESULTS, f) of these, overwritten


def of_type(problem: Any, kind: type) -> bool:
    """True if a compiled argument is a named tuple of this class."""
    return isinstance(problem, types.BaseNamedTuple) and problem.instance_class is kind


@inner_by_type(evaluate)
def _stride_evaluate(problem: Any, x: Any, residual: Any) -> Any:
    """:func:`~.least_squares.evaluate` of a :class:`StrideProblem`."""

    def at(problem: Any, x: Any, residual: Any) -> Any:
        p, ends = problem, problem.stride.ends
        m = ends.shape[0]
        for i in range(x.shape[0]):
            p.controls[p.slots[i]] = x[i]
        s, scratch = p.stride, p.stride.work.scratch
        outcome = modified_step(s.kernel, s.kind, s.start, s.energy, p.controls, scratch, p.result)
        if outcome != Outcome.SECTION:
            return np.inf
        total = 0.0
        for i in range(m):
            residual[i] = 0.0
            for j in range(m):
                residual[i] += p.weights[i, j] * (p.result[ends[j]] - p.aim[j])
        for i in range(x.shape[0]):
            residual[m + i] = p.pull * ((x[i] - p.base[i]) / p.change[i])
        for i in range(m + x.shape[0]):
            total += residual[i] * residual[i]
        return total

    return at if of_type(problem, StrideProblem) else None


@inner_by_type(slopes)
def _stride_slopes(problem: Any, x: Any, rows: Any) -> Any:
    """:func:`~.least_squares.slopes` of a :class:`StrideProblem`."""

    def at(problem: Any, x: Any, rows: Any) -> Any:
        p, s, ends = problem, problem.stride, problem.stride.ends
        m = ends.shape[0]
        found = Derivatives(p.result, p.jacobian)
        at = s.kernel, s.kind, s.start
        modified_jacobian(at, s.energy, p.controls, p.columns, s.work, found)
        for c in range(x.shape[0]):
            for i in range(m):
                rows[i, c] = 0.0
                for j in range(m):
                    rows[i, c] += p.weights[i, j] * p.jacobian[ends[j], c]
            for i in range(x.shape[0]):
                rows[m + i, c] = 0.0
            rows[m + c, c] = p.pull / p.change[c]

    return at if of_type(problem, StrideProblem) else None


# Where the target is not reached, steps shrink by a constant factor: what the last one leaves is as
# long as the step. At 1e-9 a return map is too rough for Newton's method to find its fixed point.
TARGET_ONLY = Search(rounds=20, close=1e-11, grid=0, save=1e-15, patience=5)
"""The target, to rounding, whatever the controls are before."""


@dataclass(frozen=True)
class Prior:
    """Controls that a stride would have, were there no target."""

    controls: Array  # (NUM_SLOTS,) u by Slot; those that are not free stay
    slots: Sequence[int]  # the f free ones
    table: Array  # (4, f) of these: values, changes that count as 1, lower and upper bounds
    search: Search  # how far the compromise of target and values is sought
    pull: float = 1.0  # weight of the changes

    def grid(self, points: int) -> Array:
        """(n, f) values of the free controls: so many of each within its bounds."""
        return np.array(list(product(*np.linspace(self.table[2], self.table[3], points).T)))


def solve_stride(
    stride: StrideEnd, aim: Array, prior: Prior, weights: Array
) -> tuple[Array, Array | None]:
    """Solve a :class:`StrideProblem`: the controls (NUM_SLOTS,), and where the stride ends (m,).

    The end is None where none of the controls that were tried completes the stride.
    """
    slots, u = np.array(prior.slots, np.int64), np.array(prior.controls)
    base, change, lower, upper = prior.table
    chosen = [int(Slot.K_SD)] if stride.energy.chooses else []
    columns = PADDED + np.array([*prior.slots, *chosen], np.int64)
    problem = StrideProblem(
        stride=stride,
        aim=aim,
        # Another layout would be compiled anew, in the middle of a run.
        weights=np.ascontiguousarray(weights),
        controls=u,
        slots=slots,
        base=base,
        change=change,
        lower=lower,
        upper=upper,
        pull=prior.pull,
        result=np.empty(RESULTS),
        columns=columns,
        jacobian=np.empty((RESULTS, len(columns))),
    )
    x = base.copy()
    if least_squares(problem, prior.search, np.empty(len(stride.ends) + len(x)), x) < np.inf:
        return u, problem.result[stride.ends]
    u[slots] = base
    return u, None


Solve = Callable[[Array], tuple[Array, Array | None]]
"""Controls and end of a stride for where it should end; the end is None where there is none."""

_MADE = 0.5  # of a change: a stride that makes less of it is not the one that was sought
_SMALLER = 0.7  # of the change asked for before
_TRIES = 2  # as many more solutions a stride may cost


def solve_within_reach(
    solve: Solve, z: Array, aim: Array, least: float
) -> tuple[Array, Array | None]:
    """The stride from ``z`` nearest to the speed of ``aim``, of a few that aim at less.

    One that misses it by less than ``least`` [m/s] stays.
    """
    u, end = solve(aim)
    if end is None:
        return u, end
    change, near = float(aim[0] - z[0]), abs(float(end[0] - aim[0]))
    bound = max(least, (1.0 - _MADE) * abs(change))
    for number in range(_TRIES):
        if near <= bound:
            break
        nearer = aim.copy()
        nearer[0] = z[0] + _SMALLER ** (number + 1) * change
        other, there = solve(nearer)
        if there is not None and abs(there[0] - aim[0]) < near:
            u, end, near = other, there, abs(float(there[0] - aim[0]))
    return u, end
