"""Phases of floating-base robots: on two points, on two soles, on two pairs of legs.

On two points nothing holds the trunk about the line between the feet but the momentum of the legs.

On flat feet a sole bears a moment. So in single stance of a walk the CoM's momentum is followed
too, forward and to the left, and the trunk is kept upright; the centre of pressure moves by
millimetres for it. A run is that of point feet.

The two legs of a quadruped's template are pairs of legs, and a pair's foot is the mean of its two.
Two feet that stand hold the trunk about every axis but the line between them, and that line's
moment comes from how the template's force is shared: the trunk is simply kept level.
"""

from __future__ import annotations

from dataclasses import replace

from template_control.embedding.phases import (
    RUNNING_SWING,
    PhaseControl,
    Phases,
    running_phases,
    standing_phases,
)
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.planning.pressure import UNLOADING
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
