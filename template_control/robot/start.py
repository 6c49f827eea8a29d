"""The robot's state where a run begins: CoM, trunk and feet as wanted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Pair, Range, Shape, Triple
from template_control.errors import RobotError
from template_control.robot.biped import bent_to
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.requirements import BASE_DOF

Array = NDArray[np.float64]

_SHORT = 0.15  # of a step of Newton's method [rad]
_OUTPUTS = 7  # CoM (2), trunk (1), both feet (4)


@dataclass(frozen=True)
class Pose(Checked):
    """Where the CoM and the feet are, and how they move.

    Attributes:
        com, com_velocity: (2,) of the CoM [m, m/s].
        feet: (2, 2) lowest points of rear and front foot [m].
        feet_velocity: (2, 2) [m/s].
        rear: the foot that is the rear leg's.
        swung: time since rear and front foot left the ground [s]; None: they are in the middle of
            their swings, if they swing.
        pitch: of the trunk [rad].
        angular_momentum: about the CoM [N m s]; the trunk turns so that the robot has it. None: the
            trunk is at rest.
        momentum_speed: dx/dt of the CoM is meant to include the angular momentum about the
            CoM: it is the momentum about the foot below, over m y.
    """

    com: Pair
    com_velocity: Pair
    feet: Annotated[Array, Shape((2, 2))]
    feet_velocity: Annotated[Array, Shape((2, 2))]
    rear: Annotated[int, Range(0, 1)] = 0
    swung: tuple[NotNegative, NotNegative] | None = None
    pitch: float = 0.0
    angular_momentum: float | None = None
    momentum_speed: bool = False


@checked
def state_in(robot: PlanarBiped, pose: Pose) -> tuple[Array, Array]:
    """State of a robot whose CoM and feet are in a pose.

    Args:
        robot: the model; its last update is overwritten.
        pose: what is wanted.

    Returns:
        (nv,) configuration q [m, rad]; (nv,) velocity v [m/s, rad/s].

    Raises:
        RobotError: if the legs do not reach, or joints would be beyond their limits.
    """
    # From far away Newton's full step may bend a knee the wrong way; short ones do not.
    q = bent_to(
        robot,
        lambda q, longest: _configuration(robot, pose, q, longest),
        (np.inf, _SHORT),
        pose.com[1],
    )
    robot.update(q, np.zeros(robot.nv))
    return q, _velocity(robot, pose, q)


def _configuration(robot: PlanarBiped, pose: Pose, q: Array, longest: float) -> Array | None:
    """(nv,) q of a pose, None where it is not found.

    Args:
        robot: the model; its last update is overwritten.
        pose: what is wanted.
        q: (nv,) bent legs, from which the search begins; changed.
        longest: step of Newton's method, the largest change of any joint [rad].
    """
    stance, swing = pose.rear, 1 - pose.rear
    q[:BASE_DOF] = pose.com[0], 0.8 * pose.com[1], pose.pitch
    zero = np.zeros(robot.nv)

    def residual() -> Array:
        return np.concatenate(
            (
                robot.com - pose.com,
                [q[2] - pose.pitch],
                robot.foot_position[stance] - pose.feet[0],
                robot.foot_position[swing] - pose.feet[1],
            )
        )

    def jacobian() -> Array:
        rows = np.zeros((_OUTPUTS, robot.nv))
        rows[0:2] = robot.com_jacobian
        rows[2, 2] = 1.0
        for i, foot in enumerate((stance, swing)):
            rows[3 + 2 * i : 5 + 2 * i] = robot.foot_jacobian[foot]
            # The lowest point's path, not that of the material point which touches there.
            rows[3 + 2 * i] += robot.foot_radius * robot.foot_turning[foot]
        return rows

    for _ in range(50):
        robot.update(q, zero)
        error = residual()
        if np.max(np.abs(error)) < 1e-12:
            return q
        step = _solved(robot, jacobian(), error)
        q -= step * min(1.0, longest / np.max(np.abs(step)))
    return None


def _velocity(robot: PlanarBiped, pose: Pose, q: Array) -> Array:
    """(nv,) v of a pose at its configuration ``q``; the robot is updated to both."""
    stance, swing = pose.rear, 1 - pose.rear
    rows = np.zeros((_OUTPUTS, robot.nv))
    rows[0:2] = robot.com_jacobian
    if pose.momentum_speed:
        rows[0] += _angular_momentum_row(robot, q) / (robot.mass * pose.com[1])
    if pose.angular_momentum is None:
        rows[2, 2] = 1.0
    else:
        rows[2] = _angular_momentum_row(robot, q)
    rows[3:5] = robot.foot_jacobian[stance]
    rows[5:7] = robot.foot_jacobian[swing]
    wanted = [*pose.com_velocity, pose.angular_momentum or 0.0, *pose.feet_velocity.ravel()]
    v = _solved(robot, rows, np.array(wanted))
    robot.update(q, v)
    return v


@checked
def state_at_vlo(
    robot: PlanarBiped,
    z: Triple,
    stance: Annotated[int, Range(0, 1)],
    swing_position: Pair,
    swing_velocity: Pair,
    pitch: float = 0.0,
) -> tuple[Array, Array]:
    """State of a robot at VLO, with the stance foot at x = 0.

    Args:
        robot: the model; its last update is overwritten.
        z: (3,) dx/dt, y, dy/dt [m/s, m, m/s]; dx/dt is the angular momentum about the foot over
            m y.
        stance: index of the stance foot.
        swing_position, swing_velocity: (2,) of the swing foot [m, m/s].
        pitch: of the trunk, at rest [rad].

    Returns:
        q and v as of :func:`state_in`.

    Raises:
        RobotError: as :func:`state_in`.
    """
    pose = Pose(
        com=np.array([0.0, z[1]]),
        com_velocity=np.array([z[0], z[2]]),
        feet=np.array([np.zeros(2), swing_position]),
        feet_velocity=np.array([np.zeros(2), swing_velocity]),
        rear=stance,
        pitch=pitch,
        momentum_speed=True,
    )
    return state_in(robot, pose)


def _solved(robot: PlanarBiped, matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise RobotError(f"{robot.name}: the legs do not determine the pose; bend them") from None


def _angular_momentum_row(robot: PlanarBiped, q: Array) -> Array:
    """(nv,) row that maps v to the angular momentum about the CoM; it is linear in v."""
    row = np.zeros(robot.nv)
    for i, unit in enumerate(np.eye(robot.nv)):
        robot.update(q, unit)
        row[i] = robot.angular_momentum
    robot.update(q, np.zeros(robot.nv))
    return row
