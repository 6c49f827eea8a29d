"""Friction of the ground, from feet that slide."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.compiled import compiled
from template_control.robot.terms import MOST_CONTACTS
from template_control.slip.similarity import TIME, Scale, tuned

# A foot on the ground that moves faster along it slides [m/s, of the reference template]. Speeds
# of a foot that stands are noise; 0.5 mrad of it is about 0.02 m/s there, which never stays this
# large, and against the force, for the duration.
SLIDING_SPEED = 0.05
# Share of the weight that a foot carries at least. A small force's direction is not known well.
_LOAD = 0.05
# Share by which the ground has to be more slippery than believed, to be learnt.
_DOUBT = 0.03


@dataclass(frozen=True)
class FrictionOptions(Checked):
    """Tuning of the friction's estimate.

    Attributes:
        duration: a foot has to slide for so long to teach anything [s].
        settling: for so long after a touchdown nothing is learnt [s]. The force is the impact's.
        lowest: coefficient that is believed. On less no gait stands, and a smaller one would come
            from a fault.
    """

    duration: NotNegative = tuned(0.008, TIME)
    settling: NotNegative = tuned(0.005, TIME)
    lowest: Positive = tuned(0.3)


_F = np.float64
SLIDES = np.dtype(
    [
        ("least", _F),  # load that a foot carries at least to teach anything [N]
        ("speed", _F),  # of a foot that slides, at least [m/s]
        ("duration", _F),  # [s], of the options
        ("settling", _F),  # [s], of the options
        ("lowest", _F),  # of the options
        ("coefficient", _F),  # the estimate
        ("standing", _F, (MOST_CONTACTS,)),  # time since each contact's touchdown [s]
        ("time", _F, (MOST_CONTACTS,)),  # that each has slid for [s]
        ("along", _F, (MOST_CONTACTS,)),  # sums of the ground's forces since then [N]
        ("normal", _F, (MOST_CONTACTS,)),
    ],
    align=True,
)
"""Friction's estimate, and each contact's slide."""


@compiled
def feel_slides(s: Any, standing: NDArray[np.uint8], force: Array, speed: Array, dt: float) -> bool:
    """Estimate friction from the motion of the feet and their forces; True if the estimate changed.

    The force on a foot that slides lies on the friction cone, whatever was asked for. So its mean
    ratio while the foot slides is Coulomb's coefficient. It is only ever lowered: nothing shows how
    far a foot that stands is from sliding; and ground that was slippery once may be so again.

    A contact that chatters is ``standing`` (n,), though it carries nothing every other millisecond.
    ``force`` (n, d) has the ground first and up last [N], ``speed`` (n, d - 1 or more) is of the
    contacts' material points along the ground [m/s]; ``dt`` is since the last look [s].
    """
    before, level = s.coefficient, force.shape[1] - 1
    for foot in range(force.shape[0]):
        load = force[foot, level]
        s.standing[foot] = s.standing[foot] + dt if standing[foot] else 0.0
        if standing[foot] and load < s.least:
            continue
        if not standing[foot] or not _slides_on(s, foot, force, speed):
            s.time[foot] = s.along[foot] = s.normal[foot] = 0.0
            continue
        s.time[foot] += dt
        s.along[foot] += _size(force, foot, level)
        s.normal[foot] += load
        ratio = max(s.along[foot] / s.normal[foot], s.lowest)
        if s.time[foot] >= s.duration and ratio < (1.0 - _DOUBT) * s.coefficient:
            s.coefficient = ratio
    return s.coefficient != before


@compiled
def _slides_on(s: Any, foot: int, force: Array, speed: Array) -> bool:
    """True if a foot that stands slides, so that friction holds it back."""
    level, power = force.shape[1] - 1, 0.0
    if s.standing[foot] < s.settling or _size(speed, foot, level) <= s.speed:
        return False
    for axis in range(level):
        power += force[foot, axis] * speed[foot, axis]
    return power < 0.0


@compiled
def _size(vectors: Array, foot: int, level: int) -> float:
    """Length of a foot's vector along the ground."""
    if level == 1:
        return abs(vectors[foot, 0])
    return hypot(vectors[foot, 0], vectors[foot, 1])


def set_friction(
    data: Any, options: FrictionOptions, before: float, weight: float, scale: Scale
) -> None:
    """Begin the estimate ``data`` (1,) of a robot's ``weight`` [N], with a coefficient."""
    data["least"], data["speed"] = _LOAD * weight, SLIDING_SPEED * scale.speed
    for name in ("duration", "settling", "lowest"):
        data[name] = getattr(options, name)
    data["coefficient"] = before
