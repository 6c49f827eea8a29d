"""What the template alone takes of a disturbance, with the planner that the robot has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.robustness.disturbance import Disturbance, Situation
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.maps.return_map import ReturnMap

Array = NDArray[np.float64]


def template_limit(
    disturbance: Disturbance, where: Situation, strides: int, settled: float
) -> float | None:
    """The severest level up to which the template comes back to its gait from its section.

    Args:
        disturbance: one that changes the state at once.
        where: whose gait and planner.
        strides: after which the template must be back.
        settled: relative error of speed and height that counts as back.

    Returns:
        The level [SI]; 0 if it does not come back from the mildest. None where the template has
        no limit of its own, as to friction.
    """
    if disturbance.kick is None:
        return None
    last = 0.0
    for level in disturbance.levels_for(where.gait.parameters):
        kick = disturbance.kick(where, level)[: len(where.gait.state)]
        if not _returns(where, where.gait.state + kick, strides, settled):
            break
        last = level
    return last


def _returns(where: Situation, z: Array, strides: int, settled: float) -> bool:
    gait, planner = where.gait, where.planner
    step = ReturnMap(gait.parameters, gait.stride)
    planner.reset()
    for _ in range(strides):
        z, outcome = step.step(z, planner.decide(z).controls)
        if outcome is not Outcome.SECTION:
            return False
    return bool((abs(z[:2] / gait.state[:2] - 1.0) < settled).all())
