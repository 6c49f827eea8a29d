"""Runs of a robot that is held in its plane."""

from __future__ import annotations

from contextlib import AbstractContextManager
from math import atan2, degrees, radians

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import phase_control
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.references.apex_pose import ApexStart, apex_pose
from template_control.embedding.standing.pose import standing_pose
from template_control.errors import ParameterError
from template_control.estimation.delay import DelayCompensation
from template_control.estimation.imu import ImuOptions, ImuSensors
from template_control.plant.plant import Plant, World, open_plant
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import Pose, state_at_vlo, state_in
from template_control.run.kinds.kind import Kind
from template_control.run.options import Course, SimulationOptions
from template_control.run.recorder import Recorder
from template_control.run.sensing import ForeseeingSensors, Senses, Sensors
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.maps.section import APEX, REST
from template_control.slip.scenario.route import Route
from template_control.slip.similarity import Scale

Array = NDArray[np.float64]

# Of the ground that a walk starts on [rad]: steeper uphill the CoM does not come over the front
# foot before the centre of pressure has left the rear one.
_UPHILL = radians(4.1)


class Planar(Kind):
    """See :class:`~.kind.Kind`.

    Args:
        robot: that is run.
    """

    def __init__(self, robot: PlanarBiped) -> None:
        self.robot = robot

    def controller(
        self,
        planners: Planners | Planner,
        options: EmbeddingOptions,
        route: Route,
        automaton: Automaton,
    ) -> EmbeddingController:
        """See :meth:`.kind.Kind.controller`.

        Raises:
            ParameterError: if the options are those of a free robot.
        """
        if isinstance(options, FreeOptions):
            raise ParameterError(
                f"{self.robot.name} is held in its plane, and its embedding has FreeOptions: give"
                " EmbeddingOptions"
            )
        return EmbeddingController(self.robot, planners, options, route, automaton)

    def start(self, controller: EmbeddingController, o: SimulationOptions) -> tuple[Array, Array]:
        """See :meth:`.kind.Kind.start`; clear at VLO, at rest, and where legs take turns.

        Raises:
            ParameterError: as there, or if the options have a course or a push aside.
        """
        if o.course != Course():
            raise ParameterError(
                f"{self.robot.name} is held in its plane and has no course: leave it out, or take"
                " a free robot"
            )
        if any(push.direction for push in o.pushes):
            raise ParameterError(
                f"{self.robot.name} is held in its plane, and a push has a direction: leave it out,"
                " or take a free robot"
            )
        robot, route, pose = self.robot, controller.planning.route, o.pose
        first = planner, node = controller.planning.begin(route.section)
        z = route.start if o.start is None else np.array(o.start)
        if pose is None and route.section == APEX:
            pose = self._apex_pose(controller, z[: APEX.dimension], planner, node)
        if pose is None and route.section == REST:
            pose = self._standing_pose(controller, o)
        if pose is not None:
            q, v = state_in(robot, pose)
            controller.start(pose.rear, pose.swung, first=first)
            return q, v
        # Mid-swing: beside the stance foot, passing it at twice the CoM's speed.
        shape = controller.swings.towards(controller.planning.first_goal())
        swing = np.array([0.0, shape.clearance])
        pitch = controller.first_pitch()
        q, v = state_at_vlo(robot, z, 0, swing, np.array([2.0 * z[0], 0.0]), pitch)
        controller.start(first=first)
        return q, v

    def _apex_pose(
        self, controller: EmbeddingController, z: Array, planner: Planner, node: Node
    ) -> Pose:
        """The pose at an apex ``z`` (2,) in which the route's first gait has its feet."""
        o, pitch = controller.options, controller.first_pitch()
        swing = phase_control(o.phases, node).swing or controller.swings.other
        automaton = controller.planning.automaton
        return apex_pose(self.robot, ApexStart(z, planner.gait, swing, pitch, automaton))

    def _standing_pose(self, controller: EmbeddingController, o: SimulationOptions) -> Pose:
        """At rest on the ground of the plant.

        Raises:
            ParameterError: if it is steeper than a start can be made on.
        """
        pose = standing_pose(controller.planning.route.parameters, ground=o.plant.ground_height)
        (rear, low), (front, high) = pose.feet.tolist()
        slope, believed = atan2(high - low, front - rear), controller.options.slope.steepest
        if not -believed <= slope <= min(believed, _UPHILL):
            raise ParameterError(
                f"{self.robot.name} stands on ground of {degrees(slope):.1f} degrees: let the run"
                f" begin where it is between {-degrees(believed):.1f} and {degrees(_UPHILL):.1f}"
                " degrees"
            )
        return pose

    def plant(self, world: World) -> AbstractContextManager[Plant]:
        """See :meth:`.kind.Kind.plant`."""
        return open_plant(self.robot, world)

    def senses(self, controller: EmbeddingController, o: SimulationOptions) -> Senses:
        """See :meth:`.kind.Kind.senses`."""
        parameters = controller.parameters
        if isinstance(o.sensors, ImuOptions):
            return ImuSensors(o.sensors, self.robot, Scale.of(parameters), o.plant.time_step)
        delay = DelayCompensation(controller.options.delay, self.robot, o.plant.time_step)
        sensors = Sensors(o.sensors, self.robot, parameters.rest_length)
        return ForeseeingSensors(sensors, delay)

    def force(self, along: float, aside: float) -> tuple[float, ...]:
        """See :meth:`.kind.Kind.force`: what holds the robot bears the rest."""
        return (along,)

    def recorder(self, controller: EmbeddingController, every: int) -> Recorder:
        """See :meth:`.kind.Kind.recorder`."""
        return Recorder(controller, every)
