"""Factor of a small symmetric matrix, and what it solves, in compiled code."""

from __future__ import annotations

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled


@compiled
def cholesky(matrix: Array, size: int) -> bool:
    """Factor the leading block of a symmetric matrix in place; its lower triangle becomes L.

    Only the lower triangle of the (n, n) matrix is read and overwritten; ``size`` are the block's
    rows. False where the block is not positive definite; it is then half overwritten.
    """
    for j in range(size):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        if not pivot > 0.0:
            return False
        pivot = np.sqrt(pivot)
        matrix[j, j] = pivot
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / pivot
    return True


@compiled
def solve_cholesky(factor: Array, size: int, columns: Array) -> None:
    """Solve L L^T x = b in place for several right-hand sides b, ``columns`` (size, m).

    ``factor`` (n, n) is from :func:`cholesky`, ``size`` its block's rows.
    """
    width = columns.shape[1]  # side by side: one instruction takes several
    for i in range(size):
        for k in range(i):
            for c in range(width):
                columns[i, c] -= factor[i, k] * columns[k, c]
        for c in range(width):
            columns[i, c] /= factor[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            for c in range(width):
                columns[i, c] -= factor[k, i] * columns[k, c]
        for c in range(width):
            columns[i, c] /= factor[i, i]
