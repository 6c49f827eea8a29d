"""The planners of standing, and of the strides from it and to it, by their kind."""

from __future__ import annotations

from functools import partial

from template_control.checks.checked import checked
from template_control.embedding.planners.planner import LandingPlanner, Planner
from template_control.embedding.standing.carrying import CarryingPlanner
from template_control.embedding.standing.options import StandingOptions
from template_control.embedding.standing.planners import (
    ChangePlanner,
    StandPlanner,
    StartPlanner,
    StopPlanner,
)
from template_control.embedding.standing.stepping import StepPlanner
from template_control.embedding.standing.vaults import Family, Vaults
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.walking_by_speed import speed_range, walking_by_speed, walking_gait
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, scaled


def gaits_by_speed(parameters: SlipParameters) -> Family:
    """The gaits of the family by speed, with push-off; slower walks pass over a stiff leg.

    Args:
        parameters: the template.
    """
    chain = walking_by_speed().chains[-1]
    unit = parameters.speed_unit
    ends = (float(chain.vlo_speed[0]) * unit, float(chain.vlo_speed[-1]) * unit)
    return Family(partial(chain.gait, parameters), ends)


@checked
def carrying_planners(walk: Planner, options: StandingOptions) -> dict[str, Planner]:
    """Planners of what a slow walk breaks into: it is carried on, or stands and starts again.

    Args:
        walk: the walk's planner.
        options: tuning, for the reference template.
    """
    p = walk.gait.parameters
    vaults = Vaults(p, scaled(options, Scale.of(p)), gaits_by_speed(p))
    change = ChangePlanner(vaults)
    if isinstance(walk, LandingPlanner):
        change = CarryingPlanner(vaults, walk)
    return {
        StrideKind.CHANGE_SPEED: change,
        StrideKind.WALK_TO_STAND: StopPlanner(vaults),
        StrideKind.STEP_BACK: StepPlanner(vaults, StrideKind.STEP_BACK),
        StrideKind.STAND_TO_WALK: StartPlanner(vaults),
    }


@checked
def standing_planners(
    parameters: SlipParameters,
    options: StandingOptions | None = None,
    family: Family | None = None,
) -> dict[str, Planner]:
    """A planner for standing, starting to walk, stopping, changing a walk's speed, and a step.

    Args:
        parameters: the template.
        options: tuning, for the reference template.
        family: the gaits that a walk may have, such as :func:`gaits_by_speed`; None: the library's
            own.
    """
    gaits = family or Family(partial(walking_gait, parameters), speed_range(parameters))
    vaults = Vaults(parameters, scaled(options or StandingOptions(), Scale.of(parameters)), gaits)
    forward = StepPlanner(vaults, StrideKind.STEP_FORWARD)
    return {
        StrideKind.STAND: StandPlanner(vaults),
        StrideKind.STAND_TO_WALK: StartPlanner(vaults),
        StrideKind.WALK_TO_STAND: StopPlanner(vaults),
        StrideKind.CHANGE_SPEED: ChangePlanner(vaults),
        StrideKind.STEP_FORWARD: forward,
        StrideKind.STEP_BACK: StepPlanner(vaults, StrideKind.STEP_BACK, forward.passes),
    }
