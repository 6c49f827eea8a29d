"""What a plant is, and the one that given options describe."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.checked import checked
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.robot.planar_biped import PlanarBiped

Array = NDArray[np.float64]


class Plant(Protocol):
    """A robot in a world, driven by joint torques and a push on its trunk, nothing else."""

    def reset(self, q: Array, v: Array) -> None:
        """Place the robot in a state; only for the start of a run.

        Args:
            q: (nv,) configuration [m, rad].
            v: (nv,) velocity [m/s, rad/s].
        """

    def read(self, q: Array, v: Array) -> None:
        """Write the robot's state into ``q`` and ``v``.

        Args:
            q: (nv,) overwritten with the configuration [m, rad].
            v: (nv,) overwritten with the velocity [m/s, rad/s].
        """

    def contact_forces(self, out: Array) -> None:
        """Write the ground's mean force on each foot during the last step into ``out``.

        Args:
            out: (2, 2) overwritten with x and y of each foot's force [N].
        """

    def trunk_touches_ground(self) -> bool:
        """True where the trunk itself lies on the ground."""

    def step(self, torque: Array, push: float = 0.0) -> None:
        """Advance one time step.

        Args:
            torque: (nu,) joint torques, held during the step [N m].
            push: horizontal force on the trunk's centre of mass, forward positive [N].
        """

    def close(self) -> None:
        """Give back what the plant holds."""


def plant_name(options: PlantOptions | IdealOptions) -> str:
    """Name of the plant that ``options`` describe: ``ideal`` or ``pybullet``."""
    return "ideal" if isinstance(options, IdealOptions) else "pybullet"


@checked
def open_plant(
    robot: PlanarBiped, options: PlantOptions | IdealOptions
) -> AbstractContextManager[Plant]:
    """Make the plant that ``options`` describe, to be used as a context manager.

    Args:
        robot: the controller's model; the plant makes its own robot from it.
        options: the world; their type chooses the plant.
    """
    if isinstance(options, IdealOptions):
        return IdealPlant(robot, options)
    return BulletPlant(robot, options)
