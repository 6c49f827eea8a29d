"""A walk that is too slow is carried on by both feet, and walks from the liftoff on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import Ahead, Decision, LandingPlanner, decided
from template_control.embedding.standing.planners import ChangePlanner
from template_control.embedding.standing.vaults import Vaults

Array = NDArray[np.float64]


class CarryingPlanner(ChangePlanner):
    """Leads to a liftoff from which the walk passes VLO; on one leg the walk's planner chooses.

    Args:
        vaults: passes over a leg.
        walk: the walk's planner.
    """

    def __init__(self, vaults: Vaults, walk: LandingPlanner) -> None:
        super().__init__(vaults)
        self._walk = walk
        self.gait = walk.gait

    def land(
        self, ahead: Ahead, decision: Decision, target: Array, free: Sequence[int]
    ) -> Decision:
        """See :meth:`~.planner.LandingPlanner.land`."""
        return decided(self._walk.land, ahead, decision, target, free)
