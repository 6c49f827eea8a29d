"""The planners of standing, and of the strides from it and to it, by their kind."""

from __future__ import annotations

from functools import partial

from template_control.checks.checked import checked
from template_control.embedding.planners.planner import Planner
from template_control.embedding.standing.options import StandingOptions
from template_control.embedding.standing.planners import (
    ChangePlanner,
    StandPlanner,
    StartPlanner,
    StopPlanner,
)
from template_control.embedding.standing.vaults import Family, Vaults
from template_control.slip.gaits.walking_family import speed_range, walking_gait
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, scaled


@checked
def standing_planners(
    parameters: SlipParameters,
    options: StandingOptions | None = None,
    family: Family | None = None,
) -> dict[str, Planner]:
    """A planner for standing, starting to walk, stopping and changing a walk's speed.

    Args:
        parameters: the template.
        options: tuning, for the reference template.
        family: the gaits that a walk may have; None: the library's own.
    """
    gaits = family or Family(partial(walking_gait, parameters), speed_range(parameters))
    vaults = Vaults(parameters, scaled(options or StandingOptions(), Scale.of(parameters)), gaits)
    return {
        "s": StandPlanner(vaults),
        "sw": StartPlanner(vaults),
        "ws": StopPlanner(vaults),
        "ww": ChangePlanner(vaults),
    }
