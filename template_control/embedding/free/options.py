"""The tuning of the embedding of a free robot, for the reference template."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from template_control.checks.ranges import Positive, Share
from template_control.embedding.free.phases import FREE_PHASES
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import PhaseControl
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.swing import SwingOptions
from template_control.estimation.filters import NoiseFilterOptions
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.lateral.gait import LateralOptions
from template_control.slip.similarity import LENGTH, TIME, tuned


@dataclass(frozen=True)
class FreeOptions(EmbeddingOptions):
    """Tuning of the embedding of a free robot.

    The fields of :class:`~template_control.embedding.options.EmbeddingOptions` come first.

    Attributes:
        phases: tasks, clock, feet and learners of each phase.
        swing: shape of the swings. A foot has to move aside too, and is not asked to be high.
        catches: a free robot has no run to break into.
        lateral: how the feet are placed sideways.
        noise_filter: of a state that is measured with noise; None: it is taken as it is measured.
        step_width: distance aside between left and right footholds [m]. Wider, and the
            robot sways more than its slow steps bear; narrower, and a push leaves less room.
        stop_share: joints slow down before their stops at any speed: hips that swing aside come to
            theirs slowly, with the robot's weight behind them.
        stop_horizon: a joint's speed is at most the way to its stop over this time [s].
    """

    kind: ClassVar[str] = "free"

    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(FREE_PHASES))
    swing: SwingOptions | None = field(default_factory=SwingOptions)
    catches: bool = tuned(False)
    lateral: LateralOptions = field(default_factory=LateralOptions)
    noise_filter: NoiseFilterOptions | None = field(default_factory=NoiseFilterOptions)
    step_width: Positive = tuned(0.22, LENGTH)
    stop_share: Share = tuned(0.0)
    stop_horizon: Positive = tuned(0.05, TIME)


FREE_PLANNER = LqrOptions(earliest_touchdown=0.1, earliest_share=1.0, trusted_price=0.3)
"""The planner's tuning of a free robot.

Its swing leg has to move aside too, and needs time. Its first steps from a start are further from
the gait than a planar robot's, and the law of a slow gait is good in its neighbourhood only: at
0.4 m/s it led Bolt from an error of 2 mm to one of 0.1 m/s. So the search begins earlier.
"""
