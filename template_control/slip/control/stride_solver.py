"""Controls of one stride: bounded least squares on a return map, the optimisation problem (36).

The paper's controllers look for a target and nothing else; planners weigh it against changes of the
controls.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from operator import gt, lt, sub
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.cholesky import cholesky, solve_cholesky
from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_NONE = np.int64(0)  # Numba would compile what a literal 0 is handed to for it alone


@compiled
def bounded_step(
    rows: Array, residual: Array, x: Array, lower: Array, upper: Array, damping: float
) -> Array:
    """x + dx with the least |rows dx + residual|^2 + damping |D dx|^2 between the bounds.

    D holds the lengths of the columns of ``rows``: Levenberg's damping in Marquardt's scale; 0 for
    a step of Gauss and Newton. A variable that would leave its bounds is held there, and the others
    are solved for again. ``rows`` (r, f) is the Jacobian of the residual (r,) at x (f,), within the
    bounds.
    """
    size = x.shape[0]
    there = np.empty(size)
    held = np.empty(size, np.bool_)
    for i in range(size):
        there[i] = min(max(x[i], lower[i]), upper[i])
        held[i] = not upper[i] > lower[i]
    normal, right = np.empty((size, size)), np.empty((size, 1))
    free = np.empty(size, np.int64)
    for _ in range(size):
        count = _NONE
        for i in range(size):
            if not held[i]:
                free[count] = i
                count += 1
        if count == 0:
            break
        for a in range(count):
            for b in range(a + 1):
                total = 0.0
                for r in range(rows.shape[0]):
                    total += rows[r, free[a]] * rows[r, free[b]]
                normal[a, b] = total
            normal[a, a] *= 1.0 + damping
            right[a, 0] = 0.0
        for r in range(rows.shape[0]):
            left = residual[r]
            for i in range(size):
                if held[i]:
                    left += rows[r, i] * (there[i] - x[i])
            for a in range(count):
                right[a, 0] -= rows[r, free[a]] * left
        if not cholesky(normal, count):
            break
        solve_cholesky(normal, count, right)
        beyond = False
        for a in range(count):
            i = free[a]
            wish = x[i] + right[a, 0]
            there[i] = min(max(wish, lower[i]), upper[i])
            if there[i] != wish:
                held[i] = beyond = True
        if not beyond:
            break
    return there


class Linear(NamedTuple):
    """A stride to first order about its start z (n,) and free controls x (f,): end (m,), slopes."""

    z: Array
    x: Array
    end: Array
    by_state: Array
    by_controls: Array


@compiled
def improve(
    linear: tuple[Array, Array, Array, Array, Array],
    z: Array,
    aim: Array,
    tolerance: Array,
    prior: Array,
    pull: float,
    damping: float,
) -> tuple[float, float, Array, Array]:
    """One step towards the least |(end - aim) / tolerance|^2 + |pull (x - base) / change|^2.

    ``linear`` is a :class:`Linear`, a plain tuple for compiled code; the stride begins in ``z``
    (n,), near its own; ``prior`` (4, f) is base, change, lower and upper bounds; ``damping`` as for
    :func:`bounded_step`. Returns the cost at x, the longest component of the step in units of its
    change, (f,) the next x, and (m,) where that leads, to first order.
    """
    known, x, end, by_state, by_controls = linear
    m, size = by_controls.shape
    there = np.empty(m)
    rows, residual = np.zeros((m + size, size)), np.empty(m + size)
    cost = 0.0
    for i in range(m):
        there[i] = end[i]
        for j in range(z.shape[0]):
            there[i] += by_state[i, j] * (z[j] - known[j])
        residual[i] = (there[i] - aim[i]) / tolerance[i]
        for j in range(size):
            rows[i, j] = by_controls[i, j] / tolerance[i]
    for j in range(size):
        residual[m + j] = pull * ((x[j] - prior[0, j]) / prior[1, j])
        rows[m + j, j] = pull / prior[1, j]
    for i in range(m + size):
        cost += residual[i] * residual[i]
    better = bounded_step(rows, residual, x, prior[2], prior[3], damping)
    longest = 0.0
    for j in range(size):
        longest = max(longest, abs(better[j] - x[j]) / prior[1, j])
        for i in range(m):
            there[i] += by_controls[i, j] * (better[j] - x[j])
    return cost, longest, better, there


_DIFFERENCE = 1e-6  # of a control
_LESS = 0.1  # of the damping, after a step that lowers the cost; after another one as much more


class Search(NamedTuple):
    """What is sought, and how far.

    Attributes:
        pull: weight of the changes of the controls.
        close: a step this short, in units of change, is the last: what it leaves is its square.
        grid: points of each control that are tried where the base's stride fails; 0: none.
        save: share of the cost that a step has to save for another one.
        patience: steps in a row that may raise the cost, before they are taken back. Where targets
            are met by a curved valley of controls, Newton's method leaves it and finds its end;
            with a cost that always falls it creeps along.
    """

    pull: float
    close: float
    grid: int
    save: float
    patience: int


NEAR_BASE = Search(pull=1.0, close=0.03, grid=5, save=0.0, patience=0)
"""A compromise of the target and the base, as good as a plan needs it."""
TARGET_ONLY = Search(pull=1e-6, close=1e-9, grid=0, save=1e-10, patience=5)
"""The target, to rounding; the pull leaves a control alone that changes nothing."""


@dataclass(frozen=True)
class Prior:
    """Controls that a stride would have, were there no target.

    Attributes:
        controls: (NUM_SLOTS,) u by Slot; those that are not free stay.
        slots: the f free ones.
        table: (4, f) of these: their values, changes that count as 1, lower and upper bounds.
        rounds: Gauss-Newton steps; as many more may be tried again, shorter.
        search: whether the base counts.
    """

    controls: Array
    slots: list[int]
    table: Array
    rounds: int
    search: Search = NEAR_BASE

    @property
    def base(self) -> Array:
        """(f,) values of the free controls."""
        return self.table[0]

    @property
    def change(self) -> Array:
        """(f,) changes that count as 1."""
        return self.table[1]

    @property
    def lower(self) -> Array:
        """(f,) lower bounds."""
        return self.table[2]

    @property
    def upper(self) -> Array:
        """(f,) upper bounds."""
        return self.table[3]

    def grid(self, points: int) -> Array:
        """(n, f) values of the free controls: so many of each within its bounds."""
        axes = [np.linspace(*ends, points) for ends in zip(self.lower, self.upper, strict=True)]
        return np.array(list(product(*axes)))


class Step(Protocol):
    """Return map as this solver needs it; ``ReturnMap`` is one.

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


