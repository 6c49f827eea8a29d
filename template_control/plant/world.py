"""Options that all worlds have, and the plants that options describe."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.plant.terrain import Terrain
from template_control.robot.spec import RobotSpec


@dataclass(frozen=True, kw_only=True)
class WorldOptions(Checked):
    """Options of a world.

    Attributes:
        time_step: physics step, and period of the torques [s].
        mass_scale: factor of every link's mass and inertia; the controller does not know it.
        terrain: the ground, which the controller does not know; None for flat ground.
        gravity: [m/s^2]; None: what the controller knows.
        robot: that is simulated, with the joints and feet of the controller's, which does not know
            it; None: the same.

    Raises:
        ParameterError: if a number is not positive and finite.
    """

    kind: ClassVar[str]

    time_step: Positive = 1e-3
    mass_scale: Positive = 1.0
    terrain: Terrain | None = None
    gravity: Positive | None = None
    robot: RobotSpec | None = None

    @cached_property
    def ground(self) -> Terrain:
        """The ground."""
        return self.terrain or Terrain.flat()

    def ground_height(self, x: float) -> float:
        """Height of the ground at ``x`` [m]."""
        return self.ground.height_at(x)


class OptionsPlant:
    """A plant that ``options`` describe, and a context manager; see :class:`~.plant.Plant`."""

    options: Any

    @property
    def time_step(self) -> float:
        """See :class:`~.plant.Plant`."""
        return float(self.options.time_step)

    def ground_height(self, x: float) -> float:
        """See :class:`~.plant.Plant`."""
        return float(self.options.ground_height(x))

    def close(self) -> None:
        """See :class:`~.plant.Plant`; there is nothing to give back."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
