"""The planners that a route is followed with where nobody chooses others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from template_control.checks.checked import checked
from template_control.embedding.planners.ahead import AheadPlanner
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.planners.running import AGILE, RunningOptions, RunningPlanner
from template_control.embedding.planners.transition import (
    RUN_TO_WALK,
    WALK_TO_RUN,
    TransitionPlanner,
)
from template_control.embedding.standing.curves import StandingOptions
from template_control.embedding.standing.planners import recovery_planners, standing_planners
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.gait import Gait
from template_control.slip.gaits.running_gait import RunningGait, running_gait, running_speeds
from template_control.slip.gaits.walking_by_speed import gaits_by_speed, walking_gait
from template_control.slip.maps.section import APEX, REST
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.slip.scenario.scenario import STAND, STAND_HEIGHT
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.slip.scenario.speed_route import SpeedRoute
from template_control.slip.similarity import REFERENCE, Scale

# A slow stride lasts 1.3 sqrt(l0 / g); a run that is behind its profile must be able to catch up.
_STRIDE = 1.9
_CATCHING = RunningOptions(pace=0.12)  # a run that only catches a walk is to be over soon
# A leg that is left behind may be longer than a walk's, and there is no time to set off from rest.
_RECOVERY = StandingOptions(reach=1.06, slack=0.03)
_GENTLE = 0.05  # of g: up to this acceleration moderate controls keep up


def _keeping_up(route: Route) -> RunningOptions:
    """Options with which a run keeps up with the accelerations of a route."""
    options, runs = RunningOptions(), []
    if isinstance(route, ScenarioRoute):
        runs = [abs(s.acceleration) for s in route.scenario.segments if s.gait == "run"]
    elif isinstance(route, SpeedRoute) and "run" in route.gaits:
        runs = [route.changes.acceleration]
    if not runs:
        return _CATCHING
    fastest = max(runs) / route.parameters.gravity
    if fastest > _GENTLE:
        return AGILE
    # A change of speed over a stride, for the reference template as all options are.
    pace = _STRIDE * fastest * float(np.sqrt(REFERENCE.gravity * REFERENCE.rest_length))
    return replace(options, pace=max(options.pace, pace))


def first_speed(route: Route) -> float:
    """dx/dt that the gait has with which a route begins, after a stand where it has one [m/s]."""
    if isinstance(route, ScenarioRoute):
        return route.scenario.walking_speed
    return route.walking_speed if isinstance(route, SpeedRoute) else float(route.start[0])


def _standing(route: Route, given: StandingOptions) -> Planners:
    """The planners of a scenario that stands, or a route that begins so; others need none.

    ``given`` are the options, but for the height.
    """
    p, family = route.parameters, None
    if isinstance(route, SpeedRoute) and STAND in route.gaits:
        height, family = STAND_HEIGHT / REFERENCE.rest_length * p.rest_length, gaits_by_speed(p)
    elif isinstance(route, ScenarioRoute) and route.scenario.stands:
        height = route.scenario.stand_height
        family = gaits_by_speed(p) if route.pushes_off else None
    elif route.section == REST:
        height = float(route.start[1])
    else:
        return {}
    return standing_planners(p, replace(given, height=height / Scale.of(p).length), family)


@checked
def default_planners(
    route: Route, walking: Planner | None = None, *, standing: StandingOptions | None = None
) -> Planners:
    """A planner for every kind of stride that the library can plan on a robot.

    That is walking steps for a route that begins at VLO, running ones for one at an apex, and
    standing for one that stands, and starts and stops where it is a scenario. A
    route whose walk has any speed is walked with the planner that looks several steps ahead. Each
    walk comes with the strides that it may break into (``EmbeddingOptions.catches``).

    Args:
        route: whose template and first target they are for.
        walking: plans the walking steps instead of the library's own planner.
        standing: the robot's, for the reference template (:func:`.standing_options`); the height
            is the route's. None: of feet that are points.

    Raises:
        GaitError: if there is no gait at the speed the route begins with.
    """
    p, speed = route.parameters, first_speed(route)
    slowest, fastest = running_speeds(p)

    def runs(speed: float) -> RunningGait:
        return running_gait(p, min(max(speed, slowest), fastest))

    if route.section == APEX:
        return {StrideKind.RUN: RunningPlanner(runs(speed))}
    stands = _standing(route, standing or StandingOptions())
    if route.section == REST and not isinstance(route, ScenarioRoute | SpeedRoute):
        return stands
    any_speed = isinstance(route, SpeedRoute) or (
        isinstance(route, ScenarioRoute) and route.pushes_off
    )
    if any_speed:
        walk = walking or AheadPlanner(p, speed=speed)
    else:
        walk = walking or LqrPlanner(walking_gait(p, speed))

    def walks(speed: float) -> Gait:
        # A walk that is kept is walked again after a run, whatever family it is of.
        if isinstance(route, SteadyRoute):
            return walk.gait
        return gaits_by_speed(p).gait(speed) if any_speed else walking_gait(p, speed)

    keeping_up = _keeping_up(route)
    run = RunningPlanner(runs(slowest), keeping_up)
    hops: Planners = {}
    if isinstance(route, SpeedRoute) and route.changes.hop:
        still = running_gait(p, 0.0, stride=StrideKind.HOP)
        hops = {StrideKind.HOP: RunningPlanner(still, keeping_up)}
    return {
        walk.gait.stride: walk,
        StrideKind.WALK_TO_RUN: TransitionPlanner(StrideKind.WALK_TO_RUN, walk, runs, WALK_TO_RUN),
        StrideKind.RUN: run,
        StrideKind.RUN_TO_WALK: TransitionPlanner(StrideKind.RUN_TO_WALK, run, walks, RUN_TO_WALK),
        **hops,
        **recovery_planners(walk, _RECOVERY),
        **stands,
    }
