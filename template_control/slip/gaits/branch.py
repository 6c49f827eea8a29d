"""Branches of periodic gaits: pseudo-arclength past folds, stability, special points.

A gait is a point X where a family's equations vanish, one fewer than X has numbers: a curve.
The equations are the family's: :mod:`~.gait_branch`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, ComplexArray
from template_control.errors import GaitError, ParameterError
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.maps.return_map import ReturnMap


class Kind(Enum):
    """A gait's stability by its eigenvalues."""

    STABLE = "stable"
    SADDLE = "saddle"
    UNSTABLE = "unstable"
    NEUTRAL = "neutral"


def classify(eigenvalues: ComplexArray, tolerance: float = 0.0) -> Kind:
    """STABLE if all eigenvalues lie within the unit circle, UNSTABLE if none does, SADDLE between.

    NEUTRAL if the largest lies on the circle to the ``tolerance``.
    """
    sizes = np.abs(eigenvalues)
    if abs(sizes.max() - 1.0) < tolerance:
        return Kind.NEUTRAL
    outside = sizes >= 1.0
    if not outside.any():
        return Kind.STABLE
    return Kind.UNSTABLE if outside.all() else Kind.SADDLE


def shell_eigenvalues(jacobian: Array, energy_gradient: Array) -> ComplexArray:
    """Eigenvalues of a passive return map (n, n) within its energy shell, of a gradient (n,).

    Energy is conserved, so one eigenvalue of the whole map is 1: it says nothing, and is left out.
    """
    shell = np.linalg.svd(energy_gradient[None, :])[2][1:].T
    return np.linalg.eigvals(shell.T @ jacobian @ shell).astype(np.complex128)


QUANTITIES = ("energy", "angle", "stiffness", "height", "speed")
_NEWTON = 12
_CONVERGED = 1e-10
_SINGULAR = 3e-6  # where branches cross, a step leaves the crossing direction alone
_SMALLEST_STEP = 1e-6
_LOCATE = 40


class Special(Enum):
    """Special point between two points of a branch."""

    FOLD = "fold"
    """The branch turns back in the quantity it is drawn over."""
    SADDLE_NODE = "eigenvalue through +1"
    FLIP = "eigenvalue through -1"
    NEIMARK_SACKER = "complex pair through the unit circle"


@dataclass(frozen=True)
class BranchPoint:
    """A periodic gait on a branch.

    Attributes:
        x: (n + 1,) X, the family's coordinates.
        state: at the section: dx/dt, y, dy/dt at VLO, dx/dt, y at apex.
        controls: (NUM_SLOTS,) u of the stride.
        energy: at the section [J].
        target: what a controller is asked for, in the quantity it is varied in; None where
            there is no controller.
        eigenvalues: of the stride's map. A passive gait has those within its energy shell, a
            controlled one has all of them.
        kind: stable, saddle or unstable.
        tangent: of the branch, in scaled coordinates.
        special: what happens here; None at an ordinary point.
    """

    x: Array
    state: Array
    controls: Array
    energy: float
    target: float | None
    eigenvalues: ComplexArray
    kind: Kind
    tangent: Array
    special: Special | None = None

    @property
    def angle(self) -> float:
        """Touchdown angle [rad]."""
        return float(self.controls[Slot.TOUCHDOWN_ANGLE])

    @property
    def stiffness(self) -> float:
        """Stiffness of the leg that lands, from touchdown on [N/m]."""
        return float(self.controls[Slot.K_SC])

    def quantity(self, name: str) -> float:
        """One of :data:`QUANTITIES`, the angle in radians, or the controller's "target"."""
        if name == "target" and self.target is not None:
            return self.target
        values = (self.energy, self.angle, self.stiffness, self.state[1], self.state[0])
        return float(values[QUANTITIES.index(name)])


class Equations(NamedTuple):
    """A family's equations at X, which are zero on the branch."""

    residual: Array  # (n,)
    jacobian: Array  # (n, n + 1) in scaled X
    valid: bool  # whether the stride ended at its section
    controls: Array  # (NUM_SLOTS,) of the stride
    loop: Array  # derivatives of the state at its end by that at its start


