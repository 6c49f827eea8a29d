"""Interface of plants, and the plant that options describe."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from importlib.util import find_spec
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.plant.mujoco import MujocoOptions, MujocoPlant
from template_control.plant.world import WorldOptions
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped


@runtime_checkable
class Plant(Protocol):
    """A robot in a world, driven by joint torques and a push on its trunk, nothing else.

    ``simulate`` takes any object with these members, see docs/guides/your_plant.md.
    """

    @property
    def time_step(self) -> float:
        """Duration of a :meth:`step` [s]."""

    def ground_height(self, x: float) -> float:
        """Height of the ground at ``x`` [m]; to notice a fall, and to stand on at the start."""

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
        """Write the ground's mean force on each contact during the last step into ``out``.

        Args:
            out: (n, 2) overwritten with x and y of each contact's force, in the order of the
                robot's ``feet`` [N]; (n, 3) with x, y and z of a floating-base robot's. Of a robot
                with soles (n, 6): the force, then its moment about the world's origin [N m].
        """

    def trunk_touches_ground(self) -> bool:
        """True where the trunk itself lies on the ground."""

    def step(self, torque: Array, push: float = 0.0) -> None:
        """Advance one time step.

        Args:
            torque: (nu,) joint torques, held during the step [N m].
            push: horizontal force on the trunk's centre of mass, forward positive [N]. The plant of
                a floating-base robot has a third parameter: both act along the world's x and y.
        """

    def close(self) -> None:
        """Give back what the plant holds."""


World = WorldOptions | Plant
"""A plant, or the options of one of the library's."""

_MEMBERS = [name for name in vars(Plant) if not name.startswith("_")]


def default_plant() -> PlantOptions:
    """Options of the physics engine that is installed: PyBullet, or else MuJoCo."""
    return PlantOptions() if find_spec("pybullet") else MujocoOptions()


def check_world(world: World) -> None:
    """Check that an object is options or a :class:`Plant` with a positive time step."""
    if isinstance(world, WorldOptions):
        return
    lacking = [name for name in _MEMBERS if not hasattr(world, name)]
    if lacking:
        raise ParameterError(
            f"world is a {type(world).__name__}, which lacks {', '.join(lacking)}: give"
            " PlantOptions, MujocoOptions, IdealOptions or an object with the members of Plant"
        )
    step = world.time_step
    if not (isinstance(step, int | float) and np.isfinite(step) and step > 0.0):
        raise ParameterError(
            f"{type(world).__name__}: time_step is {step!r}: give a positive number of seconds"
        )


def plant_name(world: World) -> str:
    """Name of a plant: ``ideal``, ``mujoco``, ``pybullet``; of another one, that of its class."""
    if isinstance(world, WorldOptions):
        return world.kind
    return type(world).__name__


R = TypeVar("R", bound=Biped)


def robot_in(world: WorldOptions, robot: R) -> R:
    """The robot that is simulated: the controller's, or the world's own, with the world's gravity.

    A ParameterError if the world's robot has other joints or feet, or another base.
    """
    own = robot if world.robot is None else world.robot.load()
    if not isinstance(own, type(robot)):
        raise ParameterError(
            f"the robot of the world, {own.name}, has another base than {robot.name}: give both a"
            " floating one or none"
        )
    for name, one, other in (
        ("joints", robot.joint_names, own.joint_names),
        ("feet", robot.feet, own.feet),
    ):
        if one != other:
            raise ParameterError(
                f"the robot of the world has the {name} {', '.join(other)}: give one with"
                f" {', '.join(one)}, as {robot.name} has them"
            )
    gravity = world.gravity or (world.robot and world.robot.gravity) or robot.gravity
    return own if gravity == own.gravity else own.changed(gravity)


_PLANTS: dict[type, Any] = {
    IdealOptions: IdealPlant,
    MujocoOptions: MujocoPlant,
    PlantOptions: BulletPlant,
}
"""Plants by their options."""


@checked
def open_plant(robot: Biped, world: World) -> AbstractContextManager[Plant]:
    """Make the plant that options describe, to be used as a context manager.

    Args:
        robot: the controller's model; the plant makes its own robot from it.
        world: options, whose type chooses the plant; or a plant, which is used as it is and is
            left open.

    Raises:
        ParameterError: if the plant is for planar robots, and the robot has a floating base.
    """
    if not isinstance(world, WorldOptions):
        return nullcontext(world)
    made = next(plant for kind, plant in _PLANTS.items() if isinstance(world, kind))
    if made is IdealPlant and isinstance(robot, FloatingBaseBiped):
        raise ParameterError(
            f"{robot.name} has a floating base, and the plant is {plant_name(world)}: give"
            " PlantOptions or MujocoOptions"
        )
    return made(robot_in(world, robot), world)
