"""What fits an annotation, and what was given instead, in words for a message."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Annotated, Any, Literal, get_args, get_origin

from template_control.checks.ranges import Range

_LONGEST = 60  # characters of a value that a message shows


def shown(value: Any) -> str:
    """A value for a message, on one line and not long."""
    try:
        text = f"{value:g}" if isinstance(value, float) else repr(value)
    except Exception:  # a stranger's __repr__ may do anything
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def inward(low: float, high: float, digits: int = 3) -> str:
    """A range for a message, rounded so that both ends that are printed lie in it.

    Args:
        low, high: ends of the range.
        digits: of the larger one.
    """
    size = max(abs(low), abs(high))
    step = 10.0 ** (math.floor(math.log10(size)) + 1 - digits) if size > 0.0 else 1.0
    first, last = math.ceil(low / step - 1e-9) * step, math.floor(high / step + 1e-9) * step
    if first > last:
        return f"{low!r} to {high!r}"
    return f"{first:.{digits + 2}g} to {last:.{digits + 2}g}"


def words_for(hint: Any) -> str:
    """What fits an annotation, for a message."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Literal:
        return "one of " + ", ".join(repr(x) for x in args)
    if origin is Annotated:
        return next(
            (
                extra.words("whole number" if args[0] is int else "number")
                for extra in args[1:]
                if isinstance(extra, Range)
            ),
            words_for(args[0]),
        )
    if origin is tuple:
        if len(args) == 2 and args[1] is Ellipsis:
            return "a tuple"
        each = list(dict.fromkeys(words_for(x) for x in args))
        if len(each) == 1:
            return f"{len(args)} times {each[0]}"
        return ", ".join(each)
    if origin in (list, Sequence):
        return "a list"
    if origin in (Mapping, dict):
        return "a mapping"
    if hint is float:
        return Range().words("number")
    if hint is int:
        return "a whole number"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return f"a {hint.__name__}: " + ", ".join(str(member) for member in hint)
    name = getattr(hint, "__name__", str(hint))
    return f"{'an' if name[:1] in 'AEIOU' else 'a'} {name}"
