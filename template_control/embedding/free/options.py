"""Tuning of the embedding of floating-base robots, and their tables of phases.

On two points nothing holds the trunk about the line between the feet but the momentum of the legs.

On flat feet a sole bears a moment. So in single stance of a walk the CoM's momentum is followed
too, forward and to the left, and the trunk is kept upright; the centre of pressure moves by
millimetres for it. A run is that of point feet.

The two legs of a quadruped's template are pairs of legs, and a pair's foot is the mean of its two.
Two feet that stand hold the trunk about every axis but the line between them, and that line's
moment comes from how the template's force is shared: the trunk is simply kept level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.embedding.lean import LeanOptions
from template_control.embedding.options import EmbeddingOptions, Planning
from template_control.embedding.phases import (
    RUNNING_SWING,
    PhaseControl,
    Phases,
    running_phases,
    standing_phases,
)
from template_control.embedding.planners.ahead import BIPED_AHEAD, FREE_AHEAD
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.swing import SwingOptions
from template_control.estimation.filters import NoiseFilterOptions
from template_control.robot.biped import Biped
from template_control.robot.terms import LEGS, UP
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.lateral.gait import LateralOptions
from template_control.slip.planning.pressure import UNLOADING
from template_control.slip.similarity import LENGTH, TIME, tuned
from template_control.whole_body.task import Task
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    OrientationTask,
    SideFootTask,
    SoleTask,
    SpareJointTask,
    SpinTask,
    SwayTask,
)


def _walking_phases(single: PhaseControl, double: PhaseControl) -> dict[Phase | str, PhaseControl]:
    """Entries of walks; a planner with push-off leaves the trim nothing to do."""
    return {
        Phase.SS: single,
        Phase.DS: replace(double, trim_momentum=True),
        "DS_sc^wp": double,
        "DS_sd^wp": double,
    }


# Two point feet bear no torque about the line between them: with the height and the trunk held
# there is one freedom left for x and y, and with the weights of the plane the robot loses speed in
# every double stance.
_POINT_DOUBLE = PhaseControl(
    tasks=(ComTask((30.0, 30.0)), OrientationTask((4.0, 4.0, 0.4)), SpareJointTask()),
    unload_legs=(Leg.REAR,),
)

_FEET = tuple(task(leg) for leg in Leg for task in (FootTask, SideFootTask))

_POINT_RUNNING = PhaseControl(
    # As in the plane, about all three axes.
    tasks=(ComTask((0.01, 10.0)), SpinTask(), *_FEET, SpareJointTask()),
    swings=(Leg.FRONT,),
    swing=RUNNING_SWING,
    settles=True,
)

# The foot of a hop is hardly ahead of the CoM or behind it, and what turns about the vertical costs
# ten times as much about y: back on one foot, forth on the other. With a weight of 400 the trunk
# does not turn with its heading, and with 2000 the foot slides as it lands.
_HOPPING_SPIN = SpinTask(weight=(130.0, 130.0, 1000.0))
_POINT_HOPPING = replace(
    _POINT_RUNNING, tasks=(ComTask((0.01, 10.0)), _HOPPING_SPIN, *_FEET, SpareJointTask())
)

_POINT_SINGLE = PhaseControl(
    # As in the plane; and the CoM's y is left to the place of the feet.
    tasks=(ComTask((0.01, 10.0)), OrientationTask(), FootTask(), SideFootTask(), SpareJointTask()),
    swings=(Leg.FRONT,),
)

FREE_PHASES: Phases = {
    **running_phases(
        (OrientationTask((0.01, 0.01, 0.001)), *_FEET, SpareJointTask()),
        _POINT_RUNNING,
        _POINT_DOUBLE,
        _POINT_HOPPING,
    ),
    **_walking_phases(_POINT_SINGLE, _POINT_DOUBLE),
}
"""Walking and running on two points. Nodes of other gaits find the entry of their phase."""


# Stiffer than point feet have it: with 10 % more mass the CoM then sinks by 2 mm until the load is
# learnt, and not by 9 mm, at which the planner leaves its law.
_SOLE_GAINS = (240.0, 31.0)  # kp [1/s^2], kd [1/s]

_SOLE_SINGLE = PhaseControl(
    tasks=(
        # Lighter in x, a sole would be a free lunch: the momentum is drained to move the swing leg.
        ComTask((1.0, 10.0), _SOLE_GAINS, on_point=True, falling=1.0),
        SwayTask(1.0),
        OrientationTask((1.0, 1.0, 0.1)),
        # Lighter than the rest: a fast swing asks for more than the hips have, and the trunk would
        # nod with it. But it rises: dragged along the ground it bears the robot.
        FootTask(weight=(0.1, 1.0)),
        SideFootTask(weight=0.1),
        SoleTask(),
        SpareJointTask(),
    ),
    swings=(Leg.FRONT,),
)
# Heavy legs fold as little as they may: as those on point feet, they turn the trunk by 0.5 rad.
_SOLE_SWING = replace(RUNNING_SWING, clearance=0.08, landing_speed=0.4)
_SOLE_RUNNING = PhaseControl(
    # As point feet have it. To keep the trunk upright against the legs takes the hips' limits in
    # half of the stance, and the angular momentum that is left costs a fifth of the speed.
    tasks=(
        ComTask((0.01, 10.0), _SOLE_GAINS),
        # As fast as on point feet, a change of the speed turns the trunk until it falls.
        SpinTask(bandwidth=35.0),
        FootTask(),
        SideFootTask(),
        SoleTask(),
        SpareJointTask(),
    ),
    swings=(Leg.FRONT,),
    swing=_SOLE_SWING,
)
_SOLE_DOUBLE = PhaseControl(
    tasks=(
        ComTask((10.0, 10.0), _SOLE_GAINS, on_point=True),
        SwayTask(10.0),
        OrientationTask((4.0, 4.0, 0.4)),
        SpareJointTask(),
    ),
    unload_legs=(Leg.REAR,),
)

SOLE_PHASES: Phases = {
    **running_phases(
        (
            OrientationTask((0.2, 0.2, 0.02)),
            *(task(leg) for leg in Leg for task in (FootTask, SideFootTask, SoleTask)),
            SpareJointTask(),
        ),
        _SOLE_RUNNING,
        _SOLE_DOUBLE,
    ),
    **_walking_phases(_SOLE_SINGLE, _SOLE_DOUBLE),
    **standing_phases(_SOLE_DOUBLE, _SOLE_SINGLE, UNLOADING),
}
"""Standing, walking, and runs on flat feet. Nodes of other gaits find the entry of their phase."""


_LEVEL = OrientationTask((10.0, 10.0, 10.0), yaw_gains=(100.0, 20.0))


_BOTH_PAIRS: tuple[Task, ...] = tuple(
    task(leg, contact=contact)
    for leg in Leg
    for contact in range(2)
    for task in (FootTask, SideFootTask)
)
# Of a pair that has landed, the foot that has not touched yet comes down.
_PAIR_STANCE = PhaseControl((ComTask((0.01, 10.0)), _LEVEL, *_BOTH_PAIRS), swings=(Leg.FRONT,))
# The ground's force has no moment about the line between two feet, which is oblique: feedback that
# moves x alone moves y too. A walk without push-off has no other means to keep its speed.
_PAIR_SWAYING = replace(_PAIR_STANCE, tasks=(*_PAIR_STANCE.tasks, SwayTask()))
_PAIR_RUNNING = replace(_PAIR_SWAYING, swing=RUNNING_SWING, settles=True)
_PAIR_DOUBLE = PhaseControl(
    (ComTask((1.0, 3.0)), SwayTask(), _LEVEL, *_BOTH_PAIRS), unload_legs=(Leg.REAR,)
)
# Four feet stand, and hold the CoM's y too.
_PAIR_STANDING = PhaseControl((ComTask((10.0, 10.0)), SwayTask(10.0), _LEVEL, *_BOTH_PAIRS))

TROT_PHASES: Phases = {
    **running_phases(
        (OrientationTask((0.01, 0.01, 0.001)), *_BOTH_PAIRS),
        _PAIR_RUNNING,
        _PAIR_DOUBLE,
    ),
    **_walking_phases(_PAIR_STANCE, _PAIR_DOUBLE),
    "SS_av^wp": _PAIR_SWAYING,
    "SS_bv^wp": _PAIR_SWAYING,
    **standing_phases(_PAIR_STANDING, _PAIR_STANCE, UNLOADING),
}
"""Standing, walking and running trot. Nodes of other gaits find the entry of their phase."""


FREE_PLANNER = LqrOptions(earliest_touchdown=0.1, earliest_share=1.0, trusted_price=0.3)
"""Tuning of a floating-base robot's LQR planner.

