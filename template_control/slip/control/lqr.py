"""Discrete linear-quadratic regulator."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_are

from template_control.arrays import Array


def lqr(a: Array, b: Array, q: Array, r: Array) -> tuple[Array, Array]:
    """Cost-to-go P (n, n) and gain K (c, n) of u = -K z for z_next = A z + B u.

    Args:
        a: A (n, n).
        b: B (n, c).
        q: cost of z (n, n).
        r: cost of u (c, c).

    Raises:
        LinAlgError: if no gain holds the state.
    """
    cost = solve_discrete_are(a, b, q, r)
    return cost, np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a)
