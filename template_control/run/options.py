"""Parts of an experiment: pushes, falls, and the heading of a floating-base robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Annotated

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.ranges import Index, NotNegative, Positive, Range
from template_control.errors import ParameterError
from template_control.slip.similarity import tuned

Phase = Annotated[float, Range(0.0, 1.0)]
"""Share of a step's duration."""


@dataclass(frozen=True)
class Push(Checked):
    """A horizontal force on the trunk.

    Attributes:
        impulse: force times duration, forward positive [N s].
        step: number of the step in which the push begins; 0 is the first.
        phase: time from this step's VLO to the push, over the gait's step duration.
        duration: how long the force acts [s].
        direction: of a free robot, from forward to the left [rad].
        time: from the run's start to the push [s]; None: the push comes at ``step`` and ``phase``.
    """

    impulse: float
    step: Index = 10
    phase: Phase = 0.0
    duration: Positive = 0.1
    direction: float = 0.0
    time: NotNegative | None = None

    def force(self) -> tuple[float, float]:
        """Force while the push acts, forward and to the left [N]."""
        force = self.impulse / self.duration
        return force * cos(self.direction), force * sin(self.direction)

    def begins(self, begun: Sequence[tuple[float, float]]) -> float | None:
        """Time of the push from the run's start [s]; None where its step has not begun.

        ``begun`` has when each step began, and the duration of its gait's steps [s].
        """
        if self.time is not None:
            return self.time
        if self.step >= len(begun):
            return None
        time, duration = begun[self.step]
        return time + self.phase * duration


@dataclass(frozen=True)
class FallOptions(Checked):
    """Limits at which a foot touches the ground, and a robot counts as fallen.

    Attributes:
        contact_force: share of the weight that a foot must carry to count as touching. Less is
            the rattle of a contact solver.
        height: share of the template's rest length. A robot whose hips are nearer to the ground
            has fallen.
        thrown: multiple of sqrt(g l0). Where the base is said to move faster, the simulation or
            what is sensed of it has diverged.
        pitch: a trunk that leans further than this has fallen [rad].
        patience: number of the gait's step durations that may pass without a section; twice as
            many where the robot is on its way to rest, for as long as that is planned to take.
    """

    contact_force: NotNegative = tuned(0.005)
    height: NotNegative = tuned(0.35)
    thrown: Positive = tuned(30.0)
    pitch: Positive = tuned(float(np.radians(60.0)))
    patience: Positive = tuned(4.0)


def check_pushes(pushes: tuple[Push, ...], steps: int) -> None:
    """Check that a run of at most ``steps`` is long enough for its pushes."""
    for push in pushes:
        if push.time is None and push.step >= steps:
            raise ParameterError(
                f"a push is in step {push.step}, and the run has steps 0 to {steps - 1}: give an"
                " earlier step or a longer run"
            )


TurningRate = Annotated[float, Range(-2.0, 2.0)]
SideSpeed = Annotated[float, Range(-5.0, 5.0)]
ForwardSpeed = Annotated[float, Range(-20.0, 20.0)]


@dataclass(frozen=True)
class HeadingCommand(Checked):
    """Heading, lateral speed and step width of a floating-base robot.

    Attributes:
        turning_rate: of the heading, to the left positive [rad/s].
        side_speed: of the walk, to the left positive [m/s].
        turns: times [s] and the turning rate [rad/s] from each of them on; the times rise.
        step_width: lateral distance between left and right footholds [m]; None: the one of the
            embedding's options, by the robot's size.
    """

    turning_rate: TurningRate = 0.0
    side_speed: SideSpeed = 0.0
    step_width: Positive | None = None
    turns: tuple[tuple[NotNegative, TurningRate], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        times = [time for time, _ in self.turns]
        if sorted(set(times)) != times:
            raise ParameterError(f"HeadingCommand.turns has the times {times}: give rising ones")

    def rate(self, time: float) -> float:
        """Turning rate at a ``time`` [s] from the run's start [rad/s]."""
        return next((rate for at, rate in reversed(self.turns) if time >= at), self.turning_rate)
