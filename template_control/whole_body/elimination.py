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

from template_control.arrays import Array
from template_control.cholesky import cholesky, solve_cholesky
from template_control.compiled import compiled


@compiled
def multiply_add(left: Array, right: Array, out: Array) -> None:
    """out += left right, each entry summed up from its value in ``out``, in order."""
    for i in range(out.shape[0]):
        for k in range(left.shape[1]):
            if left[i, k] == 0.0:  # a contact moves with few of the joints
                continue
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
    """Write A with a0 in a last column, and F with f0; the first ``base_dof`` are unactuated.

    False where M or J M^-1 J^T is singular (a straight leg, coinciding contacts).
    """
    nv, m = mass_matrix.shape[0], jacobian.shape[0]
    nu = nv - base_dof
    factor = mass_matrix.copy()
    if not cholesky(factor, nv):
        return False
    # M^-1 of the columns of S, of -h and of J^T, at once: each step waits for the one before.
    columns = np.zeros((nv, nu + 1 + m))
    for j in range(nu):
        columns[base_dof + j, j] = 1.0
    for i in range(nv):
        columns[i, nu] = -nonlinear_effects[i]
        for j in range(m):
            columns[i, nu + 1 + j] = jacobian[j, i]
    solve_cholesky(factor, nv, columns)
    uncontacted, jt = columns[:, : nu + 1], columns[:, nu + 1 :]
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
