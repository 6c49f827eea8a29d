"""The planners that a route is followed with where nobody chooses others."""

from __future__ import annotations

from template_control.checked import checked
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Planners
from template_control.slip.gaits.walking_family import walking_gait
from template_control.slip.scenario.route import Route


@checked
def default_planners(route: Route) -> Planners:
    """A planner for every kind of stride that the library can plan on a robot: walking steps.

    Args:
        route: whose template and first target they are for.

    Raises:
        GaitError: if there is no walking gait at the speed the route begins with.
    """
    return {"w": LqrPlanner(walking_gait(route.parameters, float(route.start[0])))}
