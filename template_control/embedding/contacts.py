"""Contact state of the feet: flags of the sensors, checked against walls and the path.

This is the only place where contact flags are judged. Everything in the controller that asks
whether a foot stands reads :attr:`ContactMonitor.standing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.compiled import compiled
from template_control.slip.similarity import TIME, tuned

Array = NDArray[np.float64]

EARLY = 0.015
"""A touchdown is due from this long before its time on the path [s, of the reference template].
Undisturbed feet come up to 10 ms before it."""
SINKING = 0.3
"""A foot that still comes down faster than this is not due: it may graze an edge [m/s, of the
reference template]. A walking swing ends with 0.2 m/s (``SwingOptions.landing_speed``)."""
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
        ("expected", _I, (2,)),  # by foot: IN_AIR, ON_GROUND or DUE
        ("flags", _I, (2,)),  # of the last tick; 0 where a wall is pressed
        ("held", _F, (2,)),  # time that each flag has been as it is [s]
        ("wall", _F, (2,)),  # time that each foot's wall still counts [s]
        ("standing", np.uint8, (2,)),  # whether each foot is on ground to stand on
    ],
    align=True,
)
"""State of the contacts."""

IN_AIR, ON_GROUND, DUE = 0, 1, 2
"""Expectation of the path for a foot; one that is due to land may do either."""

NO_FORCE: Array = np.zeros((0, 0))
"""In place of forces that are not measured."""


@compiled
def update_contacts(c: Any, flags: NDArray[np.bool_], force: Array, dt: float) -> None:
    """Take in the flags of a tick.

    ``c``, of ``CONTACTS``, is overwritten but for ``expected``. ``flags`` (2,) say whether each
    foot touches anything, ``force`` (2, d) is on each foot, forward first and up last [N];
    ``NO_FORCE``: walls are not looked for. ``dt`` is since the last tick [s].
    """
    for foot in range(2):
        flag = 1 if flags[foot] else 0
        if force.shape[0] > 0:
            along, up = force[foot, 0], force[foot, force.shape[1] - 1]
            presses = abs(along) > max(c.least, _STEEPNESS * up)
            c.wall[foot] = c.linger if presses and along < 0.0 else c.wall[foot] - dt
            if presses:
                flag = 0
        c.held[foot] = c.held[foot] + dt if flag == c.flags[foot] else dt
        c.flags[foot] = flag
        expected = c.expected[foot]
        if expected in (DUE, flag) or c.held[foot] >= c.doubt:
            c.standing[foot] = flag


class ContactMonitor:
    """Debounced contact state of both feet, of which ``standing`` (2,) are on ground to stand on.

    A flag that says what the path expects of its foot is believed at once: a foot stands, is in the
    air, or is due to land, where either flag is expected. Any other flag is believed after
    ``ContactOptions.doubt``. A foot pressed against a wall does not stand. ``weight`` is the
    robot's [N]; ``data`` (1,) are of ``CONTACTS``, own memory if not given.
    """

    def __init__(self, options: ContactOptions, weight: float, data: Any = None) -> None:
        self.data = np.zeros(1, CONTACTS) if data is None else data
        now = self.data[0]
        now["least"], now["doubt"], now["linger"] = _FORCE * weight, options.doubt, options.linger
        self.standing: NDArray[np.bool_] = self.data["standing"][0].view(bool)
        self.begin()

    def begin(self) -> None:
        """Forget an earlier run; no foot is said to stand yet."""
        for name in ("standing", "wall", "flags", "held"):
            self.data[name] = 0

    def blocked(self, foot: int) -> bool:
        """True if a wall is in front of a foot."""
        return bool(self.data["wall"][0, foot] > 0.0)

    def update(
        self,
        flags: NDArray[np.bool_],
        force: Array | None,
        expected: Sequence[bool | None],
        dt: float,
    ) -> None:
        """Take in the flags of a tick; see :func:`update_contacts`.

        ``expected`` is whether each foot is to touch the ground now; None: it is due to land.
        """
        self.data["expected"] = [DUE if due is None else int(due) for due in expected]
        update_contacts(self.data[0], flags, NO_FORCE if force is None else force, dt)
