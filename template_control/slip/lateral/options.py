"""Tuning of the sideways motion."""

from __future__ import annotations

from dataclasses import dataclass, field

from template_control.checks.checked import Checked
from template_control.checks.ranges import Interval, NotNegative, Positive, Share
from template_control.slip.similarity import (
    LENGTH,
    PER_LENGTH_SQUARED,
    PER_SPEED_SQUARED,
    SPEED,
    TIME,
    tuned,
)


@dataclass(frozen=True)
class LateralLearningOptions(Checked):
    """How fast the sideways motion is learnt, and how much is believed.

    Attributes:
        gain: share of a step's surprise that enters the offset of y and dy/dt.
        one_sided: how far a step from one side teaches that side alone. At 0 the other side learns
            the mirror image: a drift aside, which is the walk's own and no offset, is not learnt.
        offset_bound: largest offsets of y and dy/dt [m, m/s].
        surprise_bound: a larger surprise counts as this much: a push is no offset [m, m/s].
        stretch_gain: share of a stance's surprise that enters the stretch.
        stretch_bounds: of the stretch. A stance that is longer or shorter was disturbed.
    """

    gain: Share = tuned(0.2)
    one_sided: Share = tuned(0.0)
    offset_bound: tuple[NotNegative, NotNegative] = tuned((0.04, 0.15), LENGTH, SPEED)
    surprise_bound: tuple[NotNegative, NotNegative] = tuned((0.02, 0.08), LENGTH, SPEED)
    stretch_gain: Share = tuned(0.2)
    stretch_bounds: Interval = tuned((0.9, 1.2))


@dataclass(frozen=True)
class LateralOptions(Checked):
    """Tuning of the footholds' y.

    Attributes:
        state_cost: on y and dy/dt at a section, over those of the periodic gait
            [1/m^2, s^2/m^2]: equal for both where dy/dt is measured by sqrt(g / l0).
        step_cost: on the next foot's distance to the stance foot, over the gait's [1/m^2].
        widths: least and largest distance aside between two footholds [m]: feet do not cross,
            and legs open so far only.
        reach: largest distance aside between CoM and foot at touchdown [m].
        hold: a foothold is not changed so shortly before touchdown [s]: the foot cannot follow.
        learning: how the robot's own part is learnt.
    """

    state_cost: tuple[NotNegative, NotNegative] = tuned(
        (1.0, 0.102), PER_LENGTH_SQUARED, PER_SPEED_SQUARED
    )
    step_cost: Positive = tuned(0.02, PER_LENGTH_SQUARED)
    widths: Interval = tuned((0.08, 0.6), LENGTH)
    reach: Positive = tuned(0.4, LENGTH)
    hold: NotNegative = tuned(0.042, TIME)
    learning: LateralLearningOptions = field(default_factory=LateralLearningOptions)
