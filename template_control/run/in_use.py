"""What a run has for itself as long as it lasts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

from template_control.errors import ParameterError

_LOCK = Lock()
_TAKEN: set[int] = set()


@contextmanager
def in_use(*parts: Any) -> Iterator[None]:
    """Keep a run's parts from other runs: each keeps the state of one run at a time.

    Args:
        parts: robot, route and planners.

    Raises:
        ParameterError: if another run, maybe of another thread, uses one of them.
    """
    keys = {id(part) for part in parts}
    with _LOCK:
        for part in parts:
            if id(part) in _TAKEN:
                raise ParameterError(
                    f"this {type(part).__name__} is in use by another run: give each run that"
                    " goes on at the same time its own"
                )
        _TAKEN.update(keys)
    try:
        yield
    finally:
        with _LOCK:
            _TAKEN.difference_update(keys)
