"""Which speed is wanted when: a profile, or a number that somebody changes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.fitting import check
from template_control.checks.ranges import Speed
from template_control.errors import ScenarioError


@dataclass(frozen=True)
class SpeedProfile(Checked):
    """Speeds at times, and straight lines between them; called with a time, it tells the speed.

    Before the first time and after the last the speed is that time's.

    Attributes:
        times: rising [s].
        speeds: mean forward speed wanted at each [m/s].

    Raises:
        ScenarioError: if there are not as many speeds as times, or the times do not rise.
    """

    _error = ScenarioError

    times: tuple[float, ...]
    speeds: tuple[Speed, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.times or len(self.times) != len(self.speeds):
            raise ScenarioError(
                f"a profile has {len(self.times)} times and {len(self.speeds)} speeds: give one"
                " speed for each time, and at least one"
            )
        for before, after in pairwise(self.times):
            if after <= before:
                raise ScenarioError(
                    f"a profile's time {after:g} s comes after {before:g} s: give rising times"
                )

    def __call__(self, time: float) -> float:
        """The speed wanted at ``time`` [s]."""
        return float(np.interp(time, self.times, self.speeds))


class SpeedCommand:
    """A speed that may be set at any time; called with a time, it tells the present one.

    A route asks at each section. So what is set holds from the next VLO on.

    Args:
        speed: mean forward speed wanted first [m/s].
    """

    def __init__(self, speed: float) -> None:
        self.speed = speed

    @property
    def speed(self) -> float:
        """Mean forward speed that is wanted [m/s].

        Raises:
            ScenarioError: where it is set to no speed of a walk or a run.
        """
        return self._speed

    @speed.setter
    def speed(self, value: float) -> None:
        """Want ``value`` [m/s] from now on."""
        self._speed = float(check("the commanded speed", value, Speed, ScenarioError))

    def __call__(self, time: float) -> float:
        """The present speed, whatever the ``time`` [s]."""
        return self._speed
