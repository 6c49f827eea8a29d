"""How steep the ground is, from the last footholds."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import combinations
from math import atan, tan
from statistics import median
from typing import Annotated

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Range
from template_control.slip.similarity import tuned


@dataclass(frozen=True)
class SlopeOptions(Checked):
    """Tuning of the slope's estimate.

    Attributes:
        footholds: that it looks back to. More of them make it slower on a slope that begins, and
            surer where each foothold is a little off.
        change: of the estimate up to which the one before is kept [rad]. Nothing is learnt from
            a step in which it changes. With 0.5 mrad of noise level ground looks 0.001 steep; what
            a slope this gentle does, a planner's offset learns.
        steepest: slope that is believed [rad].
        shortest: distance of two footholds that tell a slope, over l0.
    """

    footholds: Annotated[int, Range(2)] = tuned(3)
    change: NotNegative = tuned(0.004)
    steepest: Annotated[float, Range(0.0, 0.3)] = tuned(0.12)
    shortest: NotNegative = tuned(0.1)


class SlopeEstimate:
    """The median of the slopes between any two of the last footholds (Theil and Sen).

    A single foothold that is off moves it little. Before a run the ground is taken to be level.

    Args:
        options: tuning.
        length: l0 of the template [m].

    Attributes:
        slope: the estimate, uphill positive [rad].
        last: from the last foothold but one to the last [rad].
    """

    def __init__(self, options: SlopeOptions, length: float) -> None:
        self.options = options
        self._length = length
        self._places: deque[tuple[float, float]] = deque(maxlen=options.footholds)
        self.slope = self.last = 0.0

    def begin(self, place: tuple[float, float]) -> None:
        """Forget an earlier run.

        Args:
            place: x and height of the foot that stands [m].
        """
        x, height = place
        before = range(self.options.footholds - 1, -1, -1)
        self._places.extend((x - 0.5 * i * self._length, height) for i in before)
        self.slope = self.last = 0.0

    def stand(self, rear: tuple[float, float], front: tuple[float, float]) -> None:
        """Both feet stand where a run begins: as if the ground before had been such.

        Args:
            rear, front: x and height of the feet in the world [m].
        """
        (x, height), (ahead, above) = rear, front
        slope = atan((above - height) / (ahead - x))
        if abs(slope) <= self.options.change:
            return
        steepest = self.options.steepest
        self.slope = self.last = min(max(slope, -steepest), steepest)
        rise, last = tan(self.slope), self._places[-1]
        before = range(len(self._places) - 1, -1, -1)
        away = 0.5 * self._length
        self._places.extend([(last[0] - i * away, last[1] - i * away * rise) for i in before])

    def land(self, place: tuple[float, float], other: tuple[float, float]) -> None:
        """A foot has landed.

        Args:
            place: its x and height in the world [m].
            other: those of the other foot, which may have slid off an edge since it landed.
        """
        o = self.options
        (x, height), (before, below) = place, other
        if abs(x - before) > o.shortest * self._length:
            last = atan((height - below) / (x - before))
            self.last = min(max(last, -o.steepest), o.steepest)
        self._places[-1] = other
        self._places.append(place)
        slopes = [
            (far[1] - near[1]) / (far[0] - near[0])
            for near, far in combinations(self._places, 2)
            if abs(far[0] - near[0]) > o.shortest * self._length
        ]
        found = atan(median(slopes)) if slopes else self.slope
        found = min(max(found, -o.steepest), o.steepest)
        if abs(found - self.slope) > o.change:
            self.slope = found
