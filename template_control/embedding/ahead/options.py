"""Tuning of the planner that looks several steps ahead."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from template_control.checks.checked import Checked
from template_control.checks.ranges import Count, Positive, Range, Share
from template_control.embedding.planners.walking.lqr_options import LqrOptions
from template_control.slip.similarity import LENGTH, SPEED, tuned

MOST_STEPS = 6
"""That a plan may look ahead."""
_Three = tuple[Positive, Positive, Positive]


@dataclass(frozen=True)
class AheadOptions(Checked):
    """How several walking steps are planned at once, and how much of a change is tried.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales them.

    Attributes:
        steps: that a plan looks ahead. With two a robot came to a VLO with a dy/dt from which no
            plan led on; with four it gets faster no sooner.
        tolerance: differences of dx/dt, y, dy/dt from the aimed gait's that cost 1.
        angle_tolerance: difference of alpha that costs 1 [rad].
        stiffness_tolerance: difference of kappa_1, kappa_2 and kappa_p that costs 1.
        rise: |dy/dt| at VLO above which a plan costs more: from there on the template soon leaves
            the ground, or the leg sinks.
        rise_tolerance: what is above it, and costs 1.
        pace: largest difference between the aimed speed and the present one. A few steps do not
            lead to a gait that is further away.
        shares: of the wanted change of speed, tried in turn; the first is taken that is cheap.
        cheap: cost up to which a plan is taken.
        rounds: Gauss-Newton steps of a plan.
        done: a Gauss-Newton step that lowers the cost by less than this share is the last.
        lqr: bounds of the controls, the offset estimate, and the search for a step where no plan
            is cheap.
        spacing: of the speeds at VLO whose gaits such a search leads to; each gait that is made is
            kept.
    """

    kind: ClassVar[str] = "ahead"

    steps: Annotated[int, Range(1, MOST_STEPS)] = tuned(3)
    tolerance: _Three = tuned((0.06, 0.006, 0.04), SPEED, LENGTH, SPEED)
    angle_tolerance: Positive = tuned(0.04)
    stiffness_tolerance: Positive = tuned(0.15)
    rise: Positive = tuned(0.15, SPEED)
    rise_tolerance: Positive = tuned(0.02, SPEED)
    pace: Positive = tuned(0.3, SPEED)
    shares: tuple[Share, ...] = tuned((1.0, 0.65, 0.4, 0.2, 0.0))
    cheap: Positive = tuned(20.0)
    rounds: Count = tuned(4)
    done: Share = tuned(0.02)
    lqr: LqrOptions = field(default_factory=LqrOptions)
    spacing: Positive = tuned(0.05, SPEED)
