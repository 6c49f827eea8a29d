"""Branches of periodic gaits, passive and controlled.

A point of a passive branch is X = (dx/dt, y, dy/dt, alpha, k) at VLO, or (dx/dt, y, alpha, k) at
apex. The stride returns to its state, which a passive stride's conserved energy makes one equation
fewer than there are states; two quantities are held fixed; one dimension is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from template_control.arrays import Array, ComplexArray
from template_control.checks.checked import checked
from template_control.checks.ranges import Vector
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot, StrideKind
from template_control.slip.control.controllers import VARIED, TargetedPolicy
from template_control.slip.gaits import branch
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import Section
from template_control.slip.parameters import SlipParameters

_COORDINATE = {"angle": -2, "stiffness": -1, "height": 1, "speed": 0}


class Family(branch.Branch):
    """One-parameter family of passive gaits with two quantities held fixed.

    Args:
        parameters: the template; its stiffness only scales.
        stride: "w" or "r".
        fixed: two of :data:`~.branch.QUANTITIES` with their values (SI units, angle in radians).

    Raises:
        ParameterError: if ``fixed`` is anything else.
    """

    @checked
    def __init__(self, parameters: SlipParameters, stride: str, fixed: Mapping[str, float]) -> None:
        if stride not in (StrideKind.WALK, StrideKind.RUN):
            raise ParameterError(f"stride is {stride!r}: periodic gaits are 'w' or 'r'")
        if len(fixed) != 2 or not set(fixed) <= set(branch.QUANTITIES):
            raise ParameterError(
                f"fixed quantities are {', '.join(fixed) or 'none'}: give two of"
                f" {', '.join(branch.QUANTITIES)}"
            )
        self.parameters = parameters
        self.fixed = dict(fixed)
        self.free = tuple(q for q in branch.QUANTITIES if q not in fixed)
        self.map = ReturnMap(parameters, stride)
        self.section = self.map.sections[0]
        self.n = self.section.dimension
        p = parameters
        speed = p.speed_unit
        self.scale = np.array([*[speed, p.rest_length, speed][: self.n], 1.0, p.leg_stiffness])
        self._energy_scale = p.mass * p.gravity * p.rest_length

    def equations(self, x: Array) -> branch.Equations:
        """Residual (n + 1,) and Jacobian at X: the stride returns, two quantities are held."""
        n = self.n
        u = np.zeros(NUM_SLOTS)
        u[Slot.TOUCHDOWN_ANGLE] = x[-2]
        u[[Slot.K_SC, Slot.K_SD]] = x[-1]
        linear = self.map.linearise(x[:n], u)
        stiffness = linear.control_jacobian[:, [Slot.K_SC, Slot.K_SD]].sum(axis=1)
        full = np.column_stack(
            (
                linear.state_jacobian - np.eye(n),
                linear.control_jacobian[:, Slot.TOUCHDOWN_ANGLE],
                stiffness,
            )
        )
        # dx/dt returns by itself: energy is conserved.
        rows = full[1:] / self.scale[1:n, None]
        residual = (linear.state - x[:n])[1:] / self.scale[1:n]
        for name, value in self.fixed.items():
            held, gradient = self.quantity(x, name)
            size = self._energy_scale if name == "energy" else self.scale[_COORDINATE[name]]
            residual = np.append(residual, (held - value) / size)
            rows = np.vstack((rows, gradient / size))
        valid = linear.outcome is Outcome.SECTION
        return branch.Equations(residual, rows * self.scale, valid, u, linear.state_jacobian)

    def stability(self, x: Array, loop: Array) -> tuple[float, float | None, ComplexArray]:
        """See :meth:`~.branch.Branch.stability`; there is no target."""
        energy, gradient = self.quantity(x, "energy")
        return energy, None, branch.shell_eigenvalues(loop, gradient[: self.n])

    def quantity(self, x: Array, name: str) -> tuple[float, Array]:
        """See :meth:`~.branch.Branch.quantity`; any of :data:`~.branch.QUANTITIES` has a value.

        X and the gradient are (n + 2,), with n the size of the section's state.
        """
        gradient = np.zeros(self.n + 2)
        if name != "energy":
            gradient[_COORDINATE[name]] = 1.0
            return float(x[_COORDINATE[name]]), gradient
        z = x[: self.n]
        gradient[: self.n], gradient[-1] = energy_gradient(self.section, self.parameters, z, x[-1])
        return float(self.section.energy(self.parameters, z, x[-1])), gradient


def energy_gradient(
    section: Section, parameters: SlipParameters, z: Array, stiffness: float
) -> tuple[Array, float]:
    """Derivatives of :meth:`Section.energy` at VLO or apex: (n,) by z, and by the stiffness."""
    p = parameters
    compression = p.rest_length - z[1] if section.event is Event.VLO else 0.0
    gradient = p.mass * np.array([z[0], p.gravity, *z[2:]])
    gradient[1] -= stiffness * compression
    return gradient, float(0.5 * compression**2)


Policy = Callable[[Array], Array]
"""Controls (NUM_SLOTS,) at a section state (n,)."""
_DIFFERENCE = 1e-6


class ControlledFamily(branch.Branch):
    """Gaits that a controlled stride returns to, over its controller's target.

    The map's derivatives are exact; the policy's, which may hide an optimisation, are central
    differences.

    Args:
        step: the map z moves on; the exact one, whatever map the policy computes with. Its
            stride begins and ends at the same section.
        policy: controls at a state and a target.
        varied: which quantity the target is: one of
            :data:`~template_control.slip.control.controllers.VARIED`.

    Raises:
        ParameterError: if ``varied`` is none of them, or the stride is none that repeats.
    """

    free: tuple[str, ...] = ("target",)
    noise = 1e-5  # a controller's search ends at 1e-10, over the difference

    @checked
    def __init__(self, step: ReturnMap, policy: TargetedPolicy, varied: str) -> None:
        if varied not in VARIED:
            raise ParameterError(
                f"cannot vary the target's {varied!r}: give one of {', '.join(VARIED)}"
            )
        if step.stride not in (StrideKind.WALK, StrideKind.RUN):
            raise ParameterError(f"stride is {step.stride!r}: periodic gaits are 'w' or 'r'")
        self.map, self.policy, self.varied = step, policy, varied
        self.n = step.dimensions[0]
        p = step.parameters
        speed = p.speed_unit
        sizes = (p.mass * p.gravity * p.rest_length, p.rest_length, speed)
        target = dict(zip(VARIED, sizes, strict=True))[varied]
        self.scale = np.array([*[speed, p.rest_length, speed][: self.n], target])
        self.anchor = np.eye(self.n + 1)[-1]

    def equations(self, x: Array) -> branch.Equations:
        """Residual (n,) and Jacobian of z = P(z, u(z, target))."""
        n, z, target = self.n, x[:-1], float(x[-1])
        u = self.policy(z, target)
        linear = self.map.linearise(z, u)
        steps = _DIFFERENCE * np.eye(n)
        changes = [self.policy(z + e, target) - self.policy(z - e, target) for e in steps]
        slope = np.column_stack(changes) / (2.0 * _DIFFERENCE)
        loop = linear.state_jacobian + linear.control_jacobian @ slope
        if linear.outcome is not Outcome.SECTION:
            return branch.Equations(np.full(n, np.nan), np.zeros((n, n + 1)), False, u, loop)
        h = _DIFFERENCE * self.scale[-1]
        by_target = (self.policy(z, target + h) - self.policy(z, target - h)) / (2.0 * h)
        rows = np.column_stack((loop - np.eye(n), linear.control_jacobian @ by_target))
        scale = self.scale[:-1]
        jacobian = rows * self.scale / scale[:, None]
        return branch.Equations((linear.state - z) / scale, jacobian, True, u, loop)

    def stability(self, x: Array, loop: Array) -> tuple[float, float | None, ComplexArray]:
        """See :meth:`~.branch.Branch.stability`."""
        energy = float(self.map.sections[0].energy(self.map.parameters, x[:-1]))
        return energy, float(x[-1]), np.linalg.eigvals(loop).astype(np.complex128)

    def quantity(self, x: Array, name: str) -> tuple[float, Array]:
        """See :meth:`~.branch.Branch.quantity`; the only quantity is the controller's target."""
        return float(x[-1]), np.eye(self.n + 1)[-1]


@checked
def controlled_fixed_point(
    step: ReturnMap, policy: Policy, start: Vector
) -> tuple[Array, ComplexArray]:
    """Find where a controlled stride settles: a point of the :class:`ControlledFamily`.

    Args:
        step: as for :class:`ControlledFamily`.
        policy: controls (NUM_SLOTS,) at a state (n,), such as
            ``lambda z: controller.solve(z, target).controls``.
        start: (n,) first guess.

    Returns:
        (n,) the state; (n,) eigenvalues of the closed loop there.

    Raises:
        GaitError: if a stride fails on the way, or there is no convergence.
    """
    family = ControlledFamily(step, lambda z, _: policy(z), VARIED[0])
    point = family.point(family.correct(np.append(start, 0.0), family.anchor))
    return point.state, point.eigenvalues
