"""The planners that a route is followed with where nobody chooses others."""

from __future__ import annotations

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Planners
from template_control.embedding.planners.running import RunningPlanner
from template_control.slip.gaits.running_gait import running_gait
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
    speed = float(route.start[0])
    if route.section == APEX:
        return {"r": RunningPlanner(running_gait(route.parameters, speed))}
    return {"w": LqrPlanner(walking_gait(route.parameters, speed))}
