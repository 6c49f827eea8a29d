"""What a foot in the air has met: ground to stand on, a wall, or an edge that it slips off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.slip.similarity import SPEED, TIME, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StumbleOptions(Checked):
    """When a foot in the air has met a wall or an edge.

    Attributes:
        steepness: a force whose horizontal part is more than this many times its vertical one
            comes from a wall: from ground to stand on it is the friction coefficient's at most.
        force: share of the weight that a wall's force has at least.
        linger: the wall counts for this long after its last force [s].
        sinking: a foot that still comes down faster than this has grazed an edge [m/s]. A swing
            ends with 0.2 m/s (``SwingOptions.landing_speed``).
        overdue: a foot that found no ground where it was due, and came down faster than this many
            times its swing's landing speed, may have hit an edge, and bounces off it.
        graze: a contact that lasts longer than this is none that grazes [s].
    """

    steepness: Positive = tuned(1.0)
    force: NotNegative = tuned(0.02)
    linger: NotNegative = tuned(0.015, TIME)
    sinking: NotNegative = tuned(0.3, SPEED)
    overdue: Positive = tuned(1.5)
    graze: NotNegative = tuned(0.004, TIME)


class Stumble:
    """Remembers what each foot has met.

    Args:
        options: when that is.
        weight: of the robot [N].

    Attributes:
        slipping: (2,) whether what each foot feels is no ground to stand on.
    """

    def __init__(self, options: StumbleOptions, weight: float) -> None:
        self._options = options
        self._least = options.force * weight
        self._left = [0.0, 0.0]
        self._touching = [0.0, 0.0]
        self._came = [0.0, 0.0]  # upward speeds before the feet touched
        self.slipping = [False, False]

    def blocked(self, foot: int) -> bool:
        """Whether a wall is in front of a foot."""
        return self._left[foot] > 0.0

    def feel(self, force: Array, rising: Array, landing: Sequence[float], dt: float) -> None:
        """Look at what acts on the feet, and how they move.

        Args:
            force: (2, d) the ground's force on each foot, forward first and up last [N].
            rising: (2,) their upward speeds [m/s].
            landing: downward speeds with which they were to touch down [m/s], of those that are
                overdue; inf of the others.
            dt: since the last look [s].
        """
        o = self._options
        # Number by number: arrays of two would take five times as long, at every tick.
        for foot, (one, rises) in enumerate(zip(force.tolist(), rising.tolist(), strict=True)):
            along, up = one[0], one[-1]
            wall = abs(along) > max(self._least, o.steepness * up)
            left = o.linger if wall and along < 0.0 else self._left[foot] - dt
            touching = self._touching[foot] + dt if up > 0.0 else 0.0
            self._left[foot], self._touching[foot] = left, touching
            if touching == 0.0:
                self._came[foot] = rises
            falls = rises < -o.sinking or self._came[foot] < -o.overdue * landing[foot]
            self.slipping[foot] = wall or (falls and 0.0 < touching < o.graze)
