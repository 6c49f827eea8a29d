"""Backends of a run: what differs between planar and floating-base robots."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from math import atan2, cos, degrees, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from template_control.arrays import Array
from template_control.embedding.apex_pose import ApexStart, apex_pose
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.lateral import SIDES, LateralPlanner
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.ground import LEVEL, STEEPEST
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import phase_control
from template_control.embedding.planners.planner import Planner
from template_control.embedding.robot_template import startable_slopes
from template_control.embedding.standing.curves import CLOSING, standing_pose
from template_control.errors import ParameterError
from template_control.estimation.delay import DelayCompensation
from template_control.estimation.filters import NoiseFilter
from template_control.estimation.imu import ImuOptions, ImuSensors
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import (
    Pose,
    floating_state_in,
    state_at_vlo,
    state_in,
)
from template_control.run.experiment import Experiment, PreparedExperiment
from template_control.run.sensing import (
    FilteredSensors,
    ForeseeingSensors,
    Senses,
    Sensors,
)
from template_control.slip.automaton.hybrid import Node
from template_control.slip.lateral.gait import LateralWish
from template_control.slip.maps.section import APEX, REST, VLO
from template_control.slip.similarity import Scale


class RobotBackend(ABC):
    """Backend of one kind of robot; a robot comes with it."""

    def __init__(self, robot: Any) -> None:
        self.robot = robot

    @abstractmethod
    def start(self, controller: EmbeddingController, o: PreparedExperiment) -> tuple[Array, Array]:
        """Start the controller where the run begins; (q, v) there, or a ParameterError."""

    def senses(self, controller: EmbeddingController, o: Experiment) -> Senses:
        """Sensors and estimators that give the controller its state."""
        template, dt = controller.parameters, o.world.time_step
        if isinstance(o.sensors, ImuOptions):
            # On a model of its own: the controller's may be turned.
            return ImuSensors(o.sensors, self.robot.changed(), Scale.of(template), dt)
        return self._refined(Sensors(o.sensors, self.robot, template), controller.options, dt)

    @abstractmethod
    def _refined(self, sensors: Sensors, options: EmbeddingOptions, dt: float) -> Senses:
        """The sensors, and what the controller makes of them."""

    @abstractmethod
    def force(self, along: float, lateral: float) -> tuple[float, ...]:
        """A push, forward and to the left [N], as the robot's plant takes it after the torques."""


def _apex_start(
    controller: EmbeddingController, z: Array, planner: Planner, node: Node
) -> ApexStart:
    """An apex ``z`` (2 or 3,), in which the route's first gait has its feet."""
    swing = phase_control(controller.options.phases, node).swing or controller.swings.other
    pitch, automaton = controller.first_pitch(), controller.supervisor.automaton
    return ApexStart(z[: APEX.dimension], planner.gait, swing, pitch, automaton)


class PlanarBackend(RobotBackend):
    """See :class:`RobotBackend`."""

    robot: PlanarBiped

    def start(self, controller: EmbeddingController, o: PreparedExperiment) -> tuple[Array, Array]:
        """See :meth:`RobotBackend.start`; clear at VLO, at rest, and where legs take turns."""
        robot, route, pose = self.robot, controller.supervisor.route, o.pose
        controller.course = o.heading
        first = controller.supervisor.begin(route.section)
        z = route.start if o.start is None else np.array(o.start)
        if pose is None and route.section == APEX:
            pose = apex_pose(robot, _apex_start(controller, z, *first))
        if pose is None and route.section == REST:
            pose = self._standing_pose(controller, o)
        if pose is not None:
            q, v = state_in(robot, pose)
            controller.start(pose.rear, pose.swung, first=first)
            return q, v
        # Mid-swing: next to the stance foot, passing it at twice the CoM's speed.
        shape = controller.swings.towards(controller.supervisor.first_goal())
        swing = np.array([0.0, shape.clearance])
        pitch = controller.first_pitch()
        q, v = state_at_vlo(robot, z, 0, swing, np.array([2.0 * z[0], 0.0]), pitch)
        controller.start(first=first)
        return q, v

    def _standing_pose(self, controller: EmbeddingController, o: Experiment) -> Pose:
        """At rest on the ground of the plant; a ParameterError if it is too steep for a start."""
        pose = standing_pose(controller.supervisor.route.parameters, ground=o.world.ground_height)
        (rear, low), (front, high) = pose.feet.tolist()
        slope, (down, up) = atan2(high - low, front - rear), startable_slopes(self.robot)
        down, up = min(max(down, -STEEPEST), -LEVEL), max(min(up, STEEPEST), LEVEL)
        if not down <= slope <= up:
            raise ParameterError(
                f"{self.robot.name} stands on ground of {degrees(slope):.1f} degrees: let the run"
                f" begin where it is between {degrees(down):.1f} and {degrees(up):.1f} degrees"
            )
        return pose

    def _refined(self, sensors: Sensors, options: EmbeddingOptions, dt: float) -> Senses:
        return ForeseeingSensors(sensors, DelayCompensation(options.delay, self.robot, dt))

    def force(self, along: float, lateral: float) -> tuple[float, ...]:
        """See :meth:`RobotBackend.force`: what holds the robot bears the rest."""
        return (along,)


