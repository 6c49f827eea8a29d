"""Tuning of the embedding of a humanoid on flat feet, and its table of phases.

A sole bears a moment. So in single stance of a walk the CoM's momentum is followed too, forward and
to the left, and the trunk is kept upright; the centre of pressure moves by millimetres for it. A
run is that of point feet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from template_control.embedding.free.options import FreeOptions
from template_control.embedding.learners.lean import LeanOptions
from template_control.embedding.phases import (
    RUNNING_SWING,
    Clock,
    PhaseControl,
    Phases,
    running_phases,
    standing_phases,
)
from template_control.embedding.standing.supports import UNLOADING
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.lateral.gait import LateralOptions
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    OrientationTask,
    SideFootTask,
    SoleTask,
    SpinTask,
    SwayTask,
)

# Stiffer than point feet have it: with 10 % more mass the CoM then sinks by 2 mm until the load is
# learnt, and not by 9 mm, at which the planner leaves its law.
_GAINS = (240.0, 31.0)  # kp [1/s^2], kd [1/s]

_SINGLE = PhaseControl(
    tasks=(
        # Lighter in x, a sole would be a free lunch: the momentum is drained to move the swing leg.
        ComTask((1.0, 10.0), _GAINS, on_point=True, falling=1.0),
        SwayTask(1.0),
        OrientationTask((1.0, 1.0, 0.1)),
        # Lighter than the rest: a fast swing asks for more than the hips have, and the trunk would
        # nod with it. But it rises: dragged along the ground it bears the robot.
        FootTask(weight=(0.1, 1.0)),
        SideFootTask(weight=0.1),
        SoleTask(),
    ),
    swings=(Leg.FRONT,),
)
# Heavy legs fold as little as they may: as those on point feet, they turn the trunk by 0.5 rad.
_RUNNING_SWING = replace(RUNNING_SWING, clearance=0.08, landing_speed=0.4)
_RUNNING_STANCE = PhaseControl(
    # As point feet have it. To keep the trunk upright against the legs takes the hips' limits in
    # half of the stance, and the angular momentum that is left costs a fifth of the speed.
    tasks=(
        ComTask((0.01, 10.0), _GAINS),
        # As fast as on point feet, a change of the speed turns the trunk until it falls.
        SpinTask(bandwidth=35.0),
        FootTask(),
        SideFootTask(),
        SoleTask(),
    ),
    swings=(Leg.FRONT,),
    swing=_RUNNING_SWING,
)
_DOUBLE = PhaseControl(
    tasks=(
        ComTask((10.0, 10.0), _GAINS, on_point=True),
        SwayTask(10.0),
        OrientationTask((4.0, 4.0, 0.4)),
    ),
    unload_legs=(Leg.REAR,),
)

_STANDING = replace(_DOUBLE, unload_legs=(), clock=Clock.TIME, follow_curve=True)
_STEPPING = replace(_SINGLE, clock=Clock.TIME, follow_curve=True)

SOLE_PHASES: Phases = {
    **running_phases(
        (
            OrientationTask((0.2, 0.2, 0.02)),
            *(task(leg) for leg in Leg for task in (FootTask, SideFootTask, SoleTask)),
        ),
        _RUNNING_STANCE,
        _DOUBLE,
    ),
    Phase.SS: _SINGLE,
    Phase.DS: replace(_DOUBLE, trim_momentum=True),
    # A planner with push-off leaves the trim nothing to do.
    "DS_sc^wp": _DOUBLE,
    "DS_sd^wp": _DOUBLE,
    **standing_phases(_STANDING, _STEPPING, UNLOADING),
}
"""Standing, walking, and runs. Nodes of other gaits find the entry of their phase."""


@dataclass(frozen=True)
class SoleOptions(FreeOptions):
    """Tuning of the embedding of a robot on flat feet.

    The fields of :class:`~template_control.embedding.free.options.FreeOptions` come first.

    Attributes:
        phases: tasks, clock, feet and learners of each phase.
        lean: none: the trunk stays upright.
        lateral: heavy legs run with their feet at half of the walk's distance, just side by side;
            at all of it they turn the trunk by 0.36 rad to either side, and by 0.7 as they begin.
    """

    kind: ClassVar[str] = "soles"

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(SOLE_PHASES))
    lean: LeanOptions = field(default_factory=lambda: LeanOptions({}))
    lateral: LateralOptions = field(default_factory=lambda: LateralOptions(running_width=0.5))
