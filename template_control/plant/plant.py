"""What a plant is, and the one that given options describe."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.robot.planar_biped import PlanarBiped

Array = NDArray[np.float64]


class Plant(Protocol):
    """A robot in a world, driven by joint torques and a push on its trunk, nothing else."""

    def reset(self, q: Array, v: Array) -> None:
        """Place the robot at (q, v); only for the start of a run."""

    def read(self, q: Array, v: Array) -> None:
        """Write the measured configuration and velocity (nv,) into ``q`` and ``v``."""

    def contact_forces(self, out: Array) -> None:
        """Write the ground's mean force on each foot (2, 2) [N] in the last step into ``out``."""

    def trunk_touches_ground(self) -> bool:
        """True where the trunk itself lies on the ground."""

    def step(self, torque: Array, push: float = 0.0) -> None:
        """Advance one time step with ``torque`` (nu,) [N m] and ``push`` [N] on the trunk."""

    def close(self) -> None:
        """Give back what the plant holds."""


def plant_name(options: PlantOptions | IdealOptions) -> str:
    """``ideal`` or ``pybullet``."""
    return "ideal" if isinstance(options, IdealOptions) else "pybullet"


def open_plant(
    robot: PlanarBiped, options: PlantOptions | IdealOptions
) -> AbstractContextManager[Plant]:
    """The plant that ``options`` describe, to be used as a context manager."""
    if isinstance(options, IdealOptions):
        return IdealPlant(robot, options)
    return BulletPlant(robot, options)
