"""Tasks of any Pinocchio robot: frames and joints follow a target that the task itself keeps."""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import NotNegative, Triple, Vector
from template_control.errors import ParameterError
from template_control.robot.robot import Robot
from template_control.whole_body.task import Rows

_GAINS = (100.0, 20.0)  # kp [1/s^2] and kd [1/s]: critically damped, 0.1 s


class FrameTask:
    """Three rows: the origin p of a frame towards its target r, in the world's axes.

        J a + dJ/dt v = r'' + kp (r - p) + kd (r' - p')

    Args:
        frame: name of a frame of the robot's model.
        weight: of each row [s^4/m^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    @checked
    def __init__(
        self,
        frame: str,
        weight: NotNegative = 1.0,
        gains: tuple[NotNegative, NotNegative] = _GAINS,
    ) -> None:
        self.frame, self.gains, self.weights = frame, gains, (weight,) * 3
        self._target: Array | None = None

    @checked
    def set_target(
        self, position: Triple, velocity: Triple | None = None, acceleration: Triple | None = None
    ) -> None:
        """Where the frame's origin is to be, in the world.

        Args:
            position: (3,) [m].
            velocity: (3,) of the target [m/s]; None: it rests.
            acceleration: (3,) of the target [m/s^2]; None: 0.
        """
        rest = np.zeros(3)
        moving = rest if velocity is None else velocity
        self._target = np.stack([position, moving, rest if acceleration is None else acceleration])

    def write(self, robot: Robot, references: Any, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`; a ParameterError before :meth:`set_target`."""
        if self._target is None:
            raise ParameterError(f"the FrameTask of {self.frame!r} has no target: call set_target")
        now, (place, velocity, acceleration) = robot.frame(self.frame), self._target
        rows.jacobian[:], rows.bias[:] = now.jacobian, now.bias
        pull = self.gains[0] * (place - now.position) + self.gains[1] * (velocity - now.velocity)
        rows.desired[:] = acceleration + pull


class JointTask:
    """A row for each actuated joint: q'' = kp (r - q) + kd (r' - q'), r the target.

    Args:
        target: (nu,) in the order of the robot's ``joint_names`` [rad].
        weight: of each row [s^4/rad^2].
        gains: kp [1/s^2] and kd [1/s].
    """

    @checked
    def __init__(
        self,
        target: Vector,
        weight: NotNegative = 1.0,
        gains: tuple[NotNegative, NotNegative] = _GAINS,
    ) -> None:
        self.gains, self.weights = gains, (weight,) * len(target)
        self.set_target(target)

    @checked
    def set_target(self, angle: Vector, velocity: Vector | None = None) -> None:
        """Where the joints are to be.

        Args:
            angle: (nu,) [rad].
            velocity: (nu,) of the target [rad/s]; None: it rests.
        """
        count, moving = len(self.weights), np.zeros(len(angle)) if velocity is None else velocity
        for name, numbers in (("target", angle), ("target's velocity", moving)):
            if len(numbers) != count:
                raise ParameterError(
                    f"the JointTask's {name} has {len(numbers)} numbers: give {count}"
                )
        self._target = np.stack([angle, moving])

    def write(self, robot: Robot, references: Any, rows: Rows) -> None:
        """See :meth:`~.task.Task.write`."""
        if len(self.weights) != len(robot.joint_names):
            raise ParameterError(
                f"the JointTask has {len(self.weights)} angles and {robot.name} has"
                f" {len(robot.joint_names)} joints: give one for each"
            )
        angle, velocity = self._target
        rows.jacobian[:, robot.base_dof :] = np.eye(len(angle))
        pull = self.gains[0] * (angle - robot.joint_angle)
        rows.desired[:] = pull + self.gains[1] * (velocity - robot.joint_velocity)
