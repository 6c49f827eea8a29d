"""The paper's controllers (Section IV) on whichever return map the user chooses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import MapKind, Outcome, Slot, StrideKind
from template_control.slip.control.modified_walking import Aim
from template_control.slip.control.stride_solver import (
    LEAST_PULL,
    TARGET_ONLY,
    Prior,
    StrideEnd,
    solve_stride,
    whole,
)
from template_control.slip.dynamics.stride import controls, finite
from template_control.slip.maps.return_map import REAR_BOTTOM, ReturnMap
from template_control.slip.maps.section import VLO, Section
from template_control.slip.parameters import SlipParameters

_ANGLE, _K_SC, _K_SD = Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD
# A leg that touches the ground at the apex has a map without derivatives; so much flatter it falls
# for 8 ms [rad].
_APEX_MARGIN = 0.001
_KAPPA_2 = np.array((0.5, 1.5))  # bounds over k0
_LANDING = (_ANGLE, _K_SC, _K_SD)
# Bounds of the touchdown angle [deg]: a flatter leg would need a friction coefficient over 1 to
# land on, a vertical one would make no step.
_ANGLES = 45.0, 89.9
_STIFFNESSES = 0.05, 20.0  # bounds [k0]; wide, as they only keep the search from running away
_SEEDS = 3  # of the grid: the nearest minimum need not be the best, and each takes a search
_REACHED = 1e-3  # residual that counts as reached
_ACCEPTABLE = 0.05  # residual below which no further start is tried


@dataclass(frozen=True)
class StepSolution:
    """Controls of one stride, and what they are predicted to do.

    Attributes:
        controls: (NUM_SLOTS,) u by Slot.
        predicted: (m,) state at the next section, on the map the controls were found on.
        residual: root of the weighted sum of squared errors in (36).
        outcome: how the predicted stride ends.
        reached: whether it ends at the target (and, running, at the wanted compression).
    """

    controls: Array
    predicted: Array
    residual: float
    outcome: Outcome
    reached: bool


@dataclass(frozen=True)
class Design:
    """A controller's stride, its free controls, and where its search begins."""

    stride: str  # key of STRIDE_START
    free: tuple[Slot, ...]
    # Values over whose product the search begins, by the controls that share them [deg, k0]. All
    # other controls are 70 deg and k0.
    axes: Mapping[tuple[Slot, ...], ArrayLike]
    # Whether that grid shows every minimum; then only a guess that reaches the target is taken
    # without looking at it.
    dense: bool = False
    # The touchdown angle stays this far below asin(y / l0), at which the leg is on the ground at
    # once [rad]; None: it may be steeper.
    margin: float | None = None
    compression: float | None = None  # wanted length of the leg at the bottom [l0]; None: any
    by_energy: bool = False  # kappa_2 follows from energy, (38)
    kept: tuple[Slot, ...] = ()  # controls of a guess that the search leaves as they are

    def table(self, parameters: SlipParameters) -> Array:
        """(4, f) of a :class:`~.stride_solver.Prior`, whose base each start of the search is."""
        k0 = parameters.leg_stiffness
        angle = [slot is _ANGLE for slot in self.free]
        (flattest, steepest), (softest, stiffest) = np.radians(_ANGLES), _STIFFNESSES
        unit = np.where(angle, 1.0, k0)
        lower = np.where(angle, flattest, softest * k0)
        return np.array([lower, unit, lower, np.where(angle, steepest, stiffest * k0)])

    def grid(self, parameters: SlipParameters) -> Array:
        """Controls (n, NUM_SLOTS) over the product of the axes."""
        k0 = parameters.leg_stiffness
        mesh = np.meshgrid(*map(np.asarray, self.axes.values()), indexing="ij")
        grid = np.tile(controls(np.radians(70.0), k0, k0, k0, k0), (mesh[0].size, 1))
        for slots, values in zip(self.axes, mesh, strict=True):
            for slot in slots:
                scale = np.pi / 180.0 if slot is _ANGLE else k0
                grid[:, slot] = values.ravel() * scale
        return grid


