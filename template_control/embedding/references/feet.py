"""Which foot is the rear and which the front leg, and how each of them swings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.references.swing_foot import SwingFoot, SwingOptions
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg, Reset

Array = NDArray[np.float64]


class Feet:
    """Roles of the two feet; the automaton's resets change them.

    Args:
        options: shape of the swings.
        reference: (2, 2, 3) where the swings' references are kept, by foot.

    Attributes:
        of: the foot that is the rear leg's, and the front leg's.
        swing: each foot's reference in the air.
        swing_time: (2,) time since each foot lifted off [s].
        landed: the foot that landed last; the template's ground is there.
    """

    def __init__(self, options: SwingOptions, reference: Array) -> None:
        self.of: tuple[int, int] = (0, 1)
        self.swing = tuple(SwingFoot(options, place) for place in reference)
        self.swing_time = np.full(2, np.inf)
        self.landed = 0

    def begin(self, rear: int) -> None:
        """Make foot ``rear`` the rear leg's, and put the template's ground under it."""
        self.of = (rear, 1 - rear)
        self.landed = rear

    def lift(self, foot: int, robot: Biped, swung: float = 0.0) -> None:
        """Begin the swing of a foot that leaves the ground, or has left it already.

        Args:
            foot: its index, 0 or 1, in the order of the robot's ``feet``.
            robot: the model, updated; the swing begins at the foot's position and velocity there.
            swung: time since the foot left the ground [s].
        """
        self.swing_time[foot] = swung
        self.swing[foot].start(robot.foot_position[foot], robot.foot_velocity[foot], swung)

    def apply(self, reset: Reset) -> None:
        """Change the roles as the automaton's reset does."""
        if reset in _EXCHANGES:
            self.of = (self.of[Leg.FRONT], self.of[Leg.REAR])


_EXCHANGES = (Reset.SHIFT, Reset.SWAP)
