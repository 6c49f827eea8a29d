"""What a robot adds to the template's sideways motion, learnt from step to step."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from template_control.slip.lateral.options import LateralLearningOptions
from template_control.slip.lateral.side import Side

Array = NDArray[np.float64]


def _nothing() -> Array:
    return np.zeros((len(Side), 2))


@dataclass(frozen=True)
class LateralLearnt:
    """What has been learnt so far; each lesson gives a new one.

    Attributes:
        offset: (2, 2) what the robot adds to y and dy/dt at a section, in steps from the left and
            from the right foot [m, m/s]; rows are :attr:`Side.row`.
        stretch: duration of single stance over the template's.
    """

    offset: Array = field(default_factory=_nothing)
    stretch: float = 1.0

    def after_step(
        self, stance: Side, surprise: Array, options: LateralLearningOptions
    ) -> LateralLearnt:
        """After the section of a nominal step; a step with a push teaches nothing.

        Args:
            stance: side of the foot that the step began on.
            surprise: (2,) y from the stance foot and dy/dt over what was expected as the foot
                landed [m, m/s].
            options: scaled to the template.
        """
        limit, bound = np.array(options.surprise_bound), np.array(options.offset_bound)
        lesson = 0.5 * options.gain * np.clip(surprise, -limit, limit)
        offset = self.offset.copy()
        offset[stance.row] += (1.0 + options.one_sided) * lesson
        offset[stance.other.row] -= (1.0 - options.one_sided) * lesson
        return replace(self, offset=np.clip(offset, -bound, bound))

    def after_stance(
        self, lasted: float, planned: float, options: LateralLearningOptions
    ) -> LateralLearnt:
        """After a piece of single stance, such as that from a section to the touchdown.

        Args:
            lasted: its duration [s].
            planned: its duration on the path, without a stretch [s]; more than 0.
            options: how fast, and how much.
        """
        low, high = options.stretch_bounds
        seen = min(max(lasted / planned, low), high)
        stretch = self.stretch + options.stretch_gain * (seen - self.stretch)
        return replace(self, stretch=stretch)
