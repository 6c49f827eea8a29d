"""Eigenvalues of return maps and what they say about a gait."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.slip.maps.return_map import Linearisation

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class Kind(Enum):
    """A gait's stability by its eigenvalues."""

    STABLE = "stable"
    SADDLE = "saddle"
    UNSTABLE = "unstable"
    NEUTRAL = "neutral"


def classify(eigenvalues: ComplexArray, tolerance: float = 0.0) -> Kind:
    """STABLE if all lie within the unit circle, UNSTABLE if none does, SADDLE between.

    Args:
        eigenvalues: (n,) of a return map.
        tolerance: to which they are known; NEUTRAL if the largest lies on the circle to it.
    """
    sizes = np.abs(eigenvalues)
    if abs(sizes.max() - 1.0) < tolerance:
        return Kind.NEUTRAL
    outside = sizes >= 1.0
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


@checked
def closed_loop_eigenvalues(linear: Linearisation, gain: Array) -> ComplexArray:
    """Eigenvalues of z' = P(z, u_s - K (z - z_s)).

    Args:
        linear: the map at (z_s, u_s).
        gain: (NUM_SLOTS, n) K.
    """
    closed = linear.state_jacobian - linear.control_jacobian @ gain
    return np.linalg.eigvals(closed).astype(np.complex128)
