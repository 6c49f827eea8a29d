"""A free biped in MuJoCo: its trunk has a free joint, and only joint torques drive it."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.plant.mjcf import (
    FOOT,
    TRUNK,
    add,
    add_ball,
    losses,
    place,
    text,
    world_element,
)
from template_control.plant.mujoco import MujocoOptions, MujocoPlant
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.legs import foot_frame
from template_control.robot.terms import FLOATING_DOF

Array = NDArray[np.float64]

_POSITION = FLOATING_DOF + 1
_ROOT = 1  # Pinocchio's index of the free flyer


class FreeMujocoPlant(MujocoPlant):
    """As :class:`~template_control.plant.mujoco.MujocoPlant`, for a robot that nothing holds.

    MuJoCo has the trunk's velocity in the world and its angular velocity in the trunk's axes, and
    quaternions begin with w.

    Args:
        robot: whose model to write as MJCF, and whose joint order to speak.
        options: friction, time step, mass error, contacts, step of the ground.

    Raises:
        ParameterError: if MuJoCo is not installed.
        RobotError: if MuJoCo does not take the model, or makes another robot of it.
    """

    def __init__(self, robot: FloatingBaseBiped, options: MujocoOptions) -> None:
        super().__init__(robot, options)

    def _text(self, robot: Biped) -> str:
        root, ground = world_element(robot, self.options, self.options.contact_time)
        model, scale = robot.model, self.options.mass_scale
        # MuJoCo weighs a contact's give by the robot's pose with all joints at their `ref`.
        data, neutral = model.createData(), robot.neutral()
        axes = pin.computeJointJacobians(model, data, neutral)
        bodies = {0: ground}
        for joint in range(_ROOT, model.njoints):
            name = TRUNK if joint == _ROOT else f"{model.names[joint]} link"
            parent = bodies[model.parents[joint]]
            body = add(parent, "body", name=name, **place(data.liMi[joint]))
            if joint == _ROOT:
                add(body, "freejoint", name=TRUNK)
            else:
                axis = data.oMi[joint].rotation.T @ axes[3:, model.idx_vs[joint]]
                about = {"axis": text(axis), "ref": repr(float(neutral[model.idx_qs[joint]]))}
                about |= losses(robot, joint - 1 - _ROOT, self.options.time_step)
                add(body, "joint", name=model.names[joint], type="hinge", **about)
            inertia = model.inertias[joint]
            i = scale * inertia.inertia
            add(
                body,
                "inertial",
                mass=repr(float(scale * inertia.mass)),
                pos=text(inertia.lever),
                fullinertia=text((i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])),
            )
            bodies[joint] = body
        for number, foot in enumerate(robot.feet):
            frame = model.frames[foot_frame(model, foot)]
            centre = text(frame.placement.translation)
            add_ball(bodies[frame.parentJoint], f"{FOOT}{number}", centre, robot.foot_radius)
        return ElementTree.tostring(root, encoding="unicode")

    def _told(self, robot: Biped) -> int:
        return len(robot.joint_names)

    def step(self, torque: Array, push: float = 0.0, aside: float = 0.0) -> None:
        """See :meth:`~template_control.plant.plant.Plant.step`.

        Args:
            torque: (nu,) joint torques [N m].
            push, aside: disturbance on the trunk's centre of mass along the world's x and y [N].
        """
        self.data.xfrc_applied[self._trunk, 1] = aside
        super().step(torque, push)

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~template_control.plant.plant.Plant.reset`."""
        super().reset(q[_POSITION:], v[FLOATING_DOF:])
        rotation = pin.Quaternion(q[3:_POSITION]).matrix()
        self.data.qpos[:3], self.data.qpos[3:7] = q[:3], q[[6, 3, 4, 5]]
        self.data.qvel[:3], self.data.qvel[3:6] = rotation @ v[:3], v[3:FLOATING_DOF]

    def read(self, q: Array, v: Array) -> None:
        """See :meth:`~template_control.plant.plant.Plant.read`."""
        super().read(q[_POSITION:], v[FLOATING_DOF:])
        q[:3], q[3:_POSITION] = self.data.qpos[:3], self.data.qpos[[4, 5, 6, 3]]
        rotation = pin.Quaternion(q[3:_POSITION]).matrix()
        v[:3], v[3:FLOATING_DOF] = rotation.T @ self.data.qvel[:3], self.data.qvel[3:6]
