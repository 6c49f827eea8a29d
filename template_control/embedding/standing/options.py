"""Tuning and pose of a robot that stands, starts to walk or stops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

import numpy as np

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.robot.start import Pose
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import LENGTH, Scale, scaled, tuned

SPACING = 0.3
"""Distance of the feet where a run begins, over l0."""
PLACE = 0.5
"""Place of the CoM between the feet, as a share of their spacing from the rear one."""


@dataclass(frozen=True)
class StandingOptions(Checked):
    """Tuning of a stand, and of the curves of the CoM between the feet.

    Attributes:
        height: of the CoM over the ground [m].
        slack: the centre of pressure may be this far outside the feet [m]; the QP keeps it
            inside, and the CoM a little off its curve.
        reach: longest way from a foot on the ground to the CoM, over l0.
    """

    height: Positive = tuned(STAND_HEIGHT, LENGTH)
    slack: NotNegative = tuned(0.005, LENGTH)
    reach: Positive = tuned(1.025)


@checked
def standing_pose(
    parameters: SlipParameters,
    spacing: Positive | None = None,
    options: StandingOptions | None = None,
    ground: Callable[[float], float] | None = None,
) -> Pose:
    """At rest on both feet, the rear one at x = 0.

    Args:
        parameters: the robot's template.
        spacing: of the feet [m]; None: 0.3 l0.
        options: tuning, for the reference template.
        ground: its height [m] at an x [m]; None: level.
    """
    o = scaled(options or StandingOptions(), Scale.of(parameters))
    apart = SPACING * parameters.rest_length if spacing is None else spacing
    rear, front = (0.0, 0.0) if ground is None else (ground(0.0), ground(apart))
    # From the ground at right angles to it, as the axes of a slope have it.
    over = o.height * hypot(1.0, (front - rear) / apart)
    return Pose(
        com=np.array([PLACE * apart, rear + PLACE * (front - rear) + over]),
        com_velocity=np.zeros(2),
        feet=np.array([[0.0, rear], [apart, front]]),
        feet_velocity=np.zeros((2, 2)),
    )
