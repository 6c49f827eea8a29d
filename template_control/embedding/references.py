"""From a plan and a phase to what the whole-body QP is asked for: equation (45)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled

Array = NDArray[np.float64]

_CAP_SHARE = 1.3
_CAP_FLOOR = 0.025  # of the weight


@compiled
def pd(
    acceleration: float,
    position: float,
    velocity: float,
    measured: float,
    rate: float,
    kp: float,
    kd: float,
) -> float:
    """Wanted acceleration of one coordinate: feedforward and PD feedback."""
    return acceleration + kp * (position - measured) + kd * (velocity - rate)


@compiled
def leg_forces(
    meta_row: Array, com_x: float, com_y: float, rest_length: float, forces: Array
) -> None:
    """The template's leg forces (2, 2) [N], rows rear and front, columns x and y.

    Args:
        meta_row: (7,) toes and stiffnesses of the plan's segment.
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


def unloading_cap(template_force: float, weight: float) -> float:
    """Largest normal force of the rear foot in double stance [N]: near the template's.

    It leaves the foot no load to lift off with.
    """
    return _CAP_SHARE * template_force + _CAP_FLOOR * weight