class Controller:
    """Finds the controls of one stride by least squares on a return map, (36) with weights of 1.

    Args:
        parameters: the template.
        kind: of return map.

    Attributes:
        design: the stride, its free controls, and where the search begins.
    """

    design: ClassVar[Design]

    @checked
    def __init__(self, parameters: SlipParameters, kind: MapKind = MapKind.EXACT) -> None:
        self._map = ReturnMap(parameters, self.design.stride, kind)
        self._slots = [int(slot) for slot in self.design.free]
        self._table = self.design.table(parameters)
        self._grid = self.design.grid(parameters)

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
        design, p, (n, m) = self.design, self._map.parameters, self._map.dimensions
        start, aim = finite("section state", z, n), finite("target", target, m)
        self._check(aim)
        stride = whole(self._map, start, () if design.compression is None else (REAR_BOTTOM,))
        if design.by_energy:
            stride = stride._replace(energy=Aim(aim, _KAPPA_2 * p.leg_stiffness))
        if design.compression is not None:
            aim = np.append(aim, design.compression * p.rest_length)
        table = self._table.copy()
        if design.margin is not None:
            top = np.arcsin(min(start[1] / p.rest_length, 1.0)) - design.margin
            turns = self._slots.index(_ANGLE)
            table[2:, turns] = np.minimum(table[2:, turns], top)
        best = None if guess is None else self._descend(stride, aim, table, guess)
        if best is not None and best.residual <= (_REACHED if design.dense else _ACCEPTABLE):
            return best
        grid = self._grid.copy()
        if guess is not None:
            for slot in design.kept:
                grid[:, slot] = guess[slot]
        residuals = np.array([self._solution(stride, aim, u.copy()).residual for u in grid])
        seeds = np.argsort(residuals)[:_SEEDS]
        if best is not None and design.dense:
            # A seed worse than what is found leads nowhere better.
            seeds = seeds[residuals[seeds] <= best.residual]
        for seed in seeds:
            found = self._descend(stride, aim, table, grid[seed])
            if best is None or found.residual < best.residual:
                best = found
            if best.residual <= _ACCEPTABLE:
                break
        assert best is not None
        return best

    def _descend(self, stride: StrideEnd, aim: Array, table: Array, start: Array) -> StepSolution:
        """The best controls that are found from some; ``aim`` has the compression too."""
        table[0] = np.clip(start[self._slots], *table[2:])
        prior = Prior(start, self._slots, table, TARGET_ONLY, LEAST_PULL)
        u, _ = solve_stride(stride, aim, prior, np.eye(len(aim)))
        return self._solution(stride, aim, u)

    def _solution(self, stride: StrideEnd, aim: Array, u: Array) -> StepSolution:
        """Controls, which (38) may complete, and what they do."""
        end, outcome = stride(u)
        completed = outcome is Outcome.SECTION
        residual = float(np.linalg.norm(aim - end)) if completed else np.inf
        predicted = end[: self._map.dimensions[1]]
        return StepSolution(u, predicted, residual, outcome, residual <= _REACHED)

    def _check(self, target: Array) -> None:
        p = self._map.parameters
        lowest = p.rest_length * np.sin(np.radians(_ANGLES[0]))
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
    """Apex to apex with both stiffnesses and the angle: (34) to (36); see :class:`Controller`.

    The leg is wanted to be 0.9 l0 long at the bottom.
    """

    design = Design(
        stride=StrideKind.RUN,
        free=_LANDING,
        axes={
            (_ANGLE,): np.arange(52.0, 81.0, 4.0),
            (_K_SC, _K_SD): (0.7, 1.0, 1.4, 2.0, 3.0),
        },
        margin=_APEX_MARGIN,
        compression=0.9,
    )


class ActiveWalking(Controller):
    """VLO to VLO with kappa_1, kappa_2 and the angle: (36) and (37); see :class:`Controller`."""

    design = Design(
        stride=StrideKind.WALK,
        free=_LANDING,
        axes={(_ANGLE,): np.arange(60.0, 79.0, 2.0), (_K_SD,): (0.8, 1.0, 1.2)},
    )


class ModifiedWalking(Controller):
    """VLO to VLO with the angle; kappa_2 follows from energy, (38); see :class:`Controller`.

    kappa_1 is k0, and kappa_2 from 0.5 to 1.5 k0. One control seldom reaches all of the target.
    """

    design = Design(
        stride=StrideKind.WALK,
        free=(_ANGLE,),
        axes={(_ANGLE,): np.arange(58.0, 81.0, 1.0)},
        dense=True,
        margin=0.05,
        by_energy=True,
    )


