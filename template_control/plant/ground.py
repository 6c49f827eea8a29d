"""A single step of the ground that a robot is not told of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from template_control.checks.checked import Checked
from template_control.checks.ranges import Range
from template_control.errors import ParameterError
from template_control.plant.terrain.terrain import Terrain
from template_control.slip.gaits.gait import WalkingGait

_HIGHEST = 1.0  # [m]
_FARTHEST = 1000.0  # [m]


@dataclass(frozen=True)
class GroundStep(Checked):
    """A single step of the ground: at height 0 before ``x``, at ``height`` from there on.

    The edge is a vertical wall, on which a foot can trip; place it between footholds, as
    :meth:`at_step` does.

    Attributes:
        height: up positive [m].
        x: of the edge [m]; a run begins with the stance foot at x = 0.

    Raises:
        ParameterError: if the height is 0 or more than 1 m, or x is not within 0 to 1000 m.
    """

    height: Annotated[float, Range(-_HIGHEST, _HIGHEST)]
    x: Annotated[float, Range(0.0, _FARTHEST, above=True)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.height == 0.0:
            raise ParameterError("GroundStep.height is 0: give a number other than 0")

    @classmethod
    def at_step(cls, gait: WalkingGait, height: float, step: int, share: float = 0.5) -> GroundStep:
        """The step that the robot meets when it treads on its ``step``-th foothold.

        Args:
            gait: its footholds are at multiples of the step length, the first stance foot
                (number 0) at x = 0.
            height: up positive [m].
            step: number of the first foothold beyond the edge, at least 1.
            share: of the way from the foothold before to that one, where the edge is.

        Raises:
            ParameterError: if a number is out of its range.
        """
        if step < 1:
            raise ParameterError(f"foothold is {step}: give at least 1")
        if not 0.0 < share < 1.0:
            raise ParameterError(f"share is {share!r}: give a number between 0 and 1")
        return cls(height, (step - 1 + share) * gait.step_length)

    @property
    def terrain(self) -> Terrain:
        """The ground with this step in it."""
        return Terrain.step(self.height, self.x)
