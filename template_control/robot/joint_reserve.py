"""How far a robot's joints are from their limits of speed, and from their stops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled

Array = NDArray[np.float64]


@compiled
def joint_reserve(q: Array, speeds: Array, limits: Array, ranges: Array) -> tuple[float, float]:
    """The fastest joint, and the one that is soonest at a stop.

    Args:
        q: (nq,) configuration; its last nu entries are the joints' angles [rad].
        speeds: (nu,) of the joints [rad/s].
        limits: (nu,) of these speeds [rad/s].
        ranges: (nu, 2) the joints' stops [rad].

    Returns:
        The largest share of its limit that a speed has. The shortest time in which a joint would
        come to its stop at its speed [s]: 0 of one that is there, inf where none moves.
    """
    fastest, soonest = 0.0, np.inf
    first = q.shape[0] - speeds.shape[0]
    for k in range(speeds.shape[0]):
        speed = speeds[k]
        fastest = max(fastest, abs(speed) / limits[k])
        down, up = q[first + k] - ranges[k, 0], ranges[k, 1] - q[first + k]
        if down <= 0.0 or up <= 0.0:
            soonest = 0.0
        elif speed > 0.0:
            soonest = min(soonest, up / speed)
        elif speed < 0.0:
            soonest = min(soonest, -down / speed)
    return fastest, soonest
