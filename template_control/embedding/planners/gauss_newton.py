"""The algebra of a Gauss-Newton step between bounds.

Compiled, because numpy's calls for such small matrices took most of a plan's time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.whole_body.elimination import cholesky, solve_cholesky

Array = NDArray[np.float64]

_NONE = np.int64(0)  # Numba would compile what a literal 0 is handed to for it alone


@compiled
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


class Linear(NamedTuple):
    """A stride to first order.

    Attributes:
        z: (n,) where it begins.
        x: (f,) its free controls.
        end: (m,) where it ends.
        by_state: (m, n) derivatives.
        by_controls: (m, f) derivatives.
    """

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
) -> tuple[float, float, Array, Array]:
    """One step towards the least |(end - aim) / tolerance|^2 + |(x - base) / change|^2.

    Args:
        linear: a :class:`Linear`; compiled code takes a plain tuple more quickly.
        z: (n,) where the stride begins, near that of ``linear``.
        aim: (m,) where it should end.
        tolerance: (m,) errors that count as 1.
        prior: (4, f) base, change, lower and upper bounds.

    Returns:
        The cost at x; the longest component of the step in units of its change; (f,) the next x;
        (m,) where that leads, to first order.
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
        residual[m + j] = (x[j] - prior[0, j]) / prior[1, j]
        rows[m + j, j] = 1.0 / prior[1, j]
    for i in range(m + size):
        cost += residual[i] * residual[i]
    better = bounded_step(rows, residual, x, prior[2], prior[3])
    longest = 0.0
    for j in range(size):
        longest = max(longest, abs(better[j] - x[j]) / prior[1, j])
        for i in range(m):
            there[i] += by_controls[i, j] * (better[j] - x[j])
    return cost, longest, better, there
