"""The template's leg forces, and how a foot is unloaded before it lifts off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.compiled import compiled
from template_control.slip.similarity import tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class UnloadOptions(Checked):
    """Largest normal force of a foot that is about to lift off: near the template's.

    Attributes:
        share: of the template's force. It is over 1, as the robot's forces are not exactly the
            template's.
        floor: of the weight. It leaves a foot no load to lift off with, and the QP some room.
    """

    share: NotNegative = tuned(1.3)
    floor: NotNegative = tuned(0.025)

    def cap(self, template_force: float, weight: float) -> float:
        """Largest normal force that the foot may carry [N].

        Args:
            template_force: vertical force of the template's leg at this phase [N].
            weight: of the robot, m g [N].
        """
        return self.share * template_force + self.floor * weight


@compiled
def leg_forces(
    meta_row: Array, com_x: float, com_y: float, rest_length: float, forces: Array
) -> None:
    """The template's leg forces (2, 2) [N], rows rear and front, columns x and y.

    Args:
        meta_row: (7,) toes and stiffnesses of the path's segment.
        com_x, com_y: the template's CoM in the world [m].
        rest_length: l0 [m].
        forces: overwritten; zero for a leg in the air.
    """
    for leg in range(2):
        k = meta_row[5 + leg]
        dx = com_x - meta_row[3 + leg]
        length = np.sqrt(dx * dx + com_y * com_y)
        size = max(0.0, k * (rest_length - length)) / length
        forces[leg, 0], forces[leg, 1] = size * dx, size * com_y
