"""Slope of the ground, as the feet feel it."""

from __future__ import annotations

from collections import deque
from itertools import combinations
from math import atan, tan
from statistics import median

# Footholds that the slope's estimate looks back to. More of them make it slower on a slope that
# begins, and surer where each foothold is a little off.
_FOOTHOLDS = 3
LEVEL = 0.004
"""Slope that is as good as none; a smaller change of the estimate is not taken over [rad].

Nothing is learnt from a step in which it changes. With 0.5 mrad of noise level ground looks 0.001
steep; what a slope this gentle does, a planner's offset learns."""
STEEPEST = 0.12
"""Slope that is believed [rad]."""
_SHORTEST = 0.1  # distance of two footholds that show a slope, over l0


class SlopeEstimate:
    """The median of the slopes between any two of the last footholds (Theil and Sen).

    A single foothold that is off moves it little. Before a run the ground is taken to be level.
    ``length`` is the template's l0 [m]; ``slope`` is the estimate, uphill positive, ``last`` the
    slope from the last foothold but one to the last [rad].
    """

    def __init__(self, length: float) -> None:
        self._length = length
        self._places: deque[tuple[float, float]] = deque(maxlen=_FOOTHOLDS)
        self.slope = self.last = 0.0

    def begin(self, place: tuple[float, float], slope: float = 0.0) -> None:
        """Forget what was before a foot stands at a place, x and height in the world [m]."""
        (x, height), away, rise = place, 0.5 * self._length, tan(slope)
        before = range(_FOOTHOLDS - 1, -1, -1)
        self._places.extend((x - i * away, height - i * away * rise) for i in before)
        self.slope = self.last = slope

    def stand(self, rear: tuple[float, float], front: tuple[float, float]) -> None:
        """Both feet stand where a run begins: as if the ground before had been such."""
        (x, height), (ahead, above) = rear, front
        slope = atan((above - height) / (ahead - x))
        if abs(slope) > LEVEL:
            self.begin(self._places[-1], min(max(slope, -STEEPEST), STEEPEST))

    def land(self, place: tuple[float, float], other: tuple[float, float]) -> None:
        """A foot has landed at a place; the other one may have slid off an edge since it landed."""
        (x, height), (before, below) = place, other
        if abs(x - before) > _SHORTEST * self._length:
            last = atan((height - below) / (x - before))
            self.last = min(max(last, -STEEPEST), STEEPEST)
        self._places[-1] = other
        self._places.append(place)
        slopes = [
            (far[1] - near[1]) / (far[0] - near[0])
            for near, far in combinations(self._places, 2)
            if abs(far[0] - near[0]) > _SHORTEST * self._length
        ]
        found = atan(median(slopes)) if slopes else self.slope
        found = min(max(found, -STEEPEST), STEEPEST)
        if abs(found - self.slope) > LEVEL:
            self.slope = found
