"""The planners that a route is followed with where nobody chooses others."""

from __future__ import annotations

from functools import partial

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Planners
from template_control.embedding.planners.running import RunningPlanner
from template_control.embedding.planners.transition import (
    RUN_TO_WALK,
    WALK_TO_RUN,
    TransitionPlanner,
)
from template_control.slip.gaits.running_gait import RunningGait, running_gait, running_speeds
from template_control.slip.gaits.walking_family import walking_gait
from template_control.slip.maps.section import APEX
from template_control.slip.scenario.route import Route


def default_planners(route: Route) -> Planners:
    """A planner for every kind of stride that the library can plan on a robot.

    That is walking steps for a route that begins at VLO, and running ones for one at an apex.

    Args:
        route: whose template and first target they are for.

    Raises:
        GaitError: if there is no gait at the speed the route begins with.
    """
    p, speed = route.parameters, float(route.start[0])
    slowest, fastest = running_speeds(p)

    def runs(speed: float) -> RunningGait:
        return running_gait(p, min(max(speed, slowest), fastest))

    if route.section == APEX:
        return {"r": RunningPlanner(runs(speed))}
    walk = LqrPlanner(walking_gait(p, speed))
    run = RunningPlanner(runs(slowest))
    return {
        "w": walk,
        "wr": TransitionPlanner("wr", walk, runs, WALK_TO_RUN),
        "r": run,
        "rw": TransitionPlanner("rw", run, partial(walking_gait, p), RUN_TO_WALK),
    }
