"""Tuning of the embedding of a quadruped that trots, and its table of phases.

The two legs of the template are pairs of legs, and a pair's foot is the mean of its two. Two feet
that stand hold the trunk about every axis but the line between them, and that line's moment comes
from how the template's force is shared: the trunk is simply kept level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from template_control.checks.ranges import NotNegative
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.free.soles import SoleOptions
from template_control.embedding.learners.lean import LeanOptions
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import (
    RUNNING_SWING,
    Clock,
    PhaseControl,
    Phases,
    running_phases,
    standing_phases,
)
from template_control.embedding.standing.supports import UNLOADING
from template_control.robot.biped import Biped
from template_control.robot.terms import LEGS, UP
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.lateral.gait import LateralOptions
from template_control.slip.similarity import LENGTH, tuned
from template_control.whole_body.task import Task
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    OrientationTask,
    SideFootTask,
    SwayTask,
)

_LEVEL = OrientationTask((10.0, 10.0, 10.0), yaw_gains=(100.0, 20.0))


def _pair(leg: Leg) -> tuple[Task, ...]:
    """Tasks of both feet of a pair."""
    return tuple(
        task(leg, contact=contact) for contact in range(2) for task in (FootTask, SideFootTask)
    )


# Of a pair that has landed, the foot that has not touched yet comes down.
_STANCE = PhaseControl(
    tasks=(ComTask((0.01, 10.0)), _LEVEL, *_pair(Leg.REAR), *_pair(Leg.FRONT)),
    swings=(Leg.FRONT,),
)
# The ground's force has no moment about the line between two feet, which is oblique: feedback that
# moves x alone moves y too. A walk without push-off has no other means to keep its speed.
_SWAYING = replace(_STANCE, tasks=(*_STANCE.tasks, SwayTask()))
_RUNNING_STANCE = replace(_SWAYING, swing=RUNNING_SWING)
_DOUBLE = PhaseControl(
    tasks=(ComTask((1.0, 3.0)), SwayTask(), _LEVEL, *_pair(Leg.REAR), *_pair(Leg.FRONT)),
    unload_legs=(Leg.REAR,),
)

# Four feet stand, and hold the CoM's y too.
_STANDING = PhaseControl(
    tasks=(ComTask((10.0, 10.0)), SwayTask(10.0), _LEVEL, *_pair(Leg.REAR), *_pair(Leg.FRONT)),
    clock=Clock.TIME,
    follow_curve=True,
)
_STEPPING = replace(_STANCE, clock=Clock.TIME, follow_curve=True)

TROT_PHASES: Phases = {
    **running_phases(
        (OrientationTask((0.01, 0.01, 0.001)), *_pair(Leg.REAR), *_pair(Leg.FRONT)),
        _RUNNING_STANCE,
        _DOUBLE,
    ),
    Phase.SS: _STANCE,
    Phase.DS: replace(_DOUBLE, trim_momentum=True),
    "SS_av^wp": _SWAYING,
    "SS_bv^wp": _SWAYING,
    "DS_sc^wp": _DOUBLE,
    "DS_sd^wp": _DOUBLE,
    **standing_phases(_STANDING, _STEPPING, UNLOADING),
}
"""Standing, walking and running trot. Nodes of other gaits find the entry of their phase."""


@dataclass(frozen=True)
class TrotOptions(FreeOptions):
    """Tuning of the embedding of a quadruped.

    The fields of :class:`~template_control.embedding.free.options.FreeOptions` come first.

    Attributes:
        phases: tasks, clock, feet and learners of each phase.
        lean: none: the trunk stays level.
        lateral: pairs of legs may cross, as a push may want them to.
        step_width: lateral distance between the footholds of both pairs [m]: none, as the middle of
            either pair is below the trunk's.
    """

    kind: ClassVar[str] = "trot"

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(TROT_PHASES))
    lean: LeanOptions = field(default_factory=lambda: LeanOptions({}))
    lateral: LateralOptions = field(default_factory=lambda: LateralOptions(widths=(-0.6, 0.6)))
    step_width: NotNegative = tuned(0.0, LENGTH)


def default_options(robot: Biped) -> EmbeddingOptions:
    """Options of a robot's kind.

    Args:
        robot: planar, or with a floating base and two legs, with point or flat feet, or four.
    """
    if robot.patches:
        return SoleOptions()
    if len(robot.feet) > LEGS:
        return TrotOptions()
    return FreeOptions() if robot.directions > UP else EmbeddingOptions()
