"""Model, limits and costs of walking steps that are planned."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.slip.dynamics.model import Kernel, stride_kernel
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.gait_table import (
    COLUMNS,
    CONTROL_TOLERANCE,
    STATE_TOLERANCE,
    STRIDE,
    GaitTable,
    gait_table,
)
from template_control.slip.similarity import Scale

DEGREE, TOLERANCE = 10, 1e-6
"""Of the series of a plan's steps: off by 3e-5 m/s and 3e-6 m at most, in half the time."""
DEFECT = np.array([0.004, 0.0008, 0.008])
"""Differences between a step's end and the next one's start that cost 1, for the reference."""
TOO_SHORT = 0.004
"""Time by which a swing is too short and costs 1 [s], for the reference."""
RISE = (0.13, 0.01)
"""|dy/dt| at VLO that costs nothing, and what is beyond it and costs 1 [m/s], for the reference
template: from there on the template soon leaves the ground, or the leg sinks."""
_EARLIEST = 0.09  # time from VLO to a touchdown at the least [s], for the reference template
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
    """Limits of a robot's walks, by its legs.

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


class PlanCosts(NamedTuple):
    """Model and costs of every plan."""

    kernel: Kernel  # the step
    table: GaitTable  # of the gaits that plans lead to
    defect: Array  # (3,) differences between a step's end and the next one's start that cost 1
    tolerance: Array  # (3,) differences of the states that cost 1
    control_tolerance: Array  # (4,) differences of alpha [rad] and of the shares that cost 1
    rise: tuple[float, float]  # |dy/dt| that costs nothing, and what is beyond and costs 1 [m/s]
    knee_reach: float  # length of the leg at which the knee is straight [m]
    knee_moment: float  # of the leg force about the knee that costs nothing [N m]
    earliest: float  # time from VLO to the touchdown at the least [s]
    swing: float  # the same from the foot's liftoff [s]
    short: float  # time that one of them is too short and costs 1 [s]
    unit: Array  # (3,) of states, those of the reference template being 1
    columns: IntArray  # (7,) of the map's derivatives, states and controls


def plan_costs(parameters: SlipParameters, limits: WalkLimits, ease: float = 1.0) -> PlanCosts:
    """Model and costs of the plans on a template.

    ``ease`` are the tolerances of the controls, over the usual ones.
    """
    scale = Scale.of(parameters)
    beyond, tolerance = RISE
    return PlanCosts(
        kernel=stride_kernel(parameters, STRIDE)._replace(degree=DEGREE, tolerance=TOLERANCE),
        table=gait_table(parameters),
        defect=DEFECT * scale.state,
        tolerance=STATE_TOLERANCE * scale.state,
        control_tolerance=ease * CONTROL_TOLERANCE,
        rise=(beyond * scale.speed, tolerance * scale.speed),
        knee_reach=KNEE_STRAIGHT * scale.length,
        knee_moment=limits.knee_moment,
        earliest=_EARLIEST * scale.time,
        swing=limits.swing,
        short=TOO_SHORT * scale.time,
        unit=scale.state,
        columns=COLUMNS,
    )