class Branch(ABC):
    """A curve of gaits that can be followed."""

    map: ReturnMap
    scale: Array  # (n + 1,) natural size of each coordinate
    free: tuple[str, ...]  # quantities that vary along it
    noise: float = 0.0  # an eigenvalue this close to the unit circle does not count as crossing it
    # (n + 1,) scaled direction in which the first gait stays where its guess is; None where the
    # nearest gait will do.
    anchor: Array | None = None

    @abstractmethod
    def equations(self, x: Array) -> Equations:
        """Residual and Jacobian at X (n + 1,)."""

    @abstractmethod
    def stability(self, x: Array, loop: Array) -> tuple[float, float | None, ComplexArray]:
        """Energy [J], target and eigenvalues at X (n + 1,), with its equations' ``loop``."""

    @abstractmethod
    def quantity(self, x: Array, name: str) -> tuple[float, Array]:
        """A quantity of :attr:`free` [SI, rad], and its gradient (n + 1,) in X, not scaled."""

    def point(self, x: Array) -> BranchPoint:
        """The branch point at X (n + 1,); its tangent is oriented arbitrarily."""
        equations = self.equations(x)
        energy, target, eigenvalues = self.stability(x, equations.loop)
        return BranchPoint(
            x=x.copy(),
            state=x[: self.map.dimensions[0]].copy(),
            controls=equations.controls,
            energy=energy,
            target=target,
            eigenvalues=eigenvalues,
            kind=classify(eigenvalues, self.noise),
            tangent=np.linalg.svd(equations.jacobian)[2][-1],
        )

    def correct(self, x: Array, direction: Array | None = None) -> Array:
        """X (n + 1,) of the gait nearest a guess, in the plane through it normal to a direction.

        The direction is in scaled coordinates; None: any X will do. A GaitError without a gait.
        """
        start = x
        for _ in range(_NEWTON):
            residual, jacobian, valid, *_ = self.equations(x)
            if not valid:
                break
            if np.max(np.abs(residual)) < _CONVERGED:
                return x
            if direction is not None:
                jacobian = np.vstack((jacobian, direction))
                residual = np.append(residual, direction @ ((x - start) / self.scale))
            step = np.linalg.lstsq(jacobian, -residual, rcond=_SINGULAR)[0]
            x = x + step * self.scale
        raise GaitError("no periodic gait near the guess: give another start or a smaller step")

    def trace(
        self,
        start: Array,
        over: str,
        limits: tuple[float, float],
        step: float = 0.01,
        points: int = 400,
    ) -> list[BranchPoint]:
        """Points of the branch both ways from ``start`` by pseudo-arclength, special ones included.

        ``start`` (n + 1,) is a guess of X. ``over`` is the quantity that the branch is drawn over:
        folds are where it turns back, and the branch ends outside of its ``limits``. ``step`` is
        the largest arclength step, in scaled units; there are at most ``points`` each way.
        """
        if over not in self.free:
            raise ParameterError(
                f"cannot draw over {over!r}: give a quantity left free, {', '.join(self.free)}"
            )
        first = self.point(self.correct(start, self.anchor))
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
            try:
                there = self.point(self.correct(here.x + step * direction * self.scale, direction))
            except (GaitError, ParameterError):  # no gait, or none that a controller takes
                step *= 0.5
                continue
            turn = float(there.tangent @ direction)
            if abs(turn) < 0.9:
                step *= 0.5
                continue
            ahead = there.tangent * np.sign(turn)
            found += self._special(here, there, direction, ahead, over)
            found.append(there)
            if not limits[0] <= self.quantity(there.x, over)[0] <= limits[1]:
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
            known = special is Special.FOLD or min(abs(left), abs(right)) > self.noise
            if known and np.isfinite(left) and np.isfinite(right) and left * right < 0.0:
                share, point = self._locate(a, b, start, test, left)
                found.append((share, replace(point, special=special)))
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
        chord = (b.x - a.x) / self.scale
        chord /= np.linalg.norm(chord)
        low, high, point = 0.0, 1.0, a
        for _ in range(_LOCATE):
            middle = 0.5 * (low + high)
            try:
                point = self.point(self.correct(a.x + middle * (b.x - a.x), chord))
            except (GaitError, ParameterError):
                break  # so near a crossing of branches that Newton's method stalls
            tangent = point.tangent * np.sign(point.tangent @ direction)
            if left * test(point, tangent) > 0.0:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high), point

    def _rate(self, point: BranchPoint, tangent: Array, name: str) -> float:
        """Rate of a quantity along the branch."""
        return float(self.quantity(point.x, name)[1] @ (tangent * self.scale))


def _pair(eigenvalues: ComplexArray) -> float:
    """|lambda|^2 - 1 of a complex pair, NaN without one."""
    complex_ones = eigenvalues[np.abs(eigenvalues.imag) > 1e-12]
    return float(np.abs(complex_ones[0]) ** 2 - 1.0) if complex_ones.size else np.nan
