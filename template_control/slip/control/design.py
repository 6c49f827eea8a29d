"""What tells the paper's controllers (Section IV) apart, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.control.step_solver import Unknowns
from template_control.slip.dynamics.stride import controls
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_ANGLE, _K_SC, _K_SD = Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD
_LANDING = (_ANGLE, _K_SC, _K_SD)


@dataclass(frozen=True)
class Design:
    """A controller's stride, its free controls, and where its search begins.

    Attributes:
        stride: key of ``STRIDE_START``.
        free: the controls that it chooses.
        axes: values over whose product the search begins, by the controls that share them
            [deg, k0]. All other controls are 70 deg and k0.
        dense: whether that grid shows every minimum; then only a guess that reaches the target
            is taken without looking at it.
        angles: bounds of the touchdown angle [deg]: a flatter leg would need a friction
            coefficient over 1 to land on, a vertical one would make no step.
        stiffnesses: bounds of the leg stiffnesses [k0]; wide, as they only keep the search from
            running away.
        seeds: how many of the grid's best points are searched from; the nearest minimum need
            not be the best, and each seed takes a search.
    """

    stride: str
    free: tuple[Slot, ...]
    axes: Mapping[tuple[Slot, ...], ArrayLike]
    dense: bool = False
    angles: tuple[float, float] = (45.0, 89.9)
    stiffnesses: tuple[float, float] = (0.05, 20.0)
    seeds: int = 3

    def unknowns(self, parameters: SlipParameters) -> Unknowns:
        """The free controls and their bounds."""
        k0 = parameters.leg_stiffness
        angle = [slot is _ANGLE for slot in self.free]
        (flattest, steepest), (softest, stiffest) = np.radians(self.angles), self.stiffnesses
        return Unknowns(
            self.free,
            np.where(angle, flattest, softest * k0),
            np.where(angle, steepest, stiffest * k0),
            np.where(angle, 1.0, k0),
        )

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


ACTIVE_RUNNING = Design(
    stride="r",
    free=_LANDING,
    axes={
        (_ANGLE,): np.arange(52.0, 81.0, 4.0),
        (_K_SC, _K_SD): (0.7, 1.0, 1.4, 2.0, 3.0),
    },
)
ACTIVE_WALKING = Design(
    stride="w",
    free=_LANDING,
    axes={(_ANGLE,): np.arange(60.0, 79.0, 2.0), (_K_SD,): (0.8, 1.0, 1.2)},
)
MODIFIED_WALKING = Design(
    stride="w",
    free=(_ANGLE,),
    axes={(_ANGLE,): np.arange(58.0, 81.0, 1.0)},
    dense=True,
)
WALK_TO_RUN = Design(
    stride="wr",
    free=(Slot.K_SC_WR, Slot.K_SD_WR),
    axes={
        (Slot.K_SC_WR,): (0.4, 0.6, 0.9, 1.2, 1.6, 2.2),
        (Slot.K_SD_WR,): (0.8, 1.4, 2.0, 2.6, 3.5, 6.0),
    },
)
RUN_TO_WALK = Design(
    stride="rw",
    free=_LANDING,
    axes={
        (_ANGLE,): np.arange(60.0, 79.0, 3.0),
        (_K_SC,): (1.0, 2.0, 3.5, 5.5),
        (_K_SD,): (0.8, 1.1, 1.5),
    },
)
