"""How the template's inner loops are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Decorator = Callable[[Callable[..., Any]], Any]


def _without_reference_counts() -> dict[str, bool]:
    """The option that turns Numba's reference counting off, where this Numba has it.

    Functions that allocate nothing do not need it, and it costs a fifth to a third of a
    closed-form step: an atomic count for every array at every call.
    """
    option = {"_nrt": False}
    try:
        njit(**option)(lambda: 0)
    except (KeyError, TypeError):
        return {}
    return option


inner: Decorator = njit(
    cache=True,
    error_model="numpy",
    fastmath={"contract", "arcp", "nsz"},
    **_without_reference_counts(),
)
"""For functions that write to the arrays they are given and allocate none."""
