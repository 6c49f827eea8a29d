"""What the sideways motion of the template depends on: its planar path, and who stands when.

Frame: x forward, y to the left, z up; the height that the planar template calls y is z here.
In space each leg is a massless spring from its toe (x_i, y_i, 0) to the CoM (x, y, z), with the
planar length l_i, the length L_i, L_i^2 = l_i^2 + (y - y_i)^2, and the force F_i = k (l0 - L_i):

    m d2y/dt2 = sum_i F_i (y - y_i) / L_i.

F_i and L_i depend on y - y_i in the second order only. So to the first order x and z go along the
planar path, and

    d2y/dt2 = sum_i c_i(t) (y - y_i),   c_i = f_i / (m l_i),

where f_i is the leg force of the planar path. By the mirror symmetry of left and right the error
of x and z is of the second order in y - y_i, and that of y of the third. For a robot whose CoM is
held on the planar path, and whose forces pass through the CoM, the equation is exact.

The path itself tells c_i, whatever makes its forces: sum_i c_i = (d2z/dt2 + g) / z, and in double
stance sum_i c_i x_i = sum_i c_i x - d2x/dt2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.vocabulary import Leg, Reset
from template_control.slip.dynamics.stride import Stride

Array = NDArray[np.float64]

NEXT = 2
"""Index of the next foothold; 0 and 1 are those of the rear and the front toe at the start."""

IN_AIR = -1
_SHARE = 0.08  # of sqrt(z / g), a step of the integration: errors of 1e-6
_SAME = 1e-12  # [s] two times that are one


class LateralPath(NamedTuple):
    """A planar path up to the first section after its next touchdown, for compiled functions.

    Attributes:
        coefficients: (2, n, ORDER + 1) polynomials of x and z of the segments.
        meta: (n, 7) start time, duration, node, toes, stiffnesses.
        footholds: (n, 2) index of the foothold that rear and front leg stand on; -1 in the air.
        gravity: g [m/s^2].
        longest: step of the integration [s].
        touchdown: time of the next touchdown [s], inf if the path has none.
        section: time of the first section after it [s], inf if the path does not come there or
            starts below the ground.
        beside: index, 0 or 1, of the foothold beside which the next foot lands.
    """

    coefficients: Array
    meta: Array
    footholds: NDArray[np.int64]
    gravity: float
    longest: float
    touchdown: float
    section: float
    beside: int


def lateral_path(strides: Sequence[Stride], gravity: float) -> LateralPath:
    """Of strides each of which starts where the one before ended.

    Args:
        strides: at least one, such as those of the path that a robot follows.
        gravity: g [m/s^2].
    """
    metas, resets, sections, offset = [], [], [], 0.0
    for stride in strides:
        meta = stride.meta.copy()
        meta[:, 0] += offset
        metas.append(meta)
        resets += [(offset + e.time, e.reset) for e in stride.events]
        offset += stride.duration
        if stride.completed:
            sections.append(offset)
    meta = np.concatenate(metas)
    footholds, touchdown, beside = _footholds(meta, resets)
    height = float(strides[0].cy[0, 0])  # of a robot that falls it may be below its foot
    section = next((time for time in sections if time > touchdown), np.inf)
    return LateralPath(
        coefficients=np.concatenate([(s.cx, s.cy) for s in strides], axis=1),
        meta=meta,
        footholds=footholds,
        gravity=float(gravity),
        longest=_SHARE * float(np.sqrt(height / gravity)) if height > 0.0 else np.inf,
        touchdown=touchdown,
        section=section if height > 0.0 else np.inf,
        beside=beside,
    )


def _footholds(
    meta: Array, resets: Sequence[tuple[float, Reset]]
) -> tuple[NDArray[np.int64], float, int]:
    """Foothold of each leg in each segment; time of the first landing, and beside which."""
    legs = np.arange(2)  # the foothold of each role
    landings: list[tuple[float, int]] = []
    footholds = np.tile(legs, (len(meta), 1))
    for time, reset in resets:
        if reset in (Reset.SHIFT, Reset.SWAP):
            legs = legs[::-1].copy()
        elif reset in (Reset.PLACE_REAR, Reset.PLACE_FRONT):
            role = Leg.REAR if reset is Reset.PLACE_REAR else Leg.FRONT
            legs[role] = NEXT + len(landings)
            landings.append((time, int(legs[1 - role])))
        footholds[int(np.searchsorted(meta[:, 0], time - _SAME)) :] = legs
    footholds[meta[:, 5:7] == 0.0] = IN_AIR  # NaN where both legs stand without springs
    first, beside = landings[0] if landings else (np.inf, 0)
    return footholds, first, beside
