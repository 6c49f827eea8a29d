"""Tuning of the embedding of a floating-base robot, and its table of phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import RUNNING_SWING, PhaseControl, Phases, running_phases
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.swing import SwingOptions
from template_control.estimation.filters import NoiseFilterOptions
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.lateral.gait import LateralOptions
from template_control.slip.similarity import LENGTH, TIME, tuned
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    OrientationTask,
    SideFootTask,
    SpareJointTask,
    SpinTask,
)

# Two point feet bear no torque about the line between them: with the height and the trunk held
# there is one freedom left for x and y, and with the weights of the plane the robot loses speed in
# every double stance.
_DOUBLE = PhaseControl(
    tasks=(ComTask((30.0, 30.0)), OrientationTask((4.0, 4.0, 0.4)), SpareJointTask()),
    unload_legs=(Leg.REAR,),
)

_RUNNING_STANCE = PhaseControl(
    # As in the plane, about all three axes.
    tasks=(
        ComTask((0.01, 10.0)),
        SpinTask(),
        FootTask(),
        SideFootTask(),
        SpareJointTask(),
    ),
    swings=(Leg.FRONT,),
    swing=RUNNING_SWING,
)

FREE_PHASES: Phases = {
    **running_phases(
        (
            OrientationTask((0.01, 0.01, 0.001)),
            FootTask(Leg.REAR),
            SideFootTask(Leg.REAR),
            FootTask(Leg.FRONT),
            SideFootTask(Leg.FRONT),
            SpareJointTask(),
        ),
        _RUNNING_STANCE,
        _DOUBLE,
    ),
    Phase.SS: PhaseControl(
        # As in the plane; and the CoM's y is left to the place of the feet.
        tasks=(
            ComTask((0.01, 10.0)),
            OrientationTask(),
            FootTask(),
            SideFootTask(),
            SpareJointTask(),
        ),
        swings=(Leg.FRONT,),
    ),
    Phase.DS: replace(_DOUBLE, trim_momentum=True),
    # A planner with push-off leaves the trim nothing to do.
    "DS_sc^wp": _DOUBLE,
    "DS_sd^wp": _DOUBLE,
}
"""Walking and running. Nodes of other gaits find the entry of their phase."""


@dataclass(frozen=True)
class FreeOptions(EmbeddingOptions):
    """Tuning of the embedding of a free robot.

    The fields of :class:`~template_control.embedding.options.EmbeddingOptions` come first.

    Attributes:
        phases: tasks, clock, feet and learners of each phase.
        swing: shape of the swings. A foot has to move sideways too, and is not asked to be high.
        catches: a free robot has no run to break into.
        lateral: how the feet are placed sideways.
        noise_filter: of a state that is measured with noise; None: it is taken as it is measured.
        step_width: lateral distance between left and right footholds [m]. Wider, and the
            robot sways more than its slow steps bear; narrower, and a push leaves less room.
        stop_share: joints slow down before their stops at any speed: hips that swing sideways
            come to theirs slowly, with the robot's weight behind them.
        stop_horizon: a joint's speed is at most the way to its stop over this time [s].
    """

    kind: ClassVar[str] = "free"

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(FREE_PHASES))
    swing: SwingOptions | None = field(default_factory=SwingOptions)
    catches: bool = tuned(False)
    lateral: LateralOptions = field(default_factory=LateralOptions)
    noise_filter: NoiseFilterOptions | None = field(default_factory=NoiseFilterOptions)
    step_width: NotNegative = tuned(0.22, LENGTH)
    stop_share: Share = tuned(0.0)
    stop_horizon: Positive = tuned(0.05, TIME)


FREE_PLANNER = LqrOptions(earliest_touchdown=0.1, earliest_share=1.0, trusted_price=0.3)
"""Tuning of a floating-base robot's planner.

Its swing leg has to move sideways too, and needs time. Its first steps from a start are further
from the gait than a planar robot's, and the law of a slow gait is good in its neighbourhood only:
at 0.4 m/s it led Bolt from an error of 2 mm to one of 0.1 m/s. So the search begins earlier.
"""