class EndOfStride(Protocol):
    """Map from the controls of a stride that has begun to its end."""

    def __call__(self, u: Array) -> tuple[Array, Outcome]:
        """(m,) state at the section where it ends, and how, with (NUM_SLOTS,) controls ``u``."""


class StrideEnd(Protocol):
    """Map from the controls of a stride, or of the rest of one, to its end."""

    def at(self, u: Array) -> tuple[Array, Outcome]:
        """(m,) state at the section where it ends, and how, with (NUM_SLOTS,) controls ``u``."""

    def slopes(self, u: Array) -> tuple[Array, Array, Outcome]:
        """As :meth:`at`, with the (m, f) derivatives by the free controls in the middle."""


@dataclass(frozen=True)
class FromSection:
    """A whole stride from z (n,), by free slots of its controls, with exact derivatives.

    Its end has the state at the next section, and ``also`` these of the map's results.
    """

    step: Step
    z: Array
    slots: Sequence[int]
    also: tuple[int, ...] = ()

    @cached_property
    def _ends(self) -> slice | list[int]:
        m = self.step.dimensions[1]
        return [*range(m), *self.also] if self.also else slice(m)

    def at(self, u: Array) -> tuple[Array, Outcome]:
        """See :class:`StrideEnd`."""
        result, outcome = self.step.evaluate(self.z, u)
        return result[self._ends], outcome

    @cached_property
    def columns(self) -> IntArray:
        """Places of the free controls among the map's arguments."""
        return np.array(self.slots) + PADDED

    def slopes(self, u: Array) -> tuple[Array, Array, Outcome]:
        """See :class:`StrideEnd`."""
        result, jacobian, outcome = self.step.derivatives(self.z, u, self.columns)
        return result[self._ends], jacobian[self._ends], outcome


@dataclass(frozen=True)
class FromHere:
    """The rest of a stride, by free slots, with differences: no map begins within one."""

    ahead: EndOfStride
    slots: Sequence[int]

    def at(self, u: Array) -> tuple[Array, Outcome]:
        """See :class:`StrideEnd`."""
        return self.ahead(u)

    def slopes(self, u: Array) -> tuple[Array, Array, Outcome]:
        """See :class:`StrideEnd`."""
        end, outcome = self.ahead(u)
        jacobian = np.zeros((len(end), len(self.slots)))
        for column, slot in enumerate(self.slots):
            changed = u.copy()
            changed[slot] *= 1.0 + _DIFFERENCE
            other, how = self.ahead(changed)
            if how is not Outcome.SECTION:
                return end, jacobian, how
            jacobian[:, column] = (other - end) / (changed[slot] - u[slot])
        return end, jacobian, outcome