Its swing leg has to move sideways too, and needs time. Its first steps from a start are further
from the gait than a planar robot's, and the law of a slow gait is good in its neighbourhood only:
at 0.4 m/s it led Bolt from an error of 2 mm to one of 0.1 m/s. So the search begins earlier.
"""

# A heavy leg needs longer to get in front. After a step up a foot was to land 0.08 s after VLO
# (l0 = 0.67 m); it landed next to the other one, and G1 fell.
_SOLE_PLANNER = replace(FREE_PLANNER, earliest_touchdown=0.15, earliest_share=0.2)


@dataclass(frozen=True)
class FreeOptions(EmbeddingOptions):
    """Tuning of the embedding of a free robot.

    The fields of :class:`~template_control.embedding.options.EmbeddingOptions` come first.

    Attributes:
        phases: the table of two points.
        swing: shape of the swings. A foot has to move sideways too, and is not asked to be high.
        catches: a free robot has no run to break into.
        lateral: how the feet are placed sideways.
        noise_filter: of a state that is measured with noise; None: it is taken as it is measured.
        step_width: lateral distance between left and right footholds [m]. Wider, and the robot
            sways more than its slow steps bear; narrower, and a push leaves less room.
        stop_share: joints slow down before their stops at any speed: hips that swing sideways come
            to theirs slowly, with the robot's weight behind them.
        stop_horizon: a joint's speed is at most the way to its stop over this time [s].
    """

    kind: ClassVar[str] = "free"
    planning: ClassVar[Planning] = Planning(FREE_PLANNER, BIPED_AHEAD)

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(FREE_PHASES))
    swing: SwingOptions | None = field(default_factory=SwingOptions)
    catches: bool = tuned(False)
    lateral: LateralOptions = field(default_factory=LateralOptions)
    noise_filter: NoiseFilterOptions | None = field(default_factory=NoiseFilterOptions)
    step_width: NotNegative = tuned(0.22, LENGTH)
    stop_share: Share = tuned(0.0)
    stop_horizon: Positive = tuned(0.05, TIME)


@dataclass(frozen=True)
class SoleOptions(FreeOptions):
    """Tuning of a robot on flat feet; the fields of :class:`FreeOptions` come first.

    Attributes:
        phases: the table of soles.
        swing: shape of the swings; None: by the hips' speed, and the reference waits for the foot.
        replan: where hips are at their limits, the leg that they swing changes the CoM's speed by
            0.05 m/s within a step, and back; planned anew from there, TALOS walked 2.8 % too fast.
        lean: none: the trunk stays upright.
        lateral: heavy legs run with their feet at half of the walk's distance, just side by side;
            at all of it they turn the trunk by 0.36 rad to either side, and by 0.7 as they begin.
    """

    kind: ClassVar[str] = "soles"
    # Ahead it held all 18 of G1's disturbed walks in which the LQR's search fell.
    planning: ClassVar[Planning] = Planning(_SOLE_PLANNER, BIPED_AHEAD, True, bears=True)

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(SOLE_PHASES))
    swing: SwingOptions | None = None
    replan: ReplanOptions = field(default_factory=lambda: ReplanOptions(speed=0.07))
    lean: LeanOptions = field(default_factory=lambda: LeanOptions({}))
    lateral: LateralOptions = field(default_factory=lambda: LateralOptions(running_width=0.5))


@dataclass(frozen=True)
class TrotOptions(FreeOptions):
    """Tuning of a quadruped; the fields of :class:`FreeOptions` come first.

    Attributes:
        phases: the table of pairs of legs.
        lean: none: the trunk stays level.
        lateral: pairs of legs may cross, as a push may want them to.
        step_width: lateral distance between the footholds of both pairs [m]: none, as the middle of
            either pair is below the trunk's.
    """

    kind: ClassVar[str] = "trot"
    planning: ClassVar[Planning] = Planning(FREE_PLANNER, FREE_AHEAD, bears=True)

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(TROT_PHASES))
    lean: LeanOptions = field(default_factory=lambda: LeanOptions({}))
    lateral: LateralOptions = field(default_factory=lambda: LateralOptions(widths=(-0.6, 0.6)))
    step_width: NotNegative = tuned(0.0, LENGTH)


SOLE_STAND = 0.24
"""Lateral distance of two soles that stand, over l0. With that of a walk's steps G1's soles
enclosed 8 mm less than 15 N s to a side take without a step."""

AnyOptions = EmbeddingOptions | FreeOptions | TrotOptions | SoleOptions
"""Options of a kind of robot."""


def options_of_kind(*, free: bool, flat: bool, trots: bool) -> AnyOptions:
    """Options of a kind of robot: with a floating base, on flat feet, with four legs."""
    if trots:
        return TrotOptions()
    if free and flat:
        return SoleOptions()
    return FreeOptions() if free else EmbeddingOptions()


def default_options(robot: Biped) -> AnyOptions:
    """Options of a robot's kind."""
    free, trots = robot.directions > UP, len(robot.feet) > LEGS
    return options_of_kind(free=free, flat=bool(robot.patches), trots=trots)
