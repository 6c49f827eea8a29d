"""Floating-base dynamics and contact constraints, eliminated exactly.

With the stance feet fixed, the joint torques determine everything else:

    [M  -J^T] [a]   [S tau - h]
    [J    0 ] [f] = [  -dJ v  ]

so accelerations and contact forces are affine in tau, a = A tau + a0 and f = F tau + f0.
The whole-body QP keeps the torques as its only unknowns; dynamics and stance constraints
then hold to machine precision whatever the QP's tolerance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled

Array = NDArray[np.float64]


@compiled
def cholesky(matrix: Array, size: int) -> bool:
    """Factor the leading block of a symmetric matrix in place; its lower triangle becomes L.

    Args:
        matrix: (n, n) of which only the lower triangle is read and overwritten.
        size: rows of the block, at most n.

    Returns:
        False where the block is not positive definite; it is then half overwritten.
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
    """Solve L L^T x = b in place for several right-hand sides b.

    Args:
        factor: (n, n) matrix that :func:`cholesky` has factored.
        size: rows of the factored block.
        columns: (size, m) right-hand sides, one a column; overwritten with the solutions.
    """
    for c in range(columns.shape[1]):
        for i in range(size):
            value = columns[i, c]
            for k in range(i):
                value -= factor[i, k] * columns[k, c]
            columns[i, c] = value / factor[i, i]
        for i in range(size - 1, -1, -1):
            value = columns[i, c]
            for k in range(i + 1, size):
                value -= factor[k, i] * columns[k, c]
            columns[i, c] = value / factor[i, i]


@compiled
def eliminate(
    mass_matrix: Array,
    nonlinear_effects: Array,
    jacobian: Array,
    bias: Array,
    base_dof: int,
    a_map: Array,
    f_map: Array,
) -> bool:
    """Accelerations and contact forces as affine functions of the joint torques.

    Args:
        mass_matrix: (nv, nv) M.
        nonlinear_effects: (nv,) h.
        jacobian: (m, nv) stacked Jacobian J of the stance feet.
        bias: (m,) dJ/dt v.
        base_dof: unactuated coordinates, the first ones.
        a_map: (nv, nv - base_dof + 1) overwritten: A, and a0 in the last column.
        f_map: (m, nv - base_dof + 1) overwritten: F, and f0 in the last column.

    Returns:
        False where M or J M^-1 J^T is singular (a straight leg, coinciding feet).
    """
    nv, m = mass_matrix.shape[0], jacobian.shape[0]
    nu = nv - base_dof
    factor = mass_matrix.copy()
    if not cholesky(factor, nv):
        return False
    # Right-hand sides without contact: columns of S, then -h.
    a_map[:] = 0.0
    for j in range(nu):
        a_map[base_dof + j, j] = 1.0
    for i in range(nv):
        a_map[i, nu] = -nonlinear_effects[i]
    solve_cholesky(factor, nv, a_map)
    jt = jacobian.T.copy()
    solve_cholesky(factor, nv, jt)  # M^-1 J^T
    delassus = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            total = 0.0
            for k in range(nv):
                total += jacobian[i, k] * jt[k, j]
            delassus[i, j] = total
    for i in range(m):
        for j in range(nu + 1):
            total = bias[i] if j == nu else 0.0
            for k in range(nv):
                total += jacobian[i, k] * a_map[k, j]
            f_map[i, j] = -total
    if not cholesky(delassus, m):
        return False
    solve_cholesky(delassus, m, f_map)
    for i in range(nv):
        for j in range(nu + 1):
            total = 0.0
            for k in range(m):
                total += jt[i, k] * f_map[k, j]
            a_map[i, j] += total
    return True
