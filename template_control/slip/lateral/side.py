"""Left and right."""

from __future__ import annotations

from enum import IntEnum


class Side(IntEnum):
    """Of the body a foot is on; +1 is where y is positive."""

    LEFT = 1
    RIGHT = -1

    @property
    def other(self) -> Side:
        """The other side."""
        return Side(-self)

    @property
    def row(self) -> int:
        """Place in arrays with a row for each side: left, right."""
        return 0 if self is Side.LEFT else 1
