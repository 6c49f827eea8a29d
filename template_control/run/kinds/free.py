"""Runs of a robot that nothing holds."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.controller import FreeController
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.free.sideways import SIDES
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.planner import Planner, Planners
from template_control.errors import ParameterError
from template_control.estimation.noise_filter import NoiseFilter
from template_control.plant.bullet import PlantOptions
from template_control.plant.free.bullet import FreeBulletPlant
from template_control.plant.free.mujoco import FreeMujocoPlant
from template_control.plant.mujoco import MujocoOptions
from template_control.plant.plant import Plant, World, plant_name
from template_control.robot.free.free_biped import FreeBiped
from template_control.robot.free.start import FreePose, free_state_in
from template_control.run.kinds.free_recorder import FreeRecorder
from template_control.run.kinds.free_sensors import FilteredSensors
from template_control.run.kinds.kind import Kind
from template_control.run.options import SimulationOptions
from template_control.run.recorder import Recorder
from template_control.run.sensing import Senses, SensorOptions, Sensors
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.lateral.gait import LateralWish
from template_control.slip.maps.section import VLO
from template_control.slip.scenario.route import Route

Array = NDArray[np.float64]

_REAR = 0  # the left foot stands where a run begins


class Free(Kind):
    """See :class:`~.kind.Kind`.

    Args:
        robot: that is run.
    """

    def __init__(self, robot: FreeBiped) -> None:
        self.robot = robot

    def controller(
        self,
        planners: Planners | Planner,
        options: EmbeddingOptions,
        route: Route,
        automaton: Automaton,
    ) -> FreeController:
        """See :meth:`.kind.Kind.controller`.

        Raises:
            ParameterError: if the options are those of a planar robot.
        """
        if not isinstance(options, FreeOptions):
            raise ParameterError(
                f"{self.robot.name} walks free, and its embedding has EmbeddingOptions: give"
                " FreeOptions"
            )
        return FreeController(self.robot, planners, options, route, automaton)

    def start(self, controller: EmbeddingController, o: SimulationOptions) -> tuple[Array, Array]:
        """See :meth:`.kind.Kind.start`: at VLO, in the sideways motion of the gait.

        Raises:
            ParameterError: if the run begins elsewhere, or the options have a planar pose.
        """
        route = controller.planning.route
        if o.pose is not None or route.section != VLO or not isinstance(controller, FreeController):
            raise ParameterError(
                f"{self.robot.name} walks free: its run begins at VLO, without a pose"
            )
        z = route.start if o.start is None else np.array(o.start)
        planner, node = controller.planning.begin(VLO)
        sideways, course = controller.sideways, o.course
        sideways.wish = LateralWish(
            course.step_width or sideways.wish.width,
            turn=course.rate(0.0) * planner.gait.step_duration,
        )
        controller.turning = course.rate
        sideways.reset(planner.gait)
        away, drift = sideways.cycle.states[SIDES[_REAR].row]
        width = sideways.wish.width
        # Mid-swing: the other foot passes the stance foot at twice the CoM's speed.
        pose = FreePose(
            com=np.array([0.0, 0.5 * width + away, z[1]]),
            com_velocity=np.array([z[0], drift, z[2]]),
            feet=np.array(
                [[0.0, 0.5 * width, 0.0], [0.0, -0.5 * width, controller.swings.other.clearance]]
            ),
            feet_velocity=np.array([[0.0, 0.0, 0.0], [2.0 * z[0], 0.0, 0.0]]),
            rear=_REAR,
            pitch=controller.first_pitch(),
        )
        q, v = free_state_in(self.robot, pose)
        controller.start(_REAR, first=(planner, node))
        return q, v

    def plant(self, world: World) -> AbstractContextManager[Plant]:
        """See :meth:`.kind.Kind.plant`.

        Raises:
            ParameterError: if the world knows no free robot.
        """
        if isinstance(world, Plant) and not isinstance(world, PlantOptions):
            return nullcontext(world)
        if isinstance(world, MujocoOptions):
            return FreeMujocoPlant(self.robot, world)
        if isinstance(world, PlantOptions):
            return FreeBulletPlant(self.robot, world)
        raise ParameterError(
            f"{self.robot.name} walks free in PyBullet and MuJoCo, and the plant is"
            f" {plant_name(world)}: give PlantOptions or MujocoOptions"
        )

    def senses(self, controller: EmbeddingController, o: SimulationOptions) -> Senses:
        """See :meth:`.kind.Kind.senses`; noise is filtered.

        Raises:
            ParameterError: if the state is to be estimated.
        """
        if not isinstance(o.sensors, SensorOptions):
            raise ParameterError(
                f"{self.robot.name} walks free, and the estimate is that of a planar robot: give"
                " SensorOptions"
            )
        sensors = Sensors(o.sensors, self.robot, controller.parameters.rest_length)
        tuning = controller.options.noise_filter if isinstance(controller, FreeController) else None
        if sensors.exact or tuning is None:
            return sensors
        deviation = np.array([o.sensors.position_noise, o.sensors.velocity_noise])
        return FilteredSensors(
            sensors, NoiseFilter(self.robot, deviation, tuning), o.plant.time_step
        )

    def force(self, along: float, aside: float) -> tuple[float, ...]:
        """See :meth:`.kind.Kind.force`: along the world's x and y; forward is the heading."""
        cosine, sine = cos(self.robot.heading), sin(self.robot.heading)
        return cosine * along - sine * aside, sine * along + cosine * aside

    def recorder(self, controller: EmbeddingController, every: int) -> Recorder:
        """See :meth:`.kind.Kind.recorder`."""
        return FreeRecorder(controller, every)
