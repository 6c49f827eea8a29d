"""The state in which a free biped begins: CoM, trunk and feet as wanted, in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Range, Shape, Triple
from template_control.errors import RobotError
from template_control.robot.biped import bent_to, foot_frame
from template_control.robot.free.free_biped import FreeBiped

Array = NDArray[np.float64]

_LONGEST = 0.2  # step of Newton's method [rad, m]
_EXACT = 1e-12  # [m, rad]


@dataclass(frozen=True)
class FreePose(Checked):
    """Where the CoM and the feet are, and how they move; in the heading frame, trunk upright.

    Attributes:
        com: (3,) of the CoM [m].
        com_velocity: (3,) m/s; with the angular momentum about the CoM, as if it moved the CoM:
            m z times it is the momentum about the point on the ground below.
        feet: (2, 3) lowest points of rear and front foot [m].
        feet_velocity: (2, 3) [m/s].
        rear: the foot that is the rear leg's.
        pitch: of the trunk, at rest [rad].
    """

    com: Triple
    com_velocity: Triple
    feet: Annotated[Array, Shape((2, 3))]
    feet_velocity: Annotated[Array, Shape((2, 3))]
    rear: Annotated[int, Range(0, 1)] = 0
    pitch: float = 0.0


@checked
def free_state_in(robot: FreeBiped, pose: FreePose) -> tuple[Array, Array]:
    """State of a free biped whose CoM and feet are in a pose.

    Args:
        robot: the model; its last update is overwritten, and the robot faces along the world's x.
        pose: what is wanted.

    Returns:
        (nq,) configuration q; (nv,) velocity v.

    Raises:
        RobotError: if the legs do not reach, or joints would be beyond their limits.
    """
    robot.face(0.0, np.zeros(2))
    q = bent_to(
        robot, lambda q, longest: _configuration(robot, pose, q, longest), (_LONGEST,), pose.com[2]
    )
    robot.update(q, np.zeros(robot.nv))
    rows, feet = _rows(robot), [pose.rear, 1 - pose.rear]
    weight = robot.mass * pose.com[2]
    rows[0] += robot.space.momentum_jacobian[1] / weight
    rows[1] -= robot.space.momentum_jacobian[0] / weight
    wanted = np.zeros(len(rows))
    wanted[:3] = pose.com_velocity
    for foot, velocity in zip(feet, pose.feet_velocity, strict=True):
        wanted[6 + 3 * foot : 9 + 3 * foot] = velocity
    v = _solved(robot, rows, wanted)
    robot.update(q, v)
    return q, v


def _configuration(robot: FreeBiped, pose: FreePose, q: Array, longest: float) -> Array | None:
    """(nq,) q of a pose, None where it is not found.

    Args:
        robot: the model; its last update is overwritten.
        pose: what is wanted.
        q: (nq,) bent legs, from which the search begins.
        longest: step of Newton's method, the largest change of any coordinate [rad, m].
    """
    q[:3] = pose.com[0], pose.com[1], 0.9 * pose.com[2]
    rest = np.zeros(robot.nv)
    upright = pin.rpy.rpyToMatrix(0.0, pose.pitch, 0.0)
    feet = np.empty((2, 3))
    feet[[pose.rear, 1 - pose.rear]] = pose.feet
    for _ in range(100):
        robot.update(q, rest)
        turn = pin.log3(robot.rotation @ upright.T)
        away = (robot.space.com - pose.com, turn, (robot.space.foot - feet).ravel())
        error = np.concatenate(away)
        if np.max(np.abs(error)) < _EXACT:
            return q
        rows = _rows(robot)
        # The lowest point's path, not that of the material point which touches there.
        jacobian, r = rows.copy(), robot.foot_radius
        for foot in range(2):
            turning = _foot_turning(robot, q, foot)
            jacobian[6 + 3 * foot] += r * turning[1]
            jacobian[7 + 3 * foot] -= r * turning[0]
        step = _solved(robot, jacobian, -error)
        q = pin.integrate(robot.model, q, step * min(1.0, longest / np.max(np.abs(step))))
    return None


def _rows(robot: FreeBiped) -> Array:
    """(12, nv) Jacobians of the CoM, the trunk's turning and both feet."""
    s = robot.space
    feet = s.foot_jacobian.reshape(-1, robot.nv)
    return np.concatenate((s.com_jacobian, s.turning_jacobian, feet))


def _foot_turning(robot: FreeBiped, q: Array, foot: int) -> Array:
    """(3, nv) Jacobian of a foot's angular velocity, in the world's axes."""
    data = robot.model.createData()
    frame = foot_frame(robot.model, robot.feet[foot])
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.asarray(pin.computeFrameJacobian(robot.model, data, q, frame, world)[3:])


def _solved(robot: FreeBiped, matrix: Array, right: Array) -> Array:
    """The smallest solution: a leg may have a joint to spare.

    Raises:
        RobotError: if the legs do not determine the pose.
    """
    solution, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=None)
    if rank < len(matrix):
        raise RobotError(f"{robot.name}: the legs do not determine the pose; bend them")
    return np.asarray(solution)
