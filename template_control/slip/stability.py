"""Eigenvalues of return maps and what they say about a gait."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from template_control.errors import GaitError
from template_control.slip.return_map import Linearisation, ReturnMap
from template_control.slip.vocabulary import Outcome

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_DIFFERENCE = 1e-6


class Kind(Enum):
    """A gait's stability by its eigenvalues."""

    STABLE = "stable"
    SADDLE = "saddle"
    UNSTABLE = "unstable"


def classify(eigenvalues: ComplexArray) -> Kind:
    """STABLE if all lie within the unit circle, UNSTABLE if none does, SADDLE between."""
    outside = np.abs(eigenvalues) >= 1.0
    if not outside.any():
        return Kind.STABLE
    return Kind.UNSTABLE if outside.all() else Kind.SADDLE


def shell_eigenvalues(jacobian: Array, energy_gradient: Array) -> ComplexArray:
    """Eigenvalues of a passive return map within its energy shell.

    A passive stride conserves energy, so one eigenvalue of the whole map is 1; it says
    nothing about stability and is left out.

    Args:
        jacobian: (n, n) of the map at a fixed point.
        energy_gradient: (n,) of the energy at the section.
    """
    shell = np.linalg.svd(energy_gradient[None, :])[2][1:].T
    return np.linalg.eigvals(shell.T @ jacobian @ shell).astype(np.complex128)


def closed_loop_eigenvalues(linear: Linearisation, gain: Array) -> ComplexArray:
    """Eigenvalues of z' = P(z, u_s - K (z - z_s)).

    Args:
        linear: the map at (z_s, u_s).
        gain: (NUM_SLOTS, n) K.
    """
    closed = linear.state_jacobian - linear.control_jacobian @ gain
    return np.linalg.eigvals(closed).astype(np.complex128)


def controlled_fixed_point(
    step: ReturnMap, policy: Callable[[Array], Array], start: Array, iterations: int = 30
) -> tuple[Array, ComplexArray]:
    """Where a controlled stride settles, and the eigenvalues of the closed loop there.

    Newton's method on z = P(z, u(z)). The map's derivatives are exact; the policy's, which
    may hide an optimisation, are central differences.

    Args:
        step: the map z moves on; the exact one, whatever map the policy computes with.
        policy: controls (NUM_SLOTS,) at a state (n,), such as
            ``lambda z: controller.solve(z, target).controls``.
        start: (n,) first guess.
        iterations: of Newton's method at most.

    Raises:
        GaitError: if a stride fails on the way, or there is no convergence.
    """
    z = np.array(start, dtype=float)
    n = len(z)
    for _ in range(iterations):
        linear = step.linearise(z, policy(z))
        if linear.outcome is not Outcome.SECTION:
            raise GaitError(f"the controlled stride fails near {z.tolist()}")
        slope = np.column_stack(
            [
                (policy(z + _DIFFERENCE * e) - policy(z - _DIFFERENCE * e)) / (2.0 * _DIFFERENCE)
                for e in np.eye(n)
            ]
        )
        closed = linear.state_jacobian + linear.control_jacobian @ slope
        miss = linear.state - z
        if np.max(np.abs(miss)) < 1e-9:
            return z, np.linalg.eigvals(closed).astype(np.complex128)
        z = z + np.linalg.lstsq(np.eye(n) - closed, miss, rcond=1e-10)[0]
    raise GaitError("the controlled gait does not settle: give another start")
