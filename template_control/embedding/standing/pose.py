"""The pose in which a robot stands."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.ranges import Positive
from template_control.embedding.standing.options import StandingOptions
from template_control.robot.start import Pose
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, scaled


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
        spacing: of the feet [m]; None: that of the options.
        options: tuning, for the reference template.
        ground: its height [m] at an x [m]; None: level.
    """
    o = scaled(options or StandingOptions(), Scale.of(parameters))
    apart = o.spacing if spacing is None else spacing
    rear, front = (0.0, 0.0) if ground is None else (ground(0.0), ground(apart))
    # From the ground at right angles to it, as the axes of a slope have it.
    over = o.height * hypot(1.0, (front - rear) / apart)
    return Pose(
        com=np.array([o.place * apart, rear + o.place * (front - rear) + over]),
        com_velocity=np.zeros(2),
        feet=np.array([[0.0, rear], [apart, front]]),
        feet_velocity=np.zeros((2, 2)),
    )
