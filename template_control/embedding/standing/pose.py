"""The pose in which a robot stands."""

from __future__ import annotations

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
) -> Pose:
    """At rest on both feet, the rear one at x = 0.

    Args:
        parameters: the robot's template.
        spacing: of the feet [m]; None: that of the options.
        options: tuning, for the reference template.
    """
    o = scaled(options or StandingOptions(), Scale.of(parameters))
    apart = o.spacing if spacing is None else spacing
    return Pose(
        com=np.array([o.place * apart, o.height]),
        com_velocity=np.zeros(2),
        feet=np.array([[0.0, 0.0], [apart, 0.0]]),
        feet_velocity=np.zeros((2, 2)),
    )
