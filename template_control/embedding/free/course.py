"""Where a robot is to go, and where its trunk is to face.

The heading frame follows the course: the template walks and runs along its x. A quadruped's pairs
stand below the middle of its trunk, whichever way that faces: so it goes to the left, and
backward, by facing away from its course, and the planes of the template know nothing of it. A
planar robot goes backward likewise, facing half a turn away.
"""

from __future__ import annotations

from math import isnan, nan, remainder, tau
from typing import NamedTuple

from template_control.robot.biped import Biped

TURNED_ROUND = 1.0
"""Angle between the course and a new one from which on the robot stops in between [rad]."""


class Course(NamedTuple):
    """Where a robot is to go; its speed is the route's.

    Attributes:
        left: speed to the left of the course, by footholds further to the left [m/s].
        turning: rate at which the trunk turns, to the left [rad/s].
        facing: angle from the course to where the trunk faces, to the left [rad]; NaN: as it is.
    """

    left: float = 0.0
    turning: float = 0.0
    facing: float = nan

    def away(self, robot: Biped) -> float:
        """Angle that the trunk of a robot is to turn from its course, to face so [rad]."""
        away = self.facing - robot.facing
        return 0.0 if isnan(away) else remainder(away, tau)

    def turns_round(self, robot: Biped) -> bool:
        """Whether a robot that goes has to stop first."""
        return abs(self.away(robot)) > TURNED_ROUND
