"""Rigid unilateral contacts: which of them press, with what force, and what an impact does.

A contact sticks or leaves; it does not slide. All functions solve one linear system, with
the rows J of the contacts that press,

    [M  -J^T] [x]   [right-hand side]
    [J    0 ] [f] = [    -gamma     ]

for accelerations (generalised forces, dJ/dt v), velocities after an impact (M v, 0) and
corrections of a configuration (0, distances).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDING = 1e-9  # relative: forces and accelerations this small have no sign


def solve(
    mass_matrix: Array, right: Array, jacobian: Array, gamma: Array, pressed: tuple[int, ...]
) -> tuple[Array, Array]:
    """Solve the system with some of the contacts held.

    Args:
        mass_matrix: (nv, nv) M.
        right: (nv,) right-hand side.
        jacobian: (2, 2, nv) rows x and y of either contact.
        gamma: (2, 2) x and y of either contact.
        pressed: indices of the contacts that are held.

    Returns:
        x (nv,), and f (2, 2), zero for the contacts that are not held.

    Raises:
        numpy.linalg.LinAlgError: if the contacts' rows depend on each other.
    """
    nv, m = len(right), 2 * len(pressed)
    force = np.zeros((2, 2))
    if not pressed:
        return np.asarray(np.linalg.solve(mass_matrix, right), dtype=np.float64), force
    held = list(pressed)
    kkt = np.zeros((nv + m, nv + m))
    kkt[:nv, :nv] = mass_matrix
    kkt[nv:, :nv] = jacobian[held].reshape(m, nv)
    kkt[:nv, nv:] = -kkt[nv:, :nv].T
    found: Array = np.linalg.solve(kkt, np.concatenate((right, -gamma[held].ravel()))).astype(
        np.float64, copy=False
    )
    force[held] = found[nv:].reshape(-1, 2)
    return found[:nv], force


def pressing(
    mass_matrix: Array,
    right: Array,
    jacobian: Array,
    gamma: Array,
    touching: Iterable[int],
) -> tuple[tuple[int, ...], Array, Array, bool]:
    """Find which of the touching contacts press: none of them pulls, none of the others sinks.

    As many contacts as possible are kept. The function serves accelerations and impacts alike.

    Args:
        mass_matrix: (nv, nv) M.
        right: (nv,) right-hand side.
        jacobian: (2, 2, nv) rows x and y of either contact.
        gamma: (2, 2) x and y of either contact.
        touching: indices of the contacts that touch the ground.

    Returns:
        The contacts that press; x and f as :func:`solve` returns them; and False where every
        choice would pull or sink. All contacts are then held, whatever they pull.

    Raises:
        numpy.linalg.LinAlgError: if the contacts' rows depend on each other.
    """
    touching = tuple(touching)
    for held in _subsets(touching):
        x, force = solve(mass_matrix, right, jacobian, gamma, held)
        normal = jacobian[:, 1] @ x + gamma[:, 1]
        pulls = any(force[i, 1] < -_ROUNDING * np.abs(force).max() for i in held)
        sinks = any(
            normal[i] < -_ROUNDING * np.abs(normal).max() for i in touching if i not in held
        )
        if not (pulls or sinks):
            return held, x, force, True
    x, force = solve(mass_matrix, right, jacobian, gamma, touching)
    return touching, x, force, False


def _subsets(items: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """All of them, the largest first."""
    for size in range(len(items), -1, -1):
        yield from combinations(items, size)
