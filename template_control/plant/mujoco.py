"""MuJoCo plant: a second physics engine, driven by joint torques and nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Positive
from template_control.errors import ParameterError, RobotError
from template_control.plant.agreement import check_mass_matrix
from template_control.plant.bullet import PlantOptions
from template_control.plant.mjcf import FOOT, TRUNK, mjcf
from template_control.plant.terrain import pieces
from template_control.plant.world import EnginePlant
from template_control.robot.biped import Biped

# Where MuJoCo has the place of a floating base, whose quaternion begins with w, and its velocity.
_PLACE, _SPEED = [0, 1, 2, 4, 5, 6, 3], [0, 1, 2, 3, 4, 5]


@dataclass(frozen=True, kw_only=True)
class MujocoOptions(PlantOptions):
    """Options of the world in MuJoCo: as in PyBullet, and the compliance of its contacts.

    Attributes:
        contact_time: time constant of a contact [s]; MuJoCo takes at least two time steps. From 2
            to 20 ms the robots walk alike; 4 ms lets a foot sink by less than a millimetre.

    Raises:
        ParameterError: if a number is not positive and finite, or the contact is too quick.
    """

    kind: ClassVar[str] = "mujoco"

    contact_time: Positive = 4e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contact_time < 2.0 * self.time_step:
            raise ParameterError(
                f"MujocoOptions.contact_time is {self.contact_time:g} s: give at least two time"
                f" steps, {2.0 * self.time_step:g} s"
            )


def _mujoco() -> Any:
    """The package, an optional one; a ParameterError if it is not installed."""
    try:
        import mujoco
    except ImportError:
        raise ParameterError(
            "plant mujoco needs the package mujoco: pip install 'template-control[mujoco]', or"
            " take another plant"
        ) from None
    return mujoco


class MujocoPlant(EnginePlant):
    """A MuJoCo world with its ground and one robot.

    Args:
        robot: whose model to write as MJCF, and whose joint order to speak.
        options: friction, time step, mass error, contacts, ground.

    Raises:
        ParameterError: if MuJoCo is not installed.
        RobotError: if MuJoCo does not take the model, or makes another robot of it.

    Attributes:
        model, data: MuJoCo's.
    """

    @checked
    def __init__(self, robot: Biped, options: MujocoOptions) -> None:
        super().__init__(robot)
        self.options = options
        self._engine = engine = _mujoco()
        try:
            self.model = engine.MjModel.from_xml_string(mjcf(robot, options, options.contact_time))
        except ValueError as error:
            raise RobotError(f"MuJoCo does not take {robot.path} ({error}): change it") from None
        self.data = engine.MjData(self.model)
        # Joints of one number each: all of a planar robot's, but not a floating base.
        joints = [self.model.joint(n) for n in list(robot.model.names)[2 if self._floats else 1 :]]
        place, speed = (_PLACE, _SPEED) if self._floats else ([], [])
        self._q = np.array([*place, *(joint.qposadr[0] for joint in joints)])
        self._v = np.array([*speed, *(joint.dofadr[0] for joint in joints)])
        self._actuated = self._v[-len(robot.joint_names) :]
        self._trunk = self.model.body(TRUNK).id
        shapes = [self.model.geom(i).name for i in range(self.model.ngeom)]
        self._feet = {
            shape: int(name.removeprefix(FOOT).partition("_")[0])
            for shape, name in enumerate(shapes)
            if name.startswith(FOOT)
        }
        _, stand_out = pieces(options.ground)  # the first shapes, after the plane
        common = [True, *(piece.friction is None for piece in stand_out)]
        self._common_ground = np.flatnonzero(common)
        self._trunk_shapes = {i for i, name in enumerate(shapes) if name.startswith(TRUNK)}
        self._force = np.zeros(6)
        check_mass_matrix(robot, "MuJoCo", self._mass_matrix)

    def _mass_matrix(self, q: Array) -> Array:
        """MuJoCo's (nv, nv) in the model's coordinates, at a configuration (nq,)."""
        self.reset(q, np.zeros(self.model.nv))
        self._engine.mj_forward(self.model, self.data)
        columns = np.zeros((self.model.nv, self.model.nv))
        for unit, column in zip(np.eye(self.model.nv), columns, strict=True):
            self._engine.mj_mulM(self.model, self.data, column, unit)
        return columns / self.options.mass_scale

    def set_friction(self, friction: float) -> None:
        """See :meth:`~.bullet.BulletPlant.set_friction`."""
        self.model.geom_friction[self._common_ground, 0] = friction

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.reset`."""
        self._stale = True
        self._engine.mj_resetData(self.model, self.data)
        self.data.qpos[self._q], self.data.qvel[self._v] = q, v
        if self._floats:  # MuJoCo has the trunk's velocity in the world
            self.data.qvel[:3] = pin.Quaternion(q[3:7]).matrix() @ v[:3]

    def read(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.read`."""
        q[:], v[:] = self.data.qpos[self._q], self.data.qvel[self._v]
        if self._floats:
            v[:3] = pin.Quaternion(q[3:7]).matrix().T @ self.data.qvel[:3]

    def _find_contacts(self) -> None:
        """See :class:`~.world.EnginePlant`."""
        contacts = self.data.contact
        for i, shapes in enumerate(contacts.geom.tolist()):
            ours = 1 if shapes[1] in self._feet else 0
            foot = self._feet.get(shapes[ours])
            if foot is None:
                self._trunk_lies = self._trunk_lies or not self._trunk_shapes.isdisjoint(shapes)
                continue
            self._engine.mj_contactForce(self.model, self.data, i, self._force)
            # The contact's axes are the rows of its frame; its force acts on the second shape.
            force = contacts.frame[i].reshape(3, 3).T @ self._force[:3]
            force = force if ours else -force
            self._press(foot, contacts.pos[i].tolist(), force.tolist())

    def step(self, torque: Array, push: float = 0.0, left: float = 0.0) -> None:
        """See :meth:`~.plant.Plant.step`; the disturbance is along the world's x and y [N]."""
        self._stale = True
        self.data.qfrc_applied[self._actuated] = torque
        self.data.xfrc_applied[self._trunk, :2] = push, left  # at the body's centre of mass
        self._engine.mj_step(self.model, self.data)
