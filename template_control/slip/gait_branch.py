"""Branches of periodic gaits: continuation by pseudo-arclength, stability, special points.

A point of a branch is X = (dx/dt, y, dy/dt, alpha, k) at VLO, or (dx/dt, y, alpha, k) at apex.
The stride returns to its state, which a passive stride's conserved energy makes one equation
fewer than there are states; two quantities are held fixed; one dimension is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from template_control.errors import GaitError, ParameterError
from template_control.slip.parameters import SlipParameters
from template_control.slip.return_map import Linearisation, ReturnMap
from template_control.slip.stability import Kind, classify, shell_eigenvalues
from template_control.slip.vocabulary import NUM_SLOTS, Outcome, Slot

Array = NDArray[np.float64]

QUANTITIES = ("energy", "angle", "stiffness", "height", "speed")
_NEWTON = 12
_CONVERGED = 1e-10
_SINGULAR = 1e-7  # where branches cross, a step leaves the crossing direction alone
_SMALLEST_STEP = 1e-6
_LOCATE = 40


class Special(Enum):
    """What happens between two points of a branch."""

    FOLD = "fold"
    """The branch turns back in the quantity it is drawn over."""
    SADDLE_NODE = "eigenvalue through +1"
    FLIP = "eigenvalue through -1"
    NEIMARK_SACKER = "complex pair through the unit circle"


@dataclass(frozen=True)
class BranchPoint:
    """A periodic gait on a branch.

    Attributes:
        state: (n,) at the section.
        angle: touchdown angle [rad].
        stiffness: of the legs [N/m].
        energy: [J].
        eigenvalues: of the return map within its energy shell.
        kind: stable, saddle or unstable.
        tangent: of the branch, in scaled coordinates.
        special: what happens here, None at an ordinary point.
    """

    state: Array
    angle: float
    stiffness: float
    energy: float
    eigenvalues: NDArray[np.complex128]
    kind: Kind
    tangent: Array
    special: Special | None = None

    def quantity(self, name: str) -> float:
        """One of :data:`QUANTITIES`; the angle in radians."""
        return float(
            {
                "energy": self.energy,
                "angle": self.angle,
                "stiffness": self.stiffness,
                "height": self.state[1],
                "speed": self.state[0],
            }[name]
        )

    def controls(self) -> Array:
        """(NUM_SLOTS,) u."""
        u = np.zeros(NUM_SLOTS)
        u[Slot.TOUCHDOWN_ANGLE] = self.angle
        u[[Slot.K_SC, Slot.K_SD]] = self.stiffness
        return u


class Family:
    """One-parameter family of passive gaits with two quantities held fixed.

    Args:
        parameters: the template; its stiffness only scales.
        stride: "w" or "r".
        fixed: two of :data:`QUANTITIES` with their values (SI units, angle in radians).

    Raises:
        ParameterError: if ``fixed`` is anything else.
    """

    def __init__(self, parameters: SlipParameters, stride: str, fixed: Mapping[str, float]) -> None:
        if stride not in ("w", "r"):
            raise ParameterError(f"stride is {stride!r}: periodic gaits are 'w' or 'r'")
        if len(fixed) != 2 or not set(fixed) <= set(QUANTITIES):
            raise ParameterError(
                f"fixed quantities are {', '.join(fixed) or 'none'}: give two of"
                f" {', '.join(QUANTITIES)}"
            )
        for name, value in fixed.items():
            if not np.isfinite(value):
                raise ParameterError(f"{name} is {value!r}: give a finite number")
        self.parameters = parameters
        self.fixed = dict(fixed)
        self.map = ReturnMap(parameters, stride)
        self.n = self.map.dimensions[0]
        p = parameters
        speed = np.sqrt(p.gravity * p.rest_length)
        self._scale = np.array([*[speed, p.rest_length, speed][: self.n], 1.0, p.leg_stiffness])
        self._energy_scale = p.mass * p.gravity * p.rest_length

    def point(self, x: Array) -> BranchPoint:
        """The branch point at X (n + 2,); its tangent is oriented arbitrarily."""
        _, jacobian, linear = self._equations(x)
        tangent = _null_vector(jacobian)
        energy, gradient = self._energy(x)
        eigenvalues = shell_eigenvalues(linear.state_jacobian, gradient[: self.n])
        return BranchPoint(
            x[: self.n].copy(),
            float(x[-2]),
            float(x[-1]),
            energy,
            eigenvalues,
            classify(eigenvalues),
            tangent,
        )

    def correct(self, x: Array, direction: Array | None = None) -> Array:
        """The gait nearest X along the plane through it normal to ``direction`` (scaled).

        Without a direction the least change of X is made.

        Raises:
            GaitError: if Newton's method does not converge.
        """
        start = x.copy()
        x = x.copy()
        for _ in range(_NEWTON):
            residual, jacobian, linear = self._equations(x)
            if linear.outcome is not Outcome.SECTION:
                break
            if np.max(np.abs(residual)) < _CONVERGED:
                return x
            if direction is not None:
                jacobian = np.vstack((jacobian, direction))
                residual = np.append(residual, direction @ ((x - start) / self._scale))
            step = np.linalg.lstsq(jacobian, -residual, rcond=_SINGULAR)[0]
            x = x + step * self._scale
        raise GaitError("no periodic gait near the guess: give another start or a smaller step")

    def trace(
        self,
        start: Array,
        over: str,
        limits: tuple[float, float],
        step: float = 0.01,
        points: int = 400,
    ) -> list[BranchPoint]:
        """Follow the branch both ways from ``start`` by pseudo-arclength.

        Args:
            start: (n + 2,) guess of X.
            over: the quantity the branch is drawn over; folds are where it turns back.
            limits: of that quantity; the branch ends outside of them.
            step: largest arclength step, in scaled units.
            points: at most so many points each way.

        Returns:
            Points in order along the branch, special ones included.

        Raises:
            GaitError: if there is no gait near ``start``.
        """
        if over not in QUANTITIES or over in self.fixed:
            raise ParameterError(f"cannot draw over {over!r}: it must be a quantity left free")
        first = self.point(self.correct(start))
        back = self._follow(first, -first.tangent, over, limits, step, points)
        ahead = self._follow(first, first.tangent, over, limits, step, points)
        return [*reversed(back), first, *ahead]

    def _follow(
        self,
        first: BranchPoint,
        direction: Array,
        over: str,
        limits: tuple[float, float],
        largest: float,
        points: int,
    ) -> list[BranchPoint]:
        found: list[BranchPoint] = []
        here, step = first, largest
        while len(found) < points and step > _SMALLEST_STEP:
            x = self._coordinates(here)
            try:
                there = self.point(self.correct(x + step * direction * self._scale, direction))
            except GaitError:
                step *= 0.5
                continue
            turn = float(there.tangent @ direction)
            if abs(turn) < 0.9:
                step *= 0.5
                continue
            ahead = there.tangent * np.sign(turn)
            found += self._special(here, there, direction, ahead, over)
            found.append(there)
            if not limits[0] <= there.quantity(over) <= limits[1]:
                break
            here, direction = there, ahead
            step = min(largest, 1.5 * step)
        return found

    def _special(
        self, a: BranchPoint, b: BranchPoint, start: Array, end: Array, over: str
    ) -> list[BranchPoint]:
        """Special points between two neighbours, in order."""
        tests: list[tuple[Special, Callable[[BranchPoint, Array], float]]] = [
            (Special.FOLD, lambda point, tangent: self._rate(point, tangent, over)),
            (Special.SADDLE_NODE, lambda p, _: float(np.prod(1.0 - p.eigenvalues).real)),
            (Special.FLIP, lambda p, _: float(np.prod(1.0 + p.eigenvalues).real)),
            (Special.NEIMARK_SACKER, lambda p, _: _pair(p.eigenvalues)),
        ]
        found = []
        for special, test in tests:
            left, right = test(a, start), test(b, end)
            if np.isfinite(left) and np.isfinite(right) and left * right < 0.0:
                share, point = self._locate(a, b, start, test, left)
                found.append((share, _marked(point, special)))
        return [point for _, point in sorted(found, key=lambda pair: pair[0])]

    def _locate(
        self,
        a: BranchPoint,
        b: BranchPoint,
        direction: Array,
        test: Callable[[BranchPoint, Array], float],
        left: float,
    ) -> tuple[float, BranchPoint]:
        """Bisect the arc between two points for the zero of a test function."""
        xa, xb = self._coordinates(a), self._coordinates(b)
        chord = (xb - xa) / self._scale
        chord /= np.linalg.norm(chord)
        low, high, point = 0.0, 1.0, a
        for _ in range(_LOCATE):
            middle = 0.5 * (low + high)
            try:
                point = self.point(self.correct(xa + middle * (xb - xa), chord))
            except GaitError:
                break  # so near a crossing of branches that Newton's method stalls
            tangent = point.tangent * np.sign(point.tangent @ direction)
            if left * test(point, tangent) > 0.0:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high), point

    def _coordinates(self, point: BranchPoint) -> Array:
        return np.array([*point.state, point.angle, point.stiffness])

    def _rate(self, point: BranchPoint, tangent: Array, name: str) -> float:
        """Rate of a quantity along the branch."""
        return float(self._gradient(self._coordinates(point), name)[1] @ (tangent * self._scale))

    def _energy(self, x: Array) -> tuple[float, Array]:
        """Energy at the section [J], and its gradient in X."""
        p, n = self.parameters, self.n
        compression = p.rest_length - x[1] if n == 3 else 0.0
        energy = 0.5 * p.mass * x[0] ** 2 + p.mass * p.gravity * x[1]
        energy += 0.5 * x[-1] * compression**2
        gradient = np.zeros(n + 2)
        gradient[0] = p.mass * x[0]
        gradient[1] = p.mass * p.gravity - x[-1] * compression
        if n == 3:
            energy += 0.5 * p.mass * x[2] ** 2
            gradient[2] = p.mass * x[2]
        gradient[-1] = 0.5 * compression**2
        return float(energy), gradient

    def _gradient(self, x: Array, name: str) -> tuple[float, Array]:
        if name == "energy":
            return self._energy(x)
        i = {"angle": -2, "stiffness": -1, "height": 1, "speed": 0}[name]
        gradient = np.zeros(self.n + 2)
        gradient[i] = 1.0
        return float(x[i]), gradient

    def _equations(self, x: Array) -> tuple[Array, Array, Linearisation]:
        """Scaled residual (n + 1,), its Jacobian in scaled X, and the map's derivatives."""
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
        rows = full[1:] / self._scale[1:n, None]
        residual = (linear.state - x[:n])[1:] / self._scale[1:n]
        for name, value in self.fixed.items():
            held, gradient = self._gradient(x, name)
            size = (
                self._energy_scale
                if name == "energy"
                else self._scale[{"angle": -2, "stiffness": -1, "height": 1, "speed": 0}[name]]
            )
            residual = np.append(residual, (held - value) / size)
            rows = np.vstack((rows, gradient / size))
        return residual, rows * self._scale, linear


def _null_vector(jacobian: Array) -> Array:
    return np.asarray(np.linalg.svd(jacobian)[2][-1])


def _pair(eigenvalues: NDArray[np.complex128]) -> float:
    """|lambda|^2 - 1 of a complex pair, NaN without one."""
    complex_ones = eigenvalues[np.abs(eigenvalues.imag) > 1e-12]
    return float(np.abs(complex_ones[0]) ** 2 - 1.0) if complex_ones.size else np.nan


def _marked(point: BranchPoint, special: Special) -> BranchPoint:
    return BranchPoint(**{**point.__dict__, "special": special})
