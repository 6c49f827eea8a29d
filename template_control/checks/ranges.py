"""Ranges of numbers and shapes of arrays, for the annotations of fields and parameters."""

from __future__ import annotations

import math
from types import EllipsisType
from typing import Annotated, NamedTuple

from template_control.arrays import Array


class Range(NamedTuple):
    """Range of numbers, without its ends if ``above``, ``below``; ``endless`` has an inf end.

    It has no ends, or a lower one, or both; ``above`` alone is 0.
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    below: bool = False
    endless: bool = False

    def holds(self, value: float) -> bool:
        """True if a number is in the range."""
        if isinstance(value, float) and not math.isfinite(value):
            return self.endless and value in (self.low, self.high)
        over = value > self.low if self.above else value >= self.low
        return over and (value < self.high if self.below else value <= self.high)

    def words(self, what: str) -> str:
        """Of numbers in the range, for a message; ``what`` is "number" or "whole number"."""
        if self.low == -math.inf:
            return f"a finite {what}" if what == "number" else f"a {what}"
        if self.high == math.inf:
            return f"a positive {what}" if self.above else f"a {what} from {_plain(self.low)} up"
        if not self.above:
            return f"a {what} from {_plain(self.low)} to {_plain(self.high)}"
        end = "below" if self.below else "up to"
        return f"a {what} above {_plain(self.low)} and {end} {_plain(self.high)}"


def _plain(end: float) -> str:
    """An end of a range; a million in full."""
    return str(round(end)) if end == round(end) and abs(end) < 1e9 else f"{end:g}"


class Shape(NamedTuple):
    """Size of a finite array along its axes; None is any, an Ellipsis first any number of axes."""

    sizes: tuple[int | EllipsisType | None, ...]
    finite: bool = True

    def holds(self, shape: tuple[int, ...]) -> bool:
        """True if an array's shape is this one."""
        sizes = self.sizes
        if shape == sizes:
            return True
        if sizes[:1] == (...,):
            sizes, shape = sizes[1:], shape[max(len(shape) - len(sizes) + 1, 0) :]
        return len(shape) == len(sizes) and all(
            wanted in (None, size) for wanted, size in zip(sizes, shape, strict=True)
        )

    @property
    def words(self) -> str:
        """Of such an array, for a message."""
        names: dict[object, str] = {None: "n", ...: "..."}
        sizes = " by ".join(str(names.get(size, size)) for size in self.sizes)
        return f"an array of {sizes} {'finite ' if self.finite else ''}numbers"


class Rising(NamedTuple):
    """Two numbers, the second greater than the first."""


Positive = Annotated[float, Range(0.0, above=True)]
NotNegative = Annotated[float, Range(0.0)]
Share = Annotated[float, Range(0.0, 1.0)]
Speed = Annotated[float, Range(0.0, 20.0, above=True)]
"""Wanted of a walk or a run [m/s]; twice that of the fastest runner."""
SpeedOrRest = Annotated[float, Range(0.0, 20.0)]  # of a walk, a run or a stand [m/s]
Angle = Annotated[float, Range(0.0, math.pi / 2.0, above=True, below=True)]
Degrees = Annotated[float, Range(0.0, 90.0, above=True, below=True)]
"""Of a leg's angle to the ground, where a user types it."""
Count = Annotated[int, Range(1, 1_000_000)]  # of things that are made or simulated one by one
Index = Annotated[int, Range(0)]
Interval = Annotated[tuple[float, float], Rising()]
Vector = Annotated[Array, Shape((None,))]
Pair = Annotated[Array, Shape((2,))]
Triple = Annotated[Array, Shape((3,))]
