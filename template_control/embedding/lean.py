"""Lean of the trunk: by kind of stride and speed, and on average over a stride.

A trunk that leans forward carries the CoM ahead of the hips, and moves load from the knees to the
hips. Within a running stride the pitch oscillates, as the legs' swing takes angular momentum from
the trunk, and its mean settles off the reference: the mean is regulated from stride to stride.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from template_control.checks.checked import Checked
from template_control.compiled import compiled
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import RATE, SPEED, Scale, tuned
from template_control.structured import Number, structure

LEAN_RATE = 0.1
"""Rate at which the lean changes at most [rad/s, of the reference template]."""
GAIN = 0.2
"""Share of a stride's mean error that changes the reference."""
ERROR_BOUND = 0.05
"""A larger mean error counts as this much [rad]: a push is no drift."""
CORRECTION_BOUND = 0.25
"""Of what the reference adds to the wanted mean [rad]."""


@dataclass(frozen=True)
class Lean(Checked):
    """Mean pitch of the trunk by speed, linear between the entries.

    Attributes:
        speeds: at the section, rising [m/s].
        pitches: at these speeds [rad], forward positive.
        excess: by which the reference is to exceed the mean at first [rad].

    Raises:
        ParameterError: if the speeds do not rise, or have not a pitch each.
    """

    speeds: tuple[float, ...] = tuned((0.0,), SPEED)
    pitches: tuple[float, ...] = tuned((0.0,))
    excess: float = tuned(0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.speeds or len(self.speeds) != len(self.pitches):
            raise ParameterError(
                f"a Lean has {len(self.speeds)} speeds and {len(self.pitches)} pitches: give one"
                " pitch for each of at least one speed"
            )
        if any(b <= a for a, b in pairwise(self.speeds)):
            raise ParameterError(f"Lean.speeds are {self.speeds}: give rising ones")

    def at(self, speed: float) -> float:
        """The mean pitch [rad] at a speed [m/s]."""
        return float(np.interp(speed, self.speeds, self.pitches))


def _leans() -> dict[str, Lean]:
    # Running knees carry twice the weight on a leg that is far from straight.
    return {
        StrideKind.WALK_TO_RUN: Lean((1.2,), (0.33,)),
        StrideKind.RUN: Lean((2.0, 2.5, 3.0, 3.5, 4.0), (0.33, 0.34, 0.36, 0.40, 0.40), excess=0.1),
        StrideKind.RUN_TO_WALK: Lean((1.2,), (0.33,), excess=0.1),
        StrideKind.HOP: Lean((1.2,), (0.33,), excess=0.1),
    }


@dataclass(frozen=True)
class LeanOptions(Checked):
    """Lean of the trunk.

    Attributes:
        strides: the lean of each kind of stride; a kind that is missing keeps the controller's
            ``trunk_pitch``, and its mean pitch is not regulated.
    """

    strides: Mapping[str, Lean] = field(default_factory=_leans)

    def of(self, goal: StrideGoal) -> Lean | None:
        """The lean of a stride; one without a lean of its own prepares that of the next kind."""
        return self.strides.get(goal.stride) or self.strides.get(goal.then or "")

    def pitch(self, goal: StrideGoal, upright: float) -> float:
        """The mean pitch of a stride [rad].

        Args:
            goal: the stride, and where it leads.
            upright: pitch where no lean is known [rad].
        """
        lean = self.of(goal)
        return upright if lean is None else lean.at(goal.wanted_speed)


LEAN = structure(
    goal=float,  # mean pitch of the present stride [rad]
    mean=float,  # mean pitch that is wanted now, on its way to the goal [rad]
    correction=float,  # what the reference adds to it [rad]
    rate=float,  # at which the mean changes at most [rad/s]
    sum=float,  # of the mean's error over the stride [rad s]
    time=float,  # of the stride so far [s]
)
"""Lean of the trunk."""


@compiled
def advance_lean(lean: Any, pitch: float, dt: float) -> float:
    """Reference of the pitch [rad] at this tick of ``dt`` [s], from the trunk's pitch."""
    most = lean.rate * dt
    lean.mean += min(max(lean.goal - lean.mean, -most), most)
    lean.sum += (lean.mean - pitch) * dt
    lean.time += dt
    return lean.mean + lean.correction


class TrunkLean:
    """The trunk's reference, by kind of stride and speed; it persists from stride to stride.

    ``upright`` is the reference of strides without a lean of their own [rad], ``data`` (1,) are of
    ``LEAN``, which explains the other numbers.
    """

    mean, correction, _goal, _sum, _time = (
        Number(name) for name in ("mean", "correction", "goal", "sum", "time")
    )

    def __init__(self, options: LeanOptions, upright: float, scale: Scale, data: Any) -> None:
        self.options, self.data, self._upright = options, data, upright
        self.data["rate"] = LEAN_RATE * scale.factor(RATE)
        self.reset()

    def reset(self) -> None:
        """Forget what was learnt, and where the trunk was to be."""
        self.mean = self._goal = self._upright
        self.correction = 0.0
        self._lean: Lean | None = None
        self._begun = False
        self._sum = self._time = 0.0

    def turn_round(self) -> None:
        """The robot is to go backward, or forward again: what leans ahead now leans back."""
        self.mean, self.correction, self._lean = -self.mean, 0.0, None

    def aim(self, goal: StrideGoal) -> None:
        """Begin a stride with this goal."""
        lean = self.options.of(goal)
        self._goal = self.options.pitch(goal, self._upright)
        if lean is not self._lean:
            self.correction = 0.0 if lean is None else lean.excess
            self._lean = lean
        if not self._begun:
            self.mean, self._begun = self._goal, True

    def end_stride(self, nominal: bool) -> None:
        """Learn from the stride that has just ended, if it went near the gait."""
        if nominal and self._lean is not None and self._time > 0.0:
            error = min(max(self._sum / self._time, -ERROR_BOUND), ERROR_BOUND)
            correction = self.correction + GAIN * error
            self.correction = min(max(correction, -CORRECTION_BOUND), CORRECTION_BOUND)
        self._sum = self._time = 0.0
