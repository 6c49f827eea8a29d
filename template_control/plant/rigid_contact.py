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

from template_control.compiled import compiled

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
    held = 0 in pressed, 1 in pressed
    try:
        found: tuple[Array, Array] = _solution(mass_matrix, right, jacobian, gamma, held)
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError("the contacts' rows depend on each other") from None
    return found


@compiled
def _solution(
    mass_matrix: Array, right: Array, jacobian: Array, gamma: Array, held: tuple[bool, bool]
) -> tuple[Array, Array]:
    """As :func:`solve`; ``held`` tells of either contact whether it is."""
    nv = right.shape[0]
    size = nv + 2 * (held[0] + held[1])
    matrix, known = np.zeros((size, size)), np.empty(size)
    for k in range(nv):
        known[k] = right[k]
        for j in range(nv):
            matrix[j, k] = mass_matrix[j, k]
    row = nv
    for i in range(2):
        if held[i]:
            for axis in range(2):
                known[row] = -gamma[i, axis]
                for k in range(nv):
                    matrix[row, k] = jacobian[i, axis, k]
                    matrix[k, row] = -jacobian[i, axis, k]
                row += 1
    # What is not finite has no solution, and is no fault of the contacts.
    finite = np.isfinite(known).all()
    found = np.linalg.solve(matrix, known) if finite else np.full(size, np.nan)
    force, row = np.zeros((2, 2)), nv
    for i in range(2):
        if held[i]:
            for axis in range(2):
                force[i, axis] = found[row]
                row += 1
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
