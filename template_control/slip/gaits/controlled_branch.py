"""Branches of controlled gaits: where a controlled stride settles as its target moves.

A point of a branch is X = (z, target): the state that the exact stride with the controller's
controls returns to, and what the controller is asked for, in the one quantity that is varied. A
controller that computes on the exact map and reaches its target settles on it; elsewhere the
branch tells how far beside, and how stable it is there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.checks.ranges import Count, Vector
from template_control.errors import GaitError, ParameterError
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.control.section_target import VARIED, TargetedPolicy
from template_control.slip.gaits.branch import Branch, BranchPoint, Equations, null_vector
from template_control.slip.gaits.stability import classify
from template_control.slip.maps.return_map import Linearisation, ReturnMap

Array = NDArray[np.float64]
Policy = Callable[[Array], Array]
"""Controls (NUM_SLOTS,) at a section state (n,)."""
_DIFFERENCE = 1e-6
_NOISE = 1e-5  # of eigenvalues: a controller's search ends at 1e-10, over the difference


class ControlledFamily(Branch):
    """Gaits that a controlled stride returns to, over its controller's target.

    The map's derivatives are exact; the policy's, which may hide an optimisation, are central
    differences.

    Args:
        step: the map z moves on; the exact one, whatever map the policy computes with. Its
            stride begins and ends at the same section.
        policy: controls at a state and a target.
        varied: which quantity the target is: one of
            :data:`~template_control.slip.control.section_target.VARIED`.

    Raises:
        ParameterError: if ``varied`` is none of them, or the stride is none that repeats.
    """

    free: tuple[str, ...] = ("target",)
    noise = _NOISE

    @checked
    def __init__(self, step: ReturnMap, policy: TargetedPolicy, varied: str) -> None:
        if varied not in VARIED:
            raise ParameterError(
                f"cannot vary the target's {varied!r}: give one of {', '.join(VARIED)}"
            )
        if step.stride not in ("w", "r"):
            raise ParameterError(f"stride is {step.stride!r}: periodic gaits are 'w' or 'r'")
        self.map, self.policy, self.varied = step, policy, varied
        self.n = step.dimensions[0]
        p = step.parameters
        speed = p.speed_unit
        sizes = (p.mass * p.gravity * p.rest_length, p.rest_length, speed)
        target = dict(zip(VARIED, sizes, strict=True))[varied]
        self.scale = np.array([*[speed, p.rest_length, speed][: self.n], target])
        self.anchor = np.eye(self.n + 1)[-1]

    def equations(self, x: Array) -> Equations:
        """Residual (n,) and Jacobian of z = P(z, u(z, target))."""
        z, target = x[:-1], float(x[-1])
        linear, closed, _ = self._closed(x)
        valid = linear.outcome is Outcome.SECTION
        if not valid:
            return Equations(np.full(self.n, np.nan), np.zeros((self.n, self.n + 1)), valid)
        h = _DIFFERENCE * self.scale[-1]
        by_target = (self.policy(z, target + h) - self.policy(z, target - h)) / (2.0 * h)
        rows = np.column_stack((closed - np.eye(self.n), linear.control_jacobian @ by_target))
        scale = self.scale[:-1]
        return Equations((linear.state - z) / scale, rows * self.scale / scale[:, None], valid)

    def point(self, x: Array) -> BranchPoint:
        """The branch point at X (n + 1,); its tangent is oriented arbitrarily."""
        _, closed, u = self._closed(x)
        eigenvalues = np.linalg.eigvals(closed).astype(np.complex128)
        p = self.map.parameters
        return BranchPoint(
            x=x.copy(),
            state=x[:-1].copy(),
            controls=u,
            energy=float(self.map.sections[0].energy(p, x[:-1])),
            target=float(x[-1]),
            eigenvalues=eigenvalues,
            kind=classify(eigenvalues, _NOISE),
            tangent=null_vector(self.equations(x).jacobian),
        )

    def quantity(self, x: Array, name: str) -> tuple[float, Array]:
        """See :meth:`~.branch.Branch.quantity`; the only quantity is the controller's target."""
        return float(x[-1]), np.eye(self.n + 1)[-1]

    def _closed(self, x: Array) -> tuple[Linearisation, Array, Array]:
        target = float(x[-1])
        return closed_loop(self.map, lambda z: self.policy(z, target), x[:-1])


def closed_loop(step: ReturnMap, policy: Policy, z: Array) -> tuple[Linearisation, Array, Array]:
    """Take the exact stride from a state with a policy's controls, and differentiate it.

    Args:
        step: the map z moves on; the exact one, whatever map the policy computes with.
        policy: controls (NUM_SLOTS,) at a state (n,).
        z: (n,) state at the section.

    Returns:
        The map at z and u; the (n, n) derivative of the closed loop; u (NUM_SLOTS,).
    """
    u = policy(z)
    linear = step.linearise(z, u)
    slope = np.column_stack(
        [
            (policy(z + _DIFFERENCE * e) - policy(z - _DIFFERENCE * e)) / (2.0 * _DIFFERENCE)
            for e in np.eye(len(z))
        ]
    )
    return linear, linear.state_jacobian + linear.control_jacobian @ slope, u


@checked
def controlled_fixed_point(
    step: ReturnMap, policy: Policy, start: Vector, iterations: Count = 30
) -> tuple[Array, NDArray[np.complex128]]:
    """Find where a controlled stride settles: Newton's method on z = P(z, u(z)).

    Args:
        step: the map z moves on; the exact one, whatever map the policy computes with.
        policy: controls (NUM_SLOTS,) at a state (n,), such as
            ``lambda z: controller.solve(z, target).controls``.
        start: (n,) first guess.
        iterations: of Newton's method at most.

    Returns:
        (n,) the state; (n,) eigenvalues of the closed loop there.

    Raises:
        GaitError: if a stride fails on the way, or there is no convergence.
    """
    z = np.array(start, dtype=float)
    for _ in range(iterations):
        linear, closed, _ = closed_loop(step, policy, z)
        if linear.outcome is not Outcome.SECTION:
            raise GaitError(f"the controlled stride fails near {z.tolist()}")
        miss = linear.state - z
        if np.max(np.abs(miss)) < 1e-9:
            return z, np.linalg.eigvals(closed).astype(np.complex128)
        z = z + np.linalg.lstsq(np.eye(len(z)) - closed, miss, rcond=1e-10)[0]
    raise GaitError("the controlled gait does not settle: give another start")
