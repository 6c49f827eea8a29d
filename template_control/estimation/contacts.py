"""State of the contacts: flags of the sensors, checked against walls and the path.

This is the only place where contact flags are judged. Everything in the controller that asks
whether a foot stands reads ``standing`` of ``CONTACTS``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.compiled import compiled
from template_control.robot.terms import LEGS, MOST_CONTACTS
from template_control.slip.similarity import TIME, Scale, tuned

EARLY = 0.015
"""A touchdown is due from this long before its time on the path [s, of the reference template].
Undisturbed feet come up to 10 ms before it."""
SINKING = 0.3
"""A foot that still comes down faster than this is not due: it may graze an edge [m/s, of the
reference template]. A walking swing ends with 0.2 m/s (``SwingOptions.landing_speed``)."""
SETTLING = 0.6
"""A contact comes down as fast to those of its foot that have landed [m/s, of the reference
template]: soon, and not hard."""
# A force whose horizontal part is more than this many times its vertical one comes from a wall:
# from ground to stand on it is the friction coefficient's at most.
_STEEPNESS = 1.0
_FORCE = 0.02  # share of the weight that a wall's force has at least


@dataclass(frozen=True)
class ContactOptions(Checked):
    """Belief in contact flags, and in walls.

    Attributes:
        doubt: a flag that the path does not expect is believed after it has held for this long [s].
            A foot that bounces off an edge leaves it sooner; of wrong flags, 2 % at random, four
            ticks in a row are one case in six million.
        linger: the wall counts for this long after its last force [s].
    """

    doubt: NotNegative = tuned(0.004, TIME)
    linger: NotNegative = tuned(0.015, TIME)


_F, _I = np.float64, np.int64
CONTACTS = np.dtype(
    [
        ("least", _F),  # horizontal force that a wall has at least [N]
        ("doubt", _F),  # [s], of the options
        ("linger", _F),  # [s], of the options
        ("early", _F),  # a touchdown is due from this long before its time on the path [s]
        ("sinking", _F),  # a foot that comes down faster is not due [m/s]
        ("settling", _F),  # a contact comes down to others of its foot as fast [m/s]
        ("expected", _I, (LEGS,)),  # by foot: IN_AIR, ON_GROUND or DUE
        ("contacts", _I),  # number of them
        ("foot", _I, (MOST_CONTACTS,)),  # that each contact is of
        ("flags", _I, (MOST_CONTACTS,)),  # of the last tick; 0 where a wall is pressed
        ("held", _F, (MOST_CONTACTS,)),  # time that each flag has been as it is [s]
        ("touching", np.uint8, (MOST_CONTACTS,)),  # whether each contact is on ground to stand on
        ("wall", _F, (LEGS,)),  # time that each foot's wall still counts [s]
        ("standing", np.uint8, (LEGS,)),  # whether each foot stands: on one contact at least
    ],
    align=True,
)
"""State of the contacts."""

IN_AIR, ON_GROUND, DUE = 0, 1, 2
"""Expectation of the path for a foot; one that is due to land may do either."""

NO_FORCE: Array = np.zeros((0, 2))
"""In place of forces that are not measured."""


@compiled
def update_contacts(c: Any, flags: BoolArray, force: Array, dt: float) -> None:
    """Take in the flags (n,) of a tick, and the forces (n, d), forward first and up last [N].

    A flag that says what the path expects of its foot is believed at once: a foot stands, is in the
    air, or is due to land, where either flag is expected. Any other flag is believed after
    ``ContactOptions.doubt``. A foot pressed against a wall does not stand; one of several contacts
    stands on one of them. With ``NO_FORCE`` walls are not looked for.
    """
    for foot in range(LEGS):
        c.standing[foot] = 0
        c.wall[foot] -= dt
    for i in range(c.contacts):
        flag, foot = 1 if flags[i] else 0, c.foot[i]
        if force.shape[0] > 0:
            along, up = force[i, 0], force[i, force.shape[1] - 1]
            if abs(along) > max(c.least, _STEEPNESS * up):
                flag = 0
                if along < 0.0:
                    c.wall[foot] = c.linger
        c.held[i] = c.held[i] + dt if flag == c.flags[i] else dt
        c.flags[i] = flag
        if c.expected[foot] in (DUE, flag) or c.held[i] >= c.doubt:
            c.touching[i] = flag
        if c.touching[i]:
            c.standing[foot] = 1


def set_contacts(
    data: Any,
    options: ContactOptions,
    weight: float,
    scale: Scale,
    groups: Sequence[Sequence[int]],
) -> None:
    """Write the constants of a robot of a weight [N], and of its feet's contacts, into ``data``."""
    now = data[0]
    now["contacts"] = sum(map(len, groups))
    for foot, group in enumerate(groups):
        now["foot"][list(group)] = foot
    now["least"], now["doubt"], now["linger"] = _FORCE * weight, options.doubt, options.linger
    now["early"], now["sinking"] = EARLY * scale.time, SINKING * scale.speed
    now["settling"] = SETTLING * scale.speed


def forget_contacts(data: Any) -> None:
    """Begin a run: no foot is said to stand yet."""
    for name in ("standing", "touching", "wall", "flags", "held"):
        data[name] = 0
