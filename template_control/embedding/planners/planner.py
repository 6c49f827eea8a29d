"""What a planner is: VLO state in, controls of the coming step out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.slip.gaits.gait import WalkingGait

Array = NDArray[np.float64]


ANY_ANGLE = (-np.inf, np.inf)
"""Of a step whose touchdown angle is free."""


@dataclass(frozen=True)
class Decision:
    """Controls for the step that begins at a VLO.

    Attributes:
        controls: (5,) u by Slot.
        predicted: (3,) VLO state the step should end in, offset included.
        feasible: the template completes the step with these controls.
        lasting: and a step after it, as far as the planner looks.
        reached: the planner's first choice was feasible; otherwise ``controls`` are the best
            reachable ones.
    """

    controls: Array
    predicted: Array
    feasible: bool
    lasting: bool
    reached: bool


class Planner(Protocol):
    """Chooses the controls of a step at VLO."""

    @property
    def gait(self) -> WalkingGait:
        """The gait to settle on."""

    @property
    def offset(self) -> Array:
        """(3,) estimate of the robot's VLO state less the template's after one step."""

    def decide(self, z: Array, angles: tuple[float, float] = ANY_ANGLE) -> Decision:
        """Controls for a step from VLO state ``z`` (3,) dx/dt, y, dy/dt.

        Args:
            z: the state.
            angles: touchdown angles [rad] the swing foot can still reach.
        """

    def observe(self, decision: Decision, z: Array) -> None:
        """Learn that the step planned by ``decision`` ended in VLO state ``z``."""
