"""Discrete linear-quadratic regulator, and the fixed point that it leads to."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_are

from template_control.arrays import Array

CONTROL_WEIGHT = 100.0
"""Weight of the settled controls' squared changes [rad, share of k0]."""
SETTLED_TOLERANCE = (0.011, 0.005, 0.03)
"""Errors of the settled dx/dt, y, dy/dt that count as equally bad [m/s, m, m/s], for l0 = 1 m."""


def lqr(a: Array, b: Array, q: Array, r: Array) -> tuple[Array, Array]:
    """Cost-to-go P (n, n) and gain K (c, n) of u = -K z for z_next = A z + B u.

    ``q`` (n, n) is the cost of z, ``r`` (c, c) that of u. A LinAlgError if no gain holds the state.
    """
    cost = solve_discrete_are(a, b, q, r)
    return cost, np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a)


def settling_map(a: Array, b: Array, tolerance: Array, control_weight: float) -> Array:
    """(3 + c, 3) map from an offset d to the shift (dz, du) of the fixed point.

    Minimises |dz / tolerance|^2 + control_weight |du|^2 subject to (I - A) dz = B du + d, with
    A (3, 3) and B (3, c) the Jacobians of the VLO map. Without push-off the controls act in two
    directions only, so not every offset can be cancelled with dz = 0.
    """
    weights = np.concatenate((1.0 / tolerance**2, np.full(b.shape[1], control_weight)))
    constraint = np.hstack((np.eye(3) - a, -b))
    return least_change(weights, constraint, np.zeros((len(weights), 3)), np.eye(3))


def least_change(weights: Array, constraint: Array, pull: Array, missing: Array) -> Array:
    """The x (n, ...) with the least x' W x / 2 - pull' x, W of ``weights`` (n,), and C x = missing.

    C is the ``constraint`` (m, n).
    """
    n, m = len(weights), len(constraint)
    kkt = np.zeros((n + m, n + m))
    kkt[:n, :n] = np.diag(weights)
    kkt[:n, n:], kkt[n:, :n] = constraint.T, constraint
    solution = np.linalg.solve(kkt, np.concatenate((pull, missing)))
    return np.asarray(solution[:n], dtype=np.float64)
