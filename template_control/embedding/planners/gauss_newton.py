"""The algebra of a Gauss-Newton step between bounds.

Compiled, because numpy's calls for such small matrices took most of a plan's time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import callee, compiled
from template_control.whole_body.elimination import cholesky, solve_cholesky

Array = NDArray[np.float64]

_NONE = np.int64(0)  # Numba would compile what a literal 0 is handed to for it alone


@callee
def bounded_step(rows: Array, residual: Array, x: Array, lower: Array, upper: Array) -> Array:
    """x + dx with the least |rows dx + residual| between the bounds.

    A variable that would leave its bounds is held there, and the others are solved for again.

    Args:
        rows: (r, f) Jacobian of the residual, its columns independent.
        residual: (r,) at x.
        x: (f,) within the bounds.
        lower, upper: (f,) bounds.
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


@callee
def step_between(
    end: Array, jacobian: Array, goal: Array, x: Array, prior: Array
) -> tuple[float, float, Array]:
    """One step towards the least |(end - aim) / tolerance|^2 + |(x - base) / change|^2.

    Args:
        end: (m,) where x leads.
        jacobian: (m, f) derivatives of the end by x.
        goal: (2, m) aim and tolerance.
        x: (f,) present point.
        prior: (4, f) base, change, lower and upper bounds.

    Returns:
        The cost at x; the longest component of the step in units of its change; (f,) the next x.
    """
    m, size = jacobian.shape
    rows, residual = np.zeros((m + size, size)), np.empty(m + size)
    cost = 0.0
    for i in range(m):
        residual[i] = (end[i] - goal[0, i]) / goal[1, i]
        for j in range(size):
            rows[i, j] = jacobian[i, j] / goal[1, i]
    for j in range(size):
        residual[m + j] = (x[j] - prior[0, j]) / prior[1, j]
        rows[m + j, j] = 1.0 / prior[1, j]
    for i in range(m + size):
        cost += residual[i] * residual[i]
    there = bounded_step(rows, residual, x, prior[2], prior[3])
    longest = 0.0
    for j in range(size):
        longest = max(longest, abs(there[j] - x[j]) / prior[1, j])
    return cost, longest, there


@compiled
def improve(
    end: Array, jacobian: Array, goal: Array, x: Array, prior: Array
) -> tuple[float, float, Array]:
    """:func:`step_between` for Python; compiled functions call that.

    Args:
        The rest as in :func:`step_between`.
    """
    return step_between(end, jacobian, goal, x, prior)
