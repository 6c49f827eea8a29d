"""Start of a run: the robot's first state, by its base, motion and ground."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, degrees

import numpy as np

from template_control.arrays import Array
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.lateral import SIDES, LateralPlanner
from template_control.embedding.phases import phase_control
from template_control.embedding.planners.planner import Planner
from template_control.embedding.standing.curves import CLOSING, standing_pose
from template_control.errors import ParameterError
from template_control.estimation.slope import LEVEL, STEEPEST
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import Pose, floating_state_in, state_at_vlo, state_in
from template_control.robot.template import startable_slopes
from template_control.run.apex_pose import ApexStart, apex_pose
from template_control.run.experiment import Experiment, PreparedExperiment
from template_control.slip.automaton.hybrid import Node
from template_control.slip.lateral.gait import LateralWish
from template_control.slip.maps.section import APEX, REST, VLO


def start(controller: EmbeddingController, o: PreparedExperiment) -> tuple[Array, Array]:
    """Start the controller where the run begins; (q, v) there, or a ParameterError."""
    if isinstance(o.robot, FloatingBaseBiped):
        return _floating_start(o.robot, controller, o)
    assert isinstance(o.robot, PlanarBiped)
    return _planar_start(o.robot, controller, o)


def _apex_start(
    controller: EmbeddingController, z: Array, planner: Planner, node: Node
) -> ApexStart:
    """An apex ``z`` (2 or 3,), in which the route's first gait has its feet."""
    swing = phase_control(controller.options.phase_table(), node).swing or controller.swings.other
    pitch, automaton = controller.first_pitch(), controller.supervisor.automaton
    return ApexStart(z[: APEX.dimension], planner.gait, swing, pitch, automaton)


def _planar_start(
    robot: PlanarBiped, controller: EmbeddingController, o: PreparedExperiment
) -> tuple[Array, Array]:
    """At VLO, at an apex, at rest, or in the pose that is given."""
    route, pose = controller.supervisor.route, o.pose
    controller.course = o.heading
    first = controller.supervisor.begin(route.section)
    z = route.start if o.start is None else np.array(o.start)
    if pose is None and route.section == APEX:
        pose = apex_pose(robot, _apex_start(controller, z, *first))
    if pose is None and route.section == REST:
        pose = _standing_pose(robot, controller, o)
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


def _standing_pose(robot: PlanarBiped, controller: EmbeddingController, o: Experiment) -> Pose:
    """At rest on the ground of the plant; a ParameterError if it is too steep for a start."""
    pose = standing_pose(controller.supervisor.route.parameters, ground=o.world.ground_height)
    (rear, low), (front, high) = pose.feet.tolist()
    slope, (down, up) = atan2(high - low, front - rear), startable_slopes(robot)
    down, up = min(max(down, -STEEPEST), -LEVEL), max(min(up, STEEPEST), LEVEL)
    if not down <= slope <= up:
        raise ParameterError(
            f"{robot.name} stands on ground of {degrees(slope):.1f} degrees: let the run"
            f" begin where it is between {degrees(down):.1f} and {degrees(up):.1f} degrees"
        )
    return pose


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


def _floating_start(
    robot: FloatingBaseBiped, controller: EmbeddingController, o: PreparedExperiment
) -> tuple[Array, Array]:
    """In the gait's sway, or at rest on feet that bear."""
    route, motion = controller.supervisor.route, controller.lateral
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
            pose = _apex_pose(robot, lateral, _apex_start(controller, z, *first))
        else:
            pose = _passing(lateral, z, controller)
    q, v = floating_state_in(robot, pose)
    controller.start(pose.rear, pose.swung, first=first)
    return q, v


def _apex_pose(robot: FloatingBaseBiped, lateral: LateralPlanner, apex: ApexStart) -> Pose:
    """The planar pose at an apex, its front foot the last that stood, in the gait's sway."""
    row = SIDES[1 - _REAR].row
    (away, drift), step = lateral.cycle.states[row], lateral.cycle.steps[row]
    foothold = -0.5 * step
    lateral_parts = {
        "com": foothold + away,
        "com_velocity": drift,
        "feet": [foothold + step, foothold],
        "feet_velocity": 0.0,
    }

    def lifted(pose: Pose) -> Pose:
        parts = {k: np.insert(getattr(pose, k), 1, y, -1) for k, y in lateral_parts.items()}
        return replace(pose, **parts)

    return lifted(apex_pose(robot, apex, lambda r, pose: floating_state_in(r, lifted(pose))))