_REAR = 0  # the left foot stands where a run begins


def _stand(z: Array, width: float, apart: float) -> Pose:
    """At rest on both feet, ``width`` [m] apart, the front one ``apart`` [m] ahead; ``z`` (3,)."""
    feet = np.zeros((2, 3))
    feet[:, 0] = apart * np.array([-0.5, 0.5])
    feet[:, 1] = 0.5 * width * np.array(SIDES)
    com = np.array([0.0, 0.0, z[1]])
    return Pose(com, np.zeros(3), feet, np.zeros((2, 3)), _REAR, momentum_speed=True)


def _passing(lateral: LateralPlanner, z: Array, controller: EmbeddingController) -> Pose:
    """Mid-swing: the other foot passes the stance foot at twice the CoM's speed; ``z`` (3,)."""
    side, (away, drift) = 0.5 * lateral.wish.width, lateral.cycle.states[SIDES[_REAR].row]
    return Pose(
        com=np.array([0.0, side + away, z[1]]),
        com_velocity=np.array([z[0], drift, z[2]]),
        feet=np.array([[0.0, side, 0.0], [0.0, -side, controller.swings.other.clearance]]),
        feet_velocity=np.array([[0.0, 0.0, 0.0], [2.0 * z[0], 0.0, 0.0]]),
        rear=_REAR,
        pitch=controller.first_pitch(),
        momentum_speed=True,
    )


class FloatingBackend(RobotBackend):
    """See :class:`RobotBackend`."""

    robot: FloatingBaseBiped

    def start(self, controller: EmbeddingController, o: PreparedExperiment) -> tuple[Array, Array]:
        """See :meth:`RobotBackend.start`: in the gait's sway, or at rest on feet that bear."""
        robot, route, motion = self.robot, controller.supervisor.route, controller.lateral
        assert motion is not None
        if o.pose is not None:
            raise ParameterError(
                f"{robot.name} has a floating base, and the run a pose of the plane: leave it out"
            )
        if route.section is REST and not robot.half_length:
            raise ParameterError(
                f"{robot.name} cannot stand on two feet that are points: let its run begin at"
                " VLO or an apex"
            )
        z = route.start if o.start is None else np.array(o.start)
        first = controller.supervisor.begin(route.section)
        planner, lateral = first[0], motion.planner
        controller.course = o.heading
        if route.section is REST:
            apart = CLOSING * route.parameters.rest_length if robot.patches else 0.0
            lateral.wish = LateralWish(motion.step_width)
            pose = _stand(z, motion.stand_width, apart)
        else:
            side_speed, rate, _ = o.heading(0.0)
            lateral.wish = LateralWish(
                o.course.step_width or motion.step_width,
                left=side_speed * planner.gait.step_duration,
                # A run leans into its turns by and by.
                turn=rate * planner.gait.step_duration if route.section == VLO else 0.0,
            )
            lateral.reset(planner.gait)
            if route.section == APEX:
                pose = self._apex_pose(lateral, _apex_start(controller, z, *first))
            else:
                pose = _passing(lateral, z, controller)
        q, v = floating_state_in(robot, pose)
        controller.start(pose.rear, pose.swung, first=first)
        return q, v

    def _apex_pose(self, lateral: LateralPlanner, start: ApexStart) -> Pose:
        """The planar pose at an apex, its front foot the last that stood, in the gait's sway."""
        stood = SIDES[1 - _REAR]
        away, drift = lateral.cycle.states[stood.row]
        foothold = -0.5 * lateral.cycle.steps[stood.row]
        y = [foothold + lateral.cycle.steps[stood.row], foothold]

        def lifted(pose: Pose) -> Pose:
            def in_space(points: Array, y: ArrayLike) -> Array:
                return np.insert(points, 1, y, axis=-1)

            return replace(
                pose,
                com=in_space(pose.com, foothold + away),
                com_velocity=in_space(pose.com_velocity, drift),
                feet=in_space(pose.feet, y),
                feet_velocity=in_space(pose.feet_velocity, 0.0),
            )

        return lifted(
            apex_pose(self.robot, start, lambda r, pose: floating_state_in(r, lifted(pose)))
        )

    def _refined(self, sensors: Sensors, options: EmbeddingOptions, dt: float) -> Senses:
        tuning = options.noise_filter if isinstance(options, FreeOptions) else None
        if sensors.exact or tuning is None:
            return sensors
        noise_filter = NoiseFilter(self.robot, np.array(sensors.deviations), tuning)
        return FilteredSensors(sensors, noise_filter, dt)

    def force(self, along: float, lateral: float) -> tuple[float, ...]:
        """See :meth:`RobotBackend.force`: along the world's x and y; forward is the heading."""
        cosine, sine = cos(self.robot.heading), sin(self.robot.heading)
        return cosine * along - sine * lateral, sine * along + cosine * lateral
