"""Ticks in which the whole-body QP has no solution: a run of many is said at once."""

from __future__ import annotations

import logging

LOG = logging.getLogger(__name__)

_BLOCK = 200  # ticks
_MANY = 0.5  # share of a block: in a stumble the QP fails for a few ticks


class QpFailures:
    """Counts the ticks without a solved QP; warns once, with the robot's name, if they are many."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._ticks = self._failed = 0
        self._told = False

    def tick(self, solved: bool, now: float) -> None:
        """Count one tick at the time ``now`` [s]."""
        if self._ticks == _BLOCK:
            self._ticks = self._failed = 0
        self._ticks += 1
        self._failed += not solved
        if self._failed > _MANY * _BLOCK and not self._told:
            self._told = True
            LOG.warning(
                "%s at %.3f s: the QP had no solution in %d of the last %d ticks, which keep the"
                " torques of the last one that had; what follows is no controlled motion",
                self._name,
                now,
                self._failed,
                self._ticks,
            )
