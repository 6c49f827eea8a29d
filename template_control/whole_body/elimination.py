"""Floating-base dynamics and contact constraints, eliminated exactly.

With the contacts fixed, the joint torques determine everything else:

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


@compiled
def multiply_add(left: Array, right: Array, out: Array) -> None:
    """out += left right, each entry summed up from its value in ``out``, in order."""
    for i in range(out.shape[0]):
        for k in range(left.shape[1]):
            for j in range(out.shape[1]):
                out[i, j] += left[i, k] * right[k, j]


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
        jacobian: (m, nv) stacked Jacobian J of the contacts.
        bias: (m,) dJ/dt v.
        base_dof: unactuated coordinates, the first ones.
        a_map: (nv, nv - base_dof + 1) overwritten: A, and a0 in the last column.
        f_map: (m, nv - base_dof + 1) overwritten: F, and f0 in the last column.

    Returns:
        False where M or J M^-1 J^T is singular (a straight leg, coinciding contacts).
    """
    nv, m = mass_matrix.shape[0], jacobian.shape[0]
    nu = nv - base_dof
    factor = mass_matrix.copy()
    if not cholesky(factor, nv):
        return False
    # Two arrays, each in a row in memory: M^-1 of the columns of S and of -h, and M^-1 J^T.
    uncontacted, jt = np.zeros((nv, nu + 1)), np.empty((nv, m))
    for j in range(nu):
        uncontacted[base_dof + j, j] = 1.0
    for i in range(nv):
        uncontacted[i, nu] = -nonlinear_effects[i]
        for j in range(m):
            jt[i, j] = jacobian[j, i]
    solve_cholesky(factor, nv, uncontacted)
    solve_cholesky(factor, nv, jt)
    delassus = np.zeros((m, m))
    multiply_add(jacobian, jt, delassus)
    f_map[:] = 0.0
    for i in range(m):
        f_map[i, nu] = bias[i]
    multiply_add(jacobian, uncontacted, f_map)
    for i in range(m):
        for j in range(nu + 1):
            f_map[i, j] = -f_map[i, j]
    if not cholesky(delassus, m):
        return False
    solve_cholesky(delassus, m, f_map)
    a_map[:] = 0.0
    multiply_add(jt, f_map, a_map)
    for i in range(nv):
        for j in range(nu + 1):
            a_map[i, j] += uncontacted[i, j]
    return True