def solve_stride(
    stride: StrideEnd, aim: Array, prior: Prior, tolerance: Array
) -> tuple[Array, Array | None]:
    """min |(P(u) - aim) / tolerance|^2 + |pull (u - base) / change|^2 over bounded u.

    ``aim`` (m,) is where the stride should end. Returns (NUM_SLOTS,) controls, and (m,) where the
    stride ends, None where none of those tried completes it.
    """
    u, search = prior.controls.copy(), prior.search
    wish, errors = np.array([aim, tolerance])
    here, by_state = np.empty(0), np.empty((len(wish), 0))  # the state is what it is
    x, damping, least = prior.base, 0.0, np.inf
    best: tuple[Array, ...] | None = None
    left, patience = prior.rounds + 1, search.patience
    for number in range(2 * prior.rounds + 1):
        u[prior.slots] = x
        end, jacobian, outcome = stride.slopes(u)
        cost, less = np.inf, _LESS * damping if damping > _LESS else 0.0
        if outcome is Outcome.SECTION:
            tried = (here, x, end, by_state, jacobian)
            cost, longest, x, _ = improve(tried, here, wish, errors, prior.table, search.pull, less)
        elif best is None:
            if number:
                break
            x = _from_grid(stride, aim, prior, tolerance)
            continue
        if cost < least:
            enough = least - cost < search.save * cost
            best, least, damping, left = tried, cost, less, left - 1
            patience = search.patience
            if left == 0 or enough:
                break
        elif patience and longest > search.close and cost < np.inf:
            patience -= 1
        else:
            damping = max(damping / _LESS, 1.0)
            _, longest, x, _ = improve(best, here, wish, errors, prior.table, search.pull, damping)
        if longest < search.close:
            u[prior.slots] = x
            end, outcome = stride.at(u)
            if outcome is Outcome.SECTION:
                return u, end
            break
    u[prior.slots] = prior.base if best is None else best[1]
    return u, None if best is None else best[2]


def _from_grid(stride: StrideEnd, aim: Array, prior: Prior, tolerance: Array) -> Array:
    """The best of a grid within the bounds; the base where all of it fails."""
    u = prior.controls.copy()
    best, least = prior.base, np.inf
    for x in prior.grid(prior.search.grid):
        u[prior.slots] = x
        end, outcome = stride.at(u)
        if outcome is Outcome.SECTION:
            residual = np.concatenate(((end - aim) / tolerance, (x - prior.base) / prior.change))
            cost = float(residual @ residual)
            if cost < least:
                best, least = x, cost
    return best


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
        """The stride to first order."""
        if self.linear is None:
            step, n, slots = stride.step, len(self.z), stride.slots
            m, columns = step.dimensions[1], np.array([*range(n), *(PADDED + s for s in slots)])
            end, jacobian, _ = step.derivatives(self.z, self.u, columns)
            by_state, by_controls = jacobian[:m, :n].copy(), jacobian[:m, n:].copy()
            self.linear = Linear(self.z, self.u[slots], end[:m], by_state, by_controls)
        return self.linear


class NearbyStrides:
    """Solver of strides that keeps the last solutions.

    A stride begins at the section that it ends at; ``tolerance`` (m,) are errors that count as 1. A
    state that is ``near`` tolerances away is another stride's; 0: every one is.
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
        """As :func:`solve_stride`."""
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
        pull = prior.search.pull
        _, turn, x, end = improve(tuple(linear), z, aim, self.tolerance, prior.table, pull, 0.0)
        if turn > _TURN:
            return None
        u = prior.controls.copy()
        for slot, value in zip(prior.slots, x.tolist(), strict=True):
            u[slot] = value
        return u, end


Solve = Callable[[Array], tuple[Array, Array | None]]
"""Controls and end of a stride for where it should end; the end is None where there is none."""

_MADE = 0.5  # of a change: a stride that makes less of it is not the one that was sought
_SMALLER = 0.7  # of the change asked for before
_TRIES = 2  # as many more solutions a stride may cost


def solve_within_reach(
    solve: Solve, z: Array, aim: Array, least: float
) -> tuple[Array, Array | None]:
    """The stride that comes nearest to the speed aimed at, of a few that aim at less.

    Strides from ``z`` (n,) that miss the speed of ``aim`` (n,) by less than ``least`` [m/s] stay.
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
