"""Options that all worlds have, and the plants that options describe."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.plant.terrain import Terrain
from template_control.robot.biped import Biped
from template_control.robot.spec import RobotSpec
from template_control.robot.terms import PATCH, UP


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


def moment(place: Sequence[float], force: Sequence[float]) -> tuple[float, float, float]:
    """Moment of a force about the origin [N m]; NumPy's cross product takes 40 us."""
    (x, y, z), (fx, fy, fz) = place, force
    return y * fz - z * fy, z * fx - x * fz, x * fy - y * fx


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


class EnginePlant(OptionsPlant, ABC):
    """A plant in a physics engine, whose contacts are gone through once a step.

    A subclass sets ``_stale`` where they are others.
    """

    def __init__(self, robot: Biped) -> None:
        self._forces = np.zeros((len(robot.feet), robot.contact_rows))
        self._floats = robot.directions > UP  # the base
        self._axes = (0, 1, 2) if self._floats else (0, UP)  # of a contact's force
        self._trunk_lies, self._stale = False, True

    @abstractmethod
    def _find_contacts(self) -> None:
        """Let the ground's forces :meth:`_press`, and set ``_trunk_lies`` where the trunk lies."""

    def _press(self, foot: int, place: Sequence[float], force: Sequence[float]) -> None:
        """Add the ground's force (3,) [N] on a contact at a place (3,) [m]."""
        parts = [force[axis] for axis in self._axes]
        if self._forces.shape[1] == PATCH:
            parts += moment(place, force)
        for i, part in enumerate(parts):
            self._forces[foot, i] += part

    def contact_forces(self, out: Array) -> None:
        """See :meth:`~.plant.Plant.contact_forces`.

        Averages over the last physics step: the first sample of a touchdown is an impulse
        divided by that step.
        """
        self._read_contacts()
        out[...] = self._forces

    def trunk_touches_ground(self) -> bool:
        """See :class:`~.plant.Plant`."""
        self._read_contacts()
        return self._trunk_lies

    def _read_contacts(self) -> None:
        if self._stale:
            self._stale, self._trunk_lies = False, False
            self._forces.fill(0.0)
            self._find_contacts()
