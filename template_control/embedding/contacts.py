"""Contact state of the feet: flags of the sensors, checked against walls and the path.

This is the only place where contact flags are judged. Everything in the controller that asks
whether a foot stands reads :attr:`ContactMonitor.standing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
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


class ContactMonitor:
    """Debounced contact state of both feet.

    A flag that says what the path expects of its foot is believed at once: a foot stands, is in
    the air, or is due to land, where either flag is expected. Any other flag is believed after
    ``ContactOptions.doubt``. A foot pressed against a wall does not stand.

    Args:
        options: tuning.
        weight: of the robot [N].

    Attributes:
        standing: (2,) whether each foot is on ground to stand on.
    """

    def __init__(self, options: ContactOptions, weight: float) -> None:
        self._options = options
        self._least = _FORCE * weight
        self.standing = np.zeros(2, dtype=bool)
        self.begin()

    def begin(self) -> None:
        """Forget an earlier run; no foot is said to stand yet."""
        self.standing[:] = False
        self._wall = [0.0, 0.0]  # so much longer each foot's wall counts [s]
        self._flags = [False, False]
        self._held = [0.0, 0.0]  # for so long each flag has been as it is [s]

    def blocked(self, foot: int) -> bool:
        """Whether a wall is in front of a foot."""
        return self._wall[foot] > 0.0

    def update(
        self,
        flags: NDArray[np.bool_],
        force: Array | None,
        expected: Sequence[bool | None],
        dt: float,
    ) -> None:
        """Take in the flags of a tick.

        Args:
            flags: (2,) whether each foot touches anything, as its sensor says.
            force: (2, d) force on each foot, forward first and up last [N]; None: walls are not
                looked for.
            expected: whether each foot is to touch the ground now; None: it is due to land.
            dt: since the last tick [s].
        """
        # Number by number: arrays of two would take five times as long, at every tick.
        for foot, flag in enumerate(flags.tolist()):
            if force is not None and self._presses(foot, force[foot].tolist(), dt):
                flag = False
            self._held[foot] = self._held[foot] + dt if flag is self._flags[foot] else dt
            self._flags[foot] = flag
            if expected[foot] in (None, flag) or self._held[foot] >= self._options.doubt:
                self.standing[foot] = flag

    def _presses(self, foot: int, force: list[float], dt: float) -> bool:
        """Whether a foot presses against a wall now; one before it counts for a while."""
        along, up = force[0], force[-1]
        wall = abs(along) > max(self._least, _STEEPNESS * up)
        self._wall[foot] = self._options.linger if wall and along < 0.0 else self._wall[foot] - dt
        return wall
