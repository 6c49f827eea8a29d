"""Which swing a robot walks with: the high one where its legs are light enough.

A foot that is high while it travels clears ground that nobody told of. It rises faster and comes
down faster, and the rest of the robot moves by as much as the leg is heavy.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from template_control.checks.checked import Checked
from template_control.checks.ranges import Share
from template_control.embedding.references.swing_foot import SwingOptions
from template_control.robot.biped import Biped
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import tuned

HIGH_SWING = SwingOptions(clearance=0.06, rise=0.3, descent=0.12, early=0.02)
"""The foot is high while it travels, and comes down nearly vertically."""


@dataclass(frozen=True)
class SwingChoice(Checked):
    """Shapes of the swings of phases that have none of their own.

    Attributes:
        steady: while the route keeps its kind of stride.
        other: where another kind comes, and of legs that are too heavy for the steady one.
        heaviest: leg's share of the robot's mass up to which the steady one is taken. Robots with
            0.09 walk as well with the high swing; those with 0.14 and more settle worse, and one
            with 0.31 falls.
    """

    steady: SwingOptions = field(default_factory=lambda: HIGH_SWING)
    other: SwingOptions = field(default_factory=SwingOptions)
    heaviest: Share = tuned(0.12)

    def of(self, robot: Biped) -> Swings:
        """The shapes for a robot."""
        light = robot.leg_mass <= self.heaviest * robot.mass
        return Swings(self.steady if light else self.other, self.other)


class Swings(NamedTuple):
    """Shapes of a robot's swings.

    Attributes:
        steady: while the route keeps its kind of stride.
        other: where another kind comes: what it makes of a step depends on how the leg moves.
    """

    steady: SwingOptions
    other: SwingOptions

    def towards(self, goal: StrideGoal) -> SwingOptions:
        """The shape of a swing that begins in a stride with this goal."""
        return self.steady if goal.then is None else self.other
