"""Steps that catch a robot on soles which is pushed off the ground that its feet enclose.

On the linear pendulum, ahead and to the side: the capture point xi = x + x'/w leaves a centre of
pressure p with xi' = w (xi - p). The foot that is further from it lifts off, as it bears nothing,
p is where the sole of the other one is nearest to xi, and the foot lands where xi will be then, or
as near to it as its leg reaches: a foot that is set down next to the one which bears the robot
frees that one for a step to the side.
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.slip.similarity import Scale

CATCHING_SHARE = 0.7
"""Share of a catching step's way to the side at which the capture point is as the foot lands."""
_ROUNDS = 4  # of the step's duration, which depends on the foothold, and the foothold on it
# A foot moves ahead or back only where xi will be further off the middle of the feet than this
# share of half a sole.
_OFF = 0.7
_LATE = 0.2  # least time in which a foot that is in the air lands, of that of a whole step
# For the reference template.
_AHEAD = 0.4  # how far ahead of the CoM and behind it a foot lands at most [m]
_SPEED = 2.4  # mean speed of a foot in the air [m/s]
_LASTS = (0.17, 0.35)  # shortest and longest time in the air [s]


class Reach(NamedTuple):
    """What a robot's feet can do; pairs are ahead and to the side."""

    half: Array  # (2,) half a sole that bears the centre of pressure [m]
    rates: Array  # (2,) w [1/s]
    # (2, 2) of each foot, y from the CoM where it is below its hip, and how far to either side of
    # that its sole is level [m]
    level: Array
    scale: Scale  # units of the template


class CatchingStep(NamedTuple):
    """A step of a foot."""

    foot: int
    lasts: float  # until it lands [s]
    foothold: float  # x where it does [m]
    pressure: float  # x of the centre of pressure until then [m]


def catching_step(
    motion: Array, feet: Array, reach: Reach, in_air: tuple[int, float] | None = None
) -> CatchingStep:
    """The step that leads the ground under both feet to the capture point.

    ``motion`` (2, 2) are position and velocity of the CoM, each ahead and to the side, ``feet``
    (2, 2) each foot's place [m, m/s]; ``in_air`` is a foot that is in the air, and the time until
    it is due [s].
    """
    length, speed = _AHEAD * reach.scale.length, _SPEED * reach.scale.speed
    soonest, longest = (time * reach.scale.time for time in _LASTS)
    point = motion[0] + motion[1] / reach.rates
    foot = int(np.argmax(np.hypot(*(feet - point).T)))
    if in_air is not None:
        foot, soonest = in_air[0], max(in_air[1], _LATE * soonest)
    here, stands, (below, lean) = feet[foot], feet[1 - foot], reach.level[foot].tolist()
    pressure = np.minimum(np.maximum(point, stands - reach.half), stands + reach.half)
    lasts, x = soonest, float(here[0])
    for _ in range(_ROUNDS):
        c, s = np.cosh(reach.rates * lasts), np.sinh(reach.rates * lasts)
        com = pressure + c * (motion[0] - pressure) + s * motion[1] / reach.rates
        ahead, side = (pressure + (c + s) * (point - pressure)).tolist()
        if abs(ahead - 0.5 * (stands[0] + here[0])) > _OFF * reach.half[0]:
            x = float(min(max(2.0 * ahead - stands[0], com[0] - length), com[0] + length))
        middle = com[1] + below
        if (side - stands[1]) * below > 0.0:
            side = stands[1] + (side - stands[1]) / CATCHING_SHARE
        y = min(max(side, middle - lean), middle + lean)
        lasts = max(soonest, min(hypot(x - here[0], y - here[1]) / speed, longest))
    return CatchingStep(foot, lasts, x, float(pressure[0]))