class WalkToRun(Controller):
    """VLO to apex with the front leg's stiffnesses before and after its bottom: (39) to (41).

    As :class:`Controller`; a guess's touchdown angle, k_sc and k_sd, which are the walking
    controller's, are kept. If ``simplified``, the rear leg is ignored after the virtual bottom, as
    by the paper's controller; its reference then has to be tuned (Table IV).
    """

    design = Design(
        stride=StrideKind.WALK_TO_RUN,
        free=(Slot.K_SC_WR, Slot.K_SD_WR),
        axes={
            (Slot.K_SC_WR,): (0.4, 0.6, 0.9, 1.2, 1.6, 2.2),
            (Slot.K_SD_WR,): (0.8, 1.4, 2.0, 2.6, 3.5, 6.0),
        },
        kept=_LANDING,
    )

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        kind: MapKind = MapKind.EXACT,
        simplified: bool = False,
    ) -> None:
        super().__init__(parameters, kind)
        if simplified:
            self._map = ReturnMap(parameters, StrideKind.WALK_TO_RUN_SIMPLIFIED, kind)


class RunToWalk(Controller):
    """Apex to VLO with both stiffnesses and the angle: (42) to (44); see :class:`Controller`."""

    design = Design(
        stride=StrideKind.RUN_TO_WALK,
        free=_LANDING,
        axes={
            (_ANGLE,): np.arange(60.0, 79.0, 3.0),
            (_K_SC,): (1.0, 2.0, 3.5, 5.5),
            (_K_SD,): (0.8, 1.1, 1.5),
        },
        margin=_APEX_MARGIN,
    )


TargetedPolicy = Callable[[Array, float], Array]
"""Controls (NUM_SLOTS,) at a section state (n,) and a target."""

VARIED = ("energy", "height", "speed")


@checked
def section_target(
    parameters: SlipParameters, section: Section, quantities: Mapping[str, float]
) -> Array:
    """A symmetric (n,) state: dx/dt, y, 0 at VLO, dx/dt, y at apex.

    Args:
        parameters: the template; at VLO the stance leg's spring, of stiffness k0, counts.
        section: VLO or APEX.
        quantities: two of energy [J], height [m], speed [m/s].

    Raises:
        ParameterError: if there is no such state.
    """
    if len(quantities) != 2 or not set(quantities) <= set(VARIED):
        raise ParameterError(
            f"a target is given by {', '.join(quantities) or 'nothing'}: give two of"
            f" {', '.join(VARIED)}"
        )
    p = parameters
    if "height" in quantities:
        y = quantities["height"]
    else:
        weight = p.mass * p.gravity
        stiffness = p.leg_stiffness if section is VLO else 0.0
        # weight * y + stiffness * (rest_length - y)^2 / 2 = rest, the root next to rest_length
        rest = quantities["energy"] - 0.5 * p.mass * quantities["speed"] ** 2
        over = rest - weight * p.rest_length
        root = weight**2 + 2.0 * stiffness * over
        y = p.rest_length + (2.0 * over / (weight + np.sqrt(root)) if root >= 0.0 else np.nan)
    if "speed" in quantities:
        speed = quantities["speed"]
    else:
        speed = float(section.speed(p, y, quantities["energy"]))
    if not (np.isfinite(y) and np.isfinite(speed)):
        text = ", ".join(f"{name} {value:g}" for name, value in quantities.items())
        raise ParameterError(f"no {section.name} state has {text}: give more energy")
    return section.of([0.0, y, speed, 0.0])


@checked
def targeted(
    controller: Controller,
    parameters: SlipParameters,
    section: Section,
    held: Mapping[str, float],
    varied: str,
    guess: Array,
) -> TargetedPolicy:
    """A controller as a policy over one quantity of its target.

    Args:
        controller: of a stride from a section to the same.
        parameters: the template.
        section: VLO or APEX.
        held: the target's other quantity.
        varied: which of :data:`VARIED` the policy's second argument is.
        guess: (NUM_SLOTS,) controls to search from, which distinguish gaits of one target.
    """

    def controls(z: Array, value: float) -> Array:
        target = section_target(parameters, section, {**held, varied: value})
        return controller.solve(z, target, guess).controls

    return controls
