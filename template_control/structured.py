"""Memory that compiled code and Python share: structured arrays of one element, kept tuples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.experimental import structref
from numba.extending import intrinsic

from template_control.compiled import compiled


def structure(**fields: Any) -> np.dtype[np.void]:
    """Type of a structured array: of each field its type, or type and shape."""
    return np.dtype(list(fields.items()), align=True)


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


@structref.register
class _KeptType(types.StructRef):
    """Numba's type of :class:`Kept`."""


class Kept(structref.StructRefProxy):
    """A tuple of arrays that compiled functions are given as one argument, its ``value``.

    A call takes in each array of a tuple anew, in 70 ns; one ``Kept`` in the time of six. Compiled
    code does not count the references to its arrays, which takes longer than most of what it
    does with them: ``owners`` keeps them.
    """

    owners: tuple[Any, ...]


structref.define_boxing(_KeptType, Kept)
structref.define_constructor(Kept, _KeptType, ["value"])
structref.define_attributes(_KeptType)


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """A value of the Numba type ``kind`` whose arrays, also in tuples, have no owner."""
    if isinstance(kind, types.Array):
        place = context.data_model_manager[kind].get_field_position("meminfo")
        none = builder.extract_value(value, place).type(None)
        return builder.insert_value(value, none, place)
    for i, part in enumerate(kind.types if isinstance(kind, types.BaseTuple) else ()):
        bare = _without_owner(context, builder, part, builder.extract_value(value, i))
        value = builder.insert_value(value, bare, i)
    return value


@intrinsic
def _borrowed(_: Any, value: Any) -> tuple[Any, Any]:
    """The same tuple, to whose arrays no references are counted."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_owner(context, builder, signature.args[0], arguments[0])

    return value(value), build


@compiled
def _keep(value: tuple[Any, ...]) -> Any:
    """A :class:`Kept` without its owners."""
    return Kept(_borrowed(value))


def keep(value: tuple[Any, ...]) -> Kept:
    """:class:`Kept` of a tuple, which may hold tuples and None too."""
    kept: Kept = _keep(value)
    kept.owners = value
    return kept
