"""Bounded nonlinear least squares by damped Gauss-Newton steps, compiled for any problem.

A problem is a named tuple with ``change``, ``lower`` and ``upper`` (f,) of its unknowns. Its type
chooses the code of :func:`evaluate` and :func:`slopes`, which it declares by ``inner_by_type``.
"""

from __future__ import annotations

from sys import maxsize
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.cholesky import cholesky, solve_cholesky
from template_control.compiled import compiled, compiled_into, constant

_NONE = constant(0)
_LESS = 0.1  # of the damping, after a step that does as foreseen; after a bad one as much more
_TINY = 1e-300
_SOME = 2  # rounds after which the cost says whether others are worth it
_GOOD, _BAD = 0.75, 0.25  # shares of the foreseen change of the cost


class Search(NamedTuple):
    """How far a search goes."""

    rounds: int  # steps that lower the cost; as many more may be tried again, shorter
    close: float = 0.03  # the last step's length in units of change: what it leaves is its square
    grid: int = 5  # points of each unknown that are tried where the start fails; 0: none
    gridded: int = maxsize  # so many of them, the first ones; the others stay at the start
    save: float = 0.0  # share of the cost that a step has to save for another one
    hopeless: float = np.inf  # cost after two rounds from which on no others follow
    # Damping after a bad step. Where equations weigh more than wishes, less of it stops the latter.
    damping: float = 1.0
    # Steps that may raise the cost, before they are taken back. Where targets are met by a curved
    # valley of unknowns, Newton's method leaves it and finds its end; with a cost that always falls
    # it creeps along.
    patience: int = 0


def evaluate(problem: Any, x: Array, residual: Array) -> float:
    """Write the residual (r,) at x (f,); return its squared length, inf where there is none."""
    raise NotImplementedError


def slopes(problem: Any, x: Array, rows: Array) -> None:
    """Write the residual's derivatives (r, f) at x (f,), at which it was evaluated last."""
    raise NotImplementedError


@compiled
def bounded_step(
    rows: Array, residual: Array, x: Array, lower: Array, upper: Array, damping: float
) -> Array:
    """x + dx with the least |rows dx + residual|^2 + damping |D dx|^2 between the bounds.

    D holds the lengths of the columns of ``rows``: Levenberg's damping in Marquardt's scale. A
    variable that would leave its bounds is held there, and the others are solved for again.
    """
    size = x.shape[0]
    there = np.empty(size)
    held = np.empty(size, np.bool_)
    for i in range(size):
        there[i] = min(max(x[i], lower[i]), upper[i])
        held[i] = not upper[i] > lower[i]
    normal, right = np.empty((size, size)), np.empty((size, 1))
    free, some = np.empty(size, np.int64), np.empty(size, np.int64)  # some: a row's, not zero
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
                normal[a, b] = 0.0
            right[a, 0] = 0.0
        for r in range(rows.shape[0]):
            left, filled = residual[r], _NONE
            for i in range(size):
                if held[i]:
                    left += rows[r, i] * (there[i] - x[i])
            for a in range(count):
                if rows[r, free[a]] != 0.0:
                    some[filled] = a
                    filled += 1
            for i in range(filled):
                a = some[i]
                for j in range(i + 1):
                    normal[a, some[j]] += rows[r, free[a]] * rows[r, free[some[j]]]
                right[a, 0] -= rows[r, free[a]] * left
        for a in range(count):
            normal[a, a] *= 1.0 + damping
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


class _Point(NamedTuple):
    """Unknowns x (f,), the residual (r,) there, and its derivatives (r, f)."""

    x: Array
    residual: Array
    rows: Array


@compiled
def _point(count: int, size: int) -> _Point:
    return _Point(np.empty(size), np.empty(count), np.zeros((count, size)))


@compiled
def copy(source: Array, target: Array) -> None:
    """Copy numbers (n,) into the first of ``target`` (m,).

    A slice would take Numba seconds to compile, for what it says of wrong shapes.
    """
    for i in range(target.shape[0]):
        target[i] = source[i]


@compiled
def _copy(source: _Point, target: _Point) -> None:
    copy(source.x, target.x)
    copy(source.residual, target.residual)
    for r in range(source.rows.shape[0]):
        for i in range(source.rows.shape[1]):
            target.rows[r, i] = source.rows[r, i]


@compiled_into
def _from_grid(problem: Any, search: Search, there: _Point, best: _Point) -> float:
    """The least cost on a grid within the bounds, its place in ``best``; inf where all fails."""
    points, size, least = search.grid, min(search.gridded, best.x.shape[0]), np.inf
    copy(best.x, there.x)
    for number in range(points**size):
        left = number
        for i in range(size - 1, -1, -1):
            share = left % points / (points - 1)
            there.x[i] = problem.lower[i] + share * (problem.upper[i] - problem.lower[i])
            left //= points
        cost = evaluate(problem, there.x, there.residual)
        if cost < least:
            least = cost
            copy(there.x, best.x)
    return least


@compiled
def least_squares(problem: Any, search: Search, residual: Array, x: Array) -> float:
    """Improve x (f,) in place, and write the residual (r,) there; return the least cost.

    Where nothing that was tried can be evaluated it is inf, and x what it was. The problem is
    evaluated last at the x that is returned.
    """
    size, count = x.shape[0], residual.shape[0]
    here, best, there = _point(count, size), _point(count, size), _point(count, size)
    copy(x, best.x)
    least = evaluate(problem, best.x, best.residual)
    if not least < np.inf:
        if not _from_grid(problem, search, there, best) < np.inf:
            return np.inf
        least = evaluate(problem, best.x, best.residual)
    slopes(problem, best.x, best.rows)
    _copy(best, here)
    damping, patience, left, known = 0.0, search.patience, search.rounds, True
    for _ in range(2 * search.rounds):
        aim = bounded_step(here.rows, here.residual, here.x, problem.lower, problem.upper, damping)
        longest, foreseen = 0.0, 0.0
        for i in range(size):
            longest = max(longest, abs(aim[i] - here.x[i]) / problem.change[i])
        copy(aim, there.x)
        for r in range(count):
            linear = here.residual[r]
            for i in range(size):
                linear += here.rows[r, i] * (there.x[i] - here.x[i])
            foreseen += linear * linear
        cost, last = evaluate(problem, there.x, there.residual), longest < search.close
        known, done = cost < least, (least - cost) / max(least - foreseen, _TINY)
        if known:
            left -= 1
            last = last or left == 0 or least - cost < search.save * cost
            least = cost
            last = last or (least > search.hopeless and search.rounds - left >= _SOME)
            if done > _GOOD:
                damping = _LESS * damping if damping > _LESS * search.damping else 0.0
            elif done < _BAD:
                damping = max(damping / _LESS, search.damping)
        elif patience > 0 and cost < np.inf:
            patience -= 1
        elif not last:
            damping = max(damping / _LESS, search.damping)
            _copy(best, here)
            continue
        if known and last:
            copy(there.x, best.x)
            copy(there.residual, best.residual)
        if last:
            break
        slopes(problem, there.x, there.rows)
        _copy(there, here)
        if known:
            _copy(there, best)
    copy(best.x, x)
    copy(best.residual, residual)
    if not known:
        evaluate(problem, x, residual)
    return least
