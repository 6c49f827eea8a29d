"""The paper's controllers (Section IV) on whichever return map the user chooses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import MapKind, Slot
from template_control.slip.control.modified_walking import ModifiedMap
from template_control.slip.control.step_solver import StepProblem, StepSolution, Unknowns
from template_control.slip.dynamics.stride import controls, finite
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_ANGLES = (np.radians(45.0), np.radians(89.9))
_STIFFNESS = (0.05, 20.0)  # of k0
_SEEDS = 3
_ANGLE, _K = Slot.TOUCHDOWN_ANGLE, (Slot.K_SC, Slot.K_SD)


class Controller:
    """Finds the controls of one stride; see the subclasses' constructors.

    Args:
        problem: least squares on a return map.
        grid: (n, NUM_SLOTS) controls to begin from when no guess is given or it fails.
        dense: whether the grid shows every minimum; then only a guess that reaches the
            target is taken without looking at it.
    """

    def __init__(self, problem: StepProblem, grid: Array, dense: bool = False) -> None:
        self._problem = problem
        self._grid = grid
        self._dense = dense
        self._content = problem.tolerance if dense else problem.acceptable

    def solve(
        self,
        z: Sequence[float] | Array,
        target: Sequence[float] | Array,
        guess: Array | None = None,
    ) -> StepSolution:
        """Controls that bring section state ``z`` (n,) nearest ``target`` (m,).

        Args:
            z: state at the section the stride starts from.
            target: state wanted at the section it ends at.
            guess: (NUM_SLOTS,) controls to begin from, such as the last stride's.

        Raises:
            ParameterError: if a state is not finite, or the target is beyond any stride.
        """
        n, m = self._problem.step.dimensions
        start, aim = finite("section state", z, n), finite("target", target, m)
        self._check(aim)
        near = None if guess is None else self._problem.solve(start, aim, [guess])
        if near is not None and near.residual <= self._content:
            return near
        costs = self._problem.costs(start, aim, self._grid)
        # Where the grid is dense, a seed worse than what is found leads nowhere better.
        limit = near.residual**2 if near is not None and self._dense else np.inf
        seeds = [self._grid[i] for i in np.argsort(costs)[:_SEEDS] if costs[i] <= limit]
        if near is not None and not seeds:
            return near
        far = self._problem.solve(start, aim, seeds or [self._grid[0]])
        return far if near is None or far.residual < near.residual else near

    def _check(self, target: Array) -> None:
        p = self._problem.step.parameters
        lowest = p.rest_length * np.sin(_ANGLES[0])
        if not target[0] > 0.0:
            raise ParameterError(f"target speed is {target[0]:g} m/s: give a positive one")
        if target[1] <= lowest:
            raise ParameterError(
                f"target height is {target[1]:g} m, under the lowest touchdown height of"
                f" {lowest:.3f} m: give a higher one"
            )
        if len(target) == 3 and target[1] >= p.rest_length:
            raise ParameterError(
                f"target height at VLO is {target[1]:g} m, not below the leg's rest length of"
                f" {p.rest_length:g} m: give a lower one"
            )


def _unknowns(parameters: SlipParameters, slots: tuple[Slot, ...]) -> Unknowns:
    k0 = parameters.leg_stiffness
    angle = [s is _ANGLE for s in slots]
    return Unknowns(
        slots,
        np.where(angle, _ANGLES[0], _STIFFNESS[0] * k0),
        np.where(angle, _ANGLES[1], _STIFFNESS[1] * k0),
        np.where(angle, 1.0, k0),
    )


def _grid(parameters: SlipParameters, base: Array, axes: Mapping[Slot, ArrayLike]) -> Array:
    """Controls over the product of ``axes`` (degrees, multiples of k0), else ``base``."""
    mesh = np.meshgrid(*map(np.asarray, axes.values()), indexing="ij")
    grid = np.tile(base, (mesh[0].size, 1))
    for slot, values in zip(axes, mesh, strict=True):
        scale = np.pi / 180.0 if slot is _ANGLE else parameters.leg_stiffness
        grid[:, slot] = values.ravel() * scale
    return grid


def _nominal(parameters: SlipParameters) -> Array:
    k0 = parameters.leg_stiffness
    return controls(np.radians(70.0), k0, k0, k0, k0)


class ActiveRunning(Controller):
    """Apex to apex with both stiffnesses and the angle: (34) to (36).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (3,) rho of dx/dt, y and the leg's compression.
        compression: length of the leg at the bottom over its rest length.
    """

    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
        compression: float = 0.9,
    ) -> None:
        slots = (_ANGLE, *_K)
        length = compression * parameters.rest_length
        step = ReturnMap(parameters, "r", kind)
        passive = _grid(
            parameters,
            _nominal(parameters),
            {_ANGLE: np.arange(52.0, 81.0, 4.0), Slot.K_SC: (0.7, 1.0, 1.4, 2.0, 3.0)},
        )
        passive[:, Slot.K_SD] = passive[:, Slot.K_SC]
        super().__init__(StepProblem(step, _unknowns(parameters, slots), weights, length), passive)


class ActiveWalking(Controller):
    """VLO to VLO with kappa_1, kappa_2 and the angle: (36) and (37)."""

    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
    ) -> None:
        axes: dict[Slot, ArrayLike] = {
            _ANGLE: np.arange(60.0, 79.0, 2.0),
            Slot.K_SD: (0.8, 1.0, 1.2),
        }
        super().__init__(
            StepProblem(
                ReturnMap(parameters, "w", kind), _unknowns(parameters, (_ANGLE, *_K)), weights
            ),
            _grid(parameters, _nominal(parameters), axes),
        )


class ModifiedWalking(Controller):
    """VLO to VLO with the angle; kappa_1 is given and kappa_2 follows from energy, (38).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (3,) rho.
        kappa_1: stiffness until the virtual bottom [N/m]; k0 by default.
        stiffness_range: bounds of kappa_2 over k0.
        top_margin: the angle stays this far [rad] below asin(y / l0), at which the front leg
            would touch down at once.
    """

    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
        kappa_1: float | None = None,
        stiffness_range: tuple[float, float] = (0.5, 1.5),
        top_margin: float = 0.05,
    ) -> None:
        base = _nominal(parameters)
        if kappa_1 is not None:
            base[Slot.K_SC] = kappa_1
        k0 = parameters.leg_stiffness
        step = ModifiedMap(parameters, kind, (stiffness_range[0] * k0, stiffness_range[1] * k0))
        super().__init__(
            StepProblem(step, _unknowns(parameters, (_ANGLE,)), weights),
            _grid(parameters, base, {_ANGLE: np.arange(58.0, 81.0, 1.0)}),
            dense=True,
        )
        self._modified = step
        self._top_margin = top_margin

    def solve(
        self,
        z: Sequence[float] | Array,
        target: Sequence[float] | Array,
        guess: Array | None = None,
    ) -> StepSolution:
        """See :meth:`Controller.solve`; one control seldom reaches all of the target."""
        self._modified.target = finite("target", target, 3)
        p = self._modified.parameters
        top = np.arcsin(min(float(z[1]) / p.rest_length, 1.0)) - self._top_margin
        self._problem.unknowns = replace(
            self._problem.unknowns, upper=np.array([min(top, _ANGLES[1])])
        )
        return super().solve(z, target, guess)


class WalkToRun(Controller):
    """VLO to apex with the front leg's stiffnesses before and after its bottom: (39) to (41).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (2,) rho.
        simplified: ignore the rear leg after the virtual bottom, as the paper's controller
            does; its reference then has to be tuned (Table IV).
    """

    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] = (1.0, 1.0),
        simplified: bool = False,
    ) -> None:
        slots = (Slot.K_SC_WR, Slot.K_SD_WR)
        axes: dict[Slot, ArrayLike] = {
            Slot.K_SC_WR: (0.4, 0.6, 0.9, 1.2, 1.6, 2.2),
            Slot.K_SD_WR: (0.8, 1.4, 2.0, 2.6, 3.5, 6.0),
        }
        step = ReturnMap(parameters, "wr*" if simplified else "wr", kind)
        super().__init__(
            StepProblem(step, _unknowns(parameters, slots), weights),
            _grid(parameters, _nominal(parameters), axes),
        )

    def solve(
        self,
        z: Sequence[float] | Array,
        target: Sequence[float] | Array,
        guess: Array | None = None,
    ) -> StepSolution:
        """See :meth:`Controller.solve`.

        Args:
            z: (3,) VLO state.
            target: (2,) apex state.
            guess: (NUM_SLOTS,) its touchdown angle, k_sc and k_sd, which are the walking
                controller's, are kept.
        """
        if guess is not None:
            self._grid[:, :3] = guess[:3]
        return super().solve(z, target, guess)


class RunToWalk(Controller):
    """Apex to VLO with both stiffnesses and the angle: (42) to (44)."""

    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
    ) -> None:
        axes: dict[Slot, ArrayLike] = {
            _ANGLE: np.arange(60.0, 79.0, 3.0),
            Slot.K_SC: (1.0, 2.0, 3.5, 5.5),
            Slot.K_SD: (0.8, 1.1, 1.5),
        }
        super().__init__(
            StepProblem(
                ReturnMap(parameters, "rw", kind), _unknowns(parameters, (_ANGLE, *_K)), weights
            ),
            _grid(parameters, _nominal(parameters), axes),
        )
