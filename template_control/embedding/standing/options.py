"""Tuning and pose of a robot that stands, starts to walk or stops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

import numpy as np

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Angle, Count, Interval, NotNegative, Positive, Share
from template_control.errors import ParameterError
from template_control.robot.start import Pose
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import LENGTH, SPEED, TIME, Scale, scaled, tuned


@dataclass(frozen=True)
class StandingOptions(Checked):
    """How a robot stands, and which curves of the CoM it may follow between its feet.

    Attributes:
        height: of the CoM over the ground [m].
        spacing: of the feet where a run begins [m].
        place: of the CoM between the feet, as a share of their spacing from the rear one.
        beat: a stand is planned anew, and the route asked, after this time [s]; a step from a stand
            ends this long after its curve, when the robot has come to rest too.
        shifts: places, as shares of the spacing, from which a start may set off.
        durations: shortest and longest quintic [s].
        trials: number of durations tried between them, and of rest places.
        slack: the centre of pressure may be this far outside the feet [m]; the QP keeps it
            inside, and the CoM a little off its curve.
        margin: a rest place is this far from either foot [m].
        reach: longest way from a foot on the ground to the CoM, over l0.
        calm: duration of a quintic that is liked best [s].
        pace: a second more or less counts as this much excess [m/s].
        single: shortest and longest way of the CoM in single stance before VLO [s].
        landing: bounds of the shortest time from VLO to a touchdown [s].
        swiftness: between them that time lets the foot come to its foothold with this mean speed,
            over the CoM's at VLO.
        vault: stiffness of the leg that slowly passes under the CoM, k l0 / (m g).
        slowest: speed at VLO of the slowest step, over sqrt(g l0).
        steps: shortest and longest step [m].
        loads: shares of the load that the front foot may take up at once where it has landed.
        fall: largest downward acceleration that a curve begins with, over g.
        closing: the feet should stand this far apart after a step from a stand, and where a walk
            ends [m].
        narrow: a metre further apart counts as this much excess.
        step: such a step takes about this long [s].
        passes: number of speeds at VLO tried for it, and the fastest, over sqrt(g l0).
        late: its foot lifts off this long after VLO at the latest [s].
        nimble: largest mean speed of its foot in the air [m/s].
        spare: distance of the capture point from either foot where that foot lands, if it can be
            had [m].
        launch: excess with which it is still made [m]; without it the robot would fall.
        angles: touchdown angles tried, and the flattest [rad].
        stiffness: least and greatest of the leg before touchdown, over k0.
        yielding: its stiffnesses tried, over that with which it keeps its length. The CoM sinks
            over a softer leg, and the foot lands further ahead of it.

    Raises:
        ParameterError: if the shortest quintic, or the shortest single stance, lasts no time.
    """

    height: Positive = tuned(STAND_HEIGHT, LENGTH)
    spacing: Positive = tuned(0.3, LENGTH)
    place: Share = tuned(0.5)
    beat: Positive = tuned(0.5, TIME)
    shifts: tuple[Share, ...] = tuned((0.05, 0.15, 0.25, 0.35, 0.45))
    durations: Interval = tuned((0.1, 1.2), TIME)
    calm: Positive = tuned(0.3, TIME)
    trials: tuple[Count, Count] = tuned((14, 9))
    slack: NotNegative = tuned(0.005, LENGTH)
    margin: NotNegative = tuned(0.01, LENGTH)
    reach: Positive = tuned(1.025)
    pace: NotNegative = tuned(0.002, SPEED)
    single: Interval = tuned((0.15, 0.5), TIME)
    landing: Interval = tuned((0.16, 0.35), TIME)
    swiftness: Positive = tuned(3.2)
    vault: Positive = tuned(64.0)
    slowest: Positive = tuned(0.05)
    steps: Interval = tuned((0.15, 0.65), LENGTH)
    loads: tuple[Share, ...] = tuned((0.33, 0.67, 1.0))
    fall: Share = tuned(0.5)
    closing: Positive = tuned(0.25, LENGTH)
    narrow: NotNegative = tuned(0.02)
    step: Positive = tuned(1.5, TIME)
    passes: tuple[Count, Positive] = tuned((10, 0.16))
    late: NotNegative = tuned(0.15, TIME)
    nimble: Positive = tuned(1.8, SPEED)
    spare: NotNegative = tuned(0.06, LENGTH)
    launch: NotNegative = tuned(0.05, LENGTH)
    angles: tuple[Count, Angle] = tuned((12, 1.08))
    stiffness: Interval = tuned((0.5, 4.0))
    yielding: tuple[Positive, ...] = tuned((1.0, 0.85, 0.7))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("durations", "single"):
            if getattr(self, name)[0] <= 0.0:
                raise ParameterError(
                    f"StandingOptions.{name} begins with {getattr(self, name)[0]:g} s: give a time"
                    " over 0"
                )


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
