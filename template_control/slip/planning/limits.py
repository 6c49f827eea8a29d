"""Limits of walking steps that are planned: touchdown angles, stiffnesses, knees and swings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale

ANY_ANGLE = (-np.inf, np.inf)
"""Range of angles that leaves the touchdown angle free."""

# Steeper angles make steps too short in time for the swing leg, flatter ones let the CoM sink
# lower than the knees can carry it.
ANGLE_RANGE = (-0.12, 0.065)
"""Least and greatest touchdown angle relative to the gait's [rad]."""
STIFFNESS_RANGE = (0.5, 1.5)
"""Least and greatest stiffness of a leg, over k0."""

# Five-link's numbers: its knees have 350 N m, and its walks need some of them for the other leg.
KNEE_STRAIGHT = 1.095
"""Leg length at which the knee is straight [m], for l0 = 1 m: the leg ends above the hip."""
KNEE_MOMENT = 0.41
"""Moment of the leg force about the knee that costs nothing, over the weight [m], for l0 = 1 m."""
SWING = 0.155
"""Time of five-link's swing at the least [s]."""


def usual_knee_moment(parameters: SlipParameters) -> float:
    """Moment of the leg force about the knee that costs nothing [N m]: five-link's, scaled."""
    p = parameters
    return KNEE_MOMENT * Scale.of(p).length * p.mass * p.gravity


class WalkLimits(NamedTuple):
    """What a robot's legs allow of its walks.

    Attributes:
        knee_moment: of the template's leg force about the knees [N m].
        speeds: least and greatest dx/dt at VLO of the gaits that are aimed at [m/s].
        swing: time from a foot's liftoff to its touchdown at the least [s].
        light: whether its legs are light enough to change the speed within a few steps.
    """

    knee_moment: float
    speeds: tuple[float, float]
    swing: float
    light: bool = True
