"""Structured arrays of one element: memory that compiled code and Python share."""

from __future__ import annotations

from typing import Any


class Number:
    """A number of an object's structured array ``data``, as an attribute of the object.

    ``field`` is of the array's one element; ``axis`` is of the field, None where it is one number.
    """

    def __init__(self, field: str, axis: int | None = None) -> None:
        self._place = (0,) if axis is None else (0, axis)
        self._field = field

    def __get__(self, owner: Any, kind: type) -> float:
        return float(owner.data[self._field][self._place])

    def __set__(self, owner: Any, value: float) -> None:
        owner.data[self._field][self._place] = value
