"""Velocity commands of a floating base: forward, to the left, and turning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from template_control.checks.checked import Checked
from template_control.checks.fitting import check
from template_control.checks.ranges import NotNegative, Positive, Speed
from template_control.errors import ParameterError
from template_control.run.options import SideSpeed, TurningRate

Velocity = tuple[float, float, float]
"""Forward and to the left [m/s], and turning to the left [rad/s], in the heading frame."""


@dataclass(frozen=True)
class VelocityProfile(Checked):
    """Velocities of a floating base by time, each kept until the next.

    The motion of an :class:`~template_control.run.Experiment`: the robot walks at any speed of its
    family of gaits. Footholds and heading follow from one step to the next; the forward speed
    changes as fast as the planner finds steps.

    Attributes:
        velocities: times, rising from 0 [s], each with the mean velocity forward and to the left
            [m/s], and the turning rate to the left [rad/s].
        duration: of the run [s].

    Raises:
        ParameterError: if the first time is not 0, or the times do not rise.
    """

    kind: ClassVar[str] = "velocity"

    velocities: tuple[tuple[NotNegative, Speed, SideSpeed, TurningRate], ...]
    duration: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        times = [row[0] for row in self.velocities]
        if not times or times[0] != 0.0 or sorted(set(times)) != times:
            raise ParameterError(
                f"VelocityProfile.velocities has the times {times}: give rising ones, the first 0"
            )

    def at(self, time: float) -> Velocity:
        """The velocity wanted at a time.

        Args:
            time: from the run's start [s].
        """
        return next(row[1:] for row in reversed(self.velocities) if time >= row[0])


class VelocityCommand:
    """A velocity of a floating base that may be set at any time.

    The motion of an :class:`~template_control.run.Experiment` without an end. What is set holds
    from the next VLO on.

    Args:
        forward: mean velocity ahead [m/s].
        left: to the left [m/s].
        turning: rate of the heading, to the left [rad/s].
    """

    def __init__(self, forward: float, left: float = 0.0, turning: float = 0.0) -> None:
        self.set(forward, left, turning)

    def set(self, forward: float, left: float = 0.0, turning: float = 0.0) -> None:
        """Want another velocity from now on.

        Args:
            forward: mean velocity ahead [m/s].
            left: to the left [m/s].
            turning: rate of the heading, to the left [rad/s].

        Raises:
            ParameterError: if one of them is out of its range; the velocity stays as it was.
        """
        self._velocity: Velocity = (
            check("the commanded forward speed", forward, Speed, ParameterError),
            check("the commanded speed to the left", left, SideSpeed, ParameterError),
            check("the commanded turning rate", turning, TurningRate, ParameterError),
        )

    def at(self, time: float) -> Velocity:
        """The present velocity, whatever the ``time`` [s]."""
        return self._velocity
