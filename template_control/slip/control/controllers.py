"""The paper's controllers (Section IV) on whichever return map the user chooses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import MapKind, Slot
from template_control.slip.control.design import (
    ACTIVE_RUNNING,
    ACTIVE_WALKING,
    MODIFIED_WALKING,
    RUN_TO_WALK,
    WALK_TO_RUN,
    Design,
)
from template_control.slip.control.modified_walking import ModifiedMap
from template_control.slip.control.step_solver import Step, StepProblem, StepSolution
from template_control.slip.dynamics.stride import finite
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]


class Controller:
    """Finds the controls of one stride by least squares on a return map, (36).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (m,) rho of (36), one a number of the target; 1 each by default.

    Attributes:
        design: the stride, its free controls, and where the search begins.
    """

    design: ClassVar[Design]

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] | None = None,
    ) -> None:
        self._search_on(ReturnMap(parameters, self.design.stride, kind), weights)

    def _search_on(
        self, step: Step, weights: Sequence[float] | None, compression: float | None = None
    ) -> None:
        """Make the problem; ``compression`` is the leg's wanted length at the bottom [m]."""
        unknowns = self.design.unknowns(step.parameters)
        self._problem = StepProblem(step, unknowns, weights, compression)
        self._grid = self.design.grid(step.parameters)

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
        problem, design = self._problem, self.design
        n, m = problem.step.dimensions
        start, aim = finite("section state", z, n), finite("target", target, m)
        self._check(aim)
        near = None if guess is None else problem.solve(start, aim, [guess])
        content = problem.tolerance if design.dense else problem.acceptable
        if near is not None and near.residual <= content:
            return near
        costs = problem.costs(start, aim, self._grid)
        # Where the grid is dense, a seed worse than what is found leads nowhere better.
        limit = near.residual**2 if near is not None and design.dense else np.inf
        seeds = [self._grid[i] for i in np.argsort(costs)[: design.seeds] if costs[i] <= limit]
        if near is not None and not seeds:
            return near
        far = problem.solve(start, aim, seeds or [self._grid[0]])
        return far if near is None or far.residual < near.residual else near

    def _check(self, target: Array) -> None:
        p = self._problem.step.parameters
        lowest = p.rest_length * np.sin(np.radians(self.design.angles[0]))
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


class ActiveRunning(Controller):
    """Apex to apex with both stiffnesses and the angle: (34) to (36).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (3,) rho of dx/dt, y and the leg's compression; 1 each by default.
        compression: length of the leg at the bottom over its rest length.
    """

    design = ACTIVE_RUNNING

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] | None = None,
        compression: float = 0.9,
    ) -> None:
        length = compression * parameters.rest_length
        self._search_on(ReturnMap(parameters, self.design.stride, kind), weights, length)


class ActiveWalking(Controller):
    """VLO to VLO with kappa_1, kappa_2 and the angle: (36) and (37); see :class:`Controller`."""

    design = ACTIVE_WALKING


class ModifiedWalking(Controller):
    """VLO to VLO with the angle; kappa_1 is given and kappa_2 follows from energy, (38).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (3,) rho; 1 each by default.
        kappa_1: stiffness until the virtual bottom [N/m]; k0 by default.
        stiffness_range: bounds of kappa_2 over k0.
        top_margin: the angle stays this far [rad] below asin(y / l0), at which the front leg
            would touch down at once.
    """

    design = MODIFIED_WALKING

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] | None = None,
        kappa_1: float | None = None,
        stiffness_range: tuple[float, float] = (0.5, 1.5),
        top_margin: float = 0.05,
    ) -> None:
        k0 = parameters.leg_stiffness
        step = ModifiedMap(parameters, kind, (stiffness_range[0] * k0, stiffness_range[1] * k0))
        self._search_on(step, weights)
        if kappa_1 is not None:
            self._grid[:, Slot.K_SC] = kappa_1
        self._modified = step
        self._steepest = self._problem.unknowns.upper
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
            self._problem.unknowns, upper=np.minimum(top, self._steepest)
        )
        return super().solve(z, target, guess)


class WalkToRun(Controller):
    """VLO to apex with the front leg's stiffnesses before and after its bottom: (39) to (41).

    Args:
        parameters: the template.
        kind: of return map.
        weights: (2,) rho; 1 each by default.
        simplified: ignore the rear leg after the virtual bottom, as the paper's controller
            does; its reference then has to be tuned (Table IV).
    """

    design = WALK_TO_RUN

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        weights: Sequence[float] | None = None,
        simplified: bool = False,
    ) -> None:
        stride = self.design.stride + ("*" if simplified else "")
        self._search_on(ReturnMap(parameters, stride, kind), weights)

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
    """Apex to VLO with both stiffnesses and the angle: (42) to (44); see :class:`Controller`."""

    design = RUN_TO_WALK
