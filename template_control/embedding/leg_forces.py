"""The template's leg forces, and how a foot is unloaded before it lifts off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled

Array = NDArray[np.float64]


# Largest normal force of a foot that is about to lift off, over the template's. It is over 1, as
# the robot's forces are not exactly the template's.
_UNLOADED = 1.3
_FLOOR = 0.025  # of the weight: it leaves a foot no load to lift off with, and the QP some room


@compiled
def unload_cap(template_force: float, weight: float) -> float:
    """Largest normal force of a foot that is about to lift off [N]: near the template's.

    ``template_force`` is the vertical force of the template's leg at this phase [N].
    """
    return _UNLOADED * max(template_force, 0.0) + _FLOOR * weight


@compiled
def leg_forces(meta_row: Array, toe: float, com: Array, body: Array, forces: Array) -> None:
    """The template's leg forces (2, 2) [N], rows rear and front, columns x and y.

    Springs push with k (l0 - l). Where none are, both legs carry m (g_y + y'') so that the centre
    of pressure is x - y (x'' + g_x) / (g_y + y''), or the foot next to it; each force acts along
    its leg. Of feet that bear the centre of pressure ahead and behind too, either one's share is
    1/2 in the middle of both, and 0 at the other end of the ground that they bear it on. The assist
    of two legs moves load from one to the other, so that it lifts nothing.

    Args:
        meta_row: (7,) toes and stiffnesses of the path's segment; NaN for legs without springs.
        toe: where x of the CoM is taken from [m].
        com: (6,) x and y of the template's CoM, and their first and second derivatives.
        body: (6,) m, g_y and g_x of gravity towards the ground and back along it, l0, the assist
            of two legs, and the half length of a foot [kg, m/s^2, m/s^2, m, m/s^2, m].
        forces: overwritten; zero for a leg in the air.
    """
    com_x, com_y, rest_length = com[0] + toe, com[1], body[3]
    if np.isnan(meta_row[5]):
        lift = max(body[1] + com[5], 1e-6)  # legs do not pull
        rear, front = meta_row[3], meta_row[4]
        share = com_x - com_y * (com[4] + body[2]) / lift - (rear - body[5])
        share /= front - rear + 2.0 * body[5]
        share = min(max(share, 0.0), 1.0)
        for leg in range(2):
            load = body[0] * lift * (share if leg == 1 else 1.0 - share)
            forces[leg, 0] = load * (com_x - meta_row[3 + leg]) / com_y
            forces[leg, 1] = load
        return
    for leg in range(2):
        k = meta_row[5 + leg]
        dx = com_x - meta_row[3 + leg]
        length = np.sqrt(dx * dx + com_y * com_y)
        size = max(0.0, k * (rest_length - length)) / length
        forces[leg, 0], forces[leg, 1] = size * dx, size * com_y
    if body[4] == 0.0 or meta_row[5] == 0.0 or meta_row[6] == 0.0:
        return
    moved = body[0] * body[4] / (meta_row[4] - meta_row[3])
    for leg in range(2):
        share = moved if leg == 0 else -moved
        forces[leg, 0] += share * (com_x - meta_row[3 + leg])
        forces[leg, 1] += share * com_y
        if forces[leg, 1] < 0.0:
            forces[leg, 0], forces[leg, 1] = 0.0, 0.0  # legs do not pull
