"""Robot on Pinocchio: its dynamics, its frames and the limits of its joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.errors import DivergedError, RobotError
from template_control.robot.terms import PATCH, ROBOT_DATA, Jacobians, gather_joints
from template_control.structured import Number

WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class FrameTerms(NamedTuple):
    """Motion of a frame's origin in the world's axes.

    Attributes:
        position, velocity: (3,) [m, m/s].
        jacobian: (3, nv) maps v to the velocity.
        bias: (3,) dJ/dt v of this Jacobian [m/s^2].
    """

    position: Array
    velocity: Array
    jacobian: Array
    bias: Array


class Robot(ABC):
    """Model of a robot, and its dynamics at the last :meth:`update`.

    What :meth:`update` writes are views that its next call overwrites.

    Args:
        model: Pinocchio's.
        contacts: number of points or patches of it that may touch the ground.
        patches: whether they are patches, which bear moments too.

    Attributes that are constant:
        base_dof: unactuated degrees of freedom, the first ones.
        base_joints: Pinocchio's joints that they belong to.
        directions: of a contact's force: 2 in the plane, 3 in space. The last one is up.
        contact_rows: rows of a contact: as many, or 6 of a patch, which also has an angular
            velocity and a moment.
        name: of the robot.
        model: the Pinocchio model.
        nq, nv: numbers of a configuration and of a velocity.
        mass: total mass [kg].
        gravity: gravitational acceleration [m/s^2].
        joint_names: actuated joints, in the order of the last entries of q and v.
        torque_limit: (nu,) URDF ``effort`` [N m].
        velocity_limit: (nu,) URDF ``velocity`` [rad/s].
        joint_range: (nu, 2) URDF ``lower`` and ``upper`` [rad].
        joint_stops: (nu, 2) angles before which joints are brought to rest, within that range
            [rad].
        joint_damping: (nu,) URDF ``damping``: viscous [N m s/rad].
        joint_friction: (nu,) URDF ``friction``: dry, at most this much [N m]. Plants have it; no
            term of the model does.

    Attributes of the last update:
        mass_matrix: (nv, nv) M(q).
        nonlinear_effects: (nv,) C(q, v) v + g(q), and the joints' damping [N, N m].
        joint_angle, joint_velocity: (nu,) of the actuated joints [rad, rad/s].
        fastest: the largest share of its limit that a joint's speed has.
        soonest_stop: the shortest time in which a joint would come to its stop at its speed [s]; 0
            of one that is there, inf where none moves.
        data, jacobians: all of these for compiled code, which reads the same memory: (1,) of
            ``ROBOT_DATA``, and :class:`~.terms.Jacobians`.
        arrays: the latter as a plain tuple, which a compiled function takes in half the time.
    """

    base_dof: int
    base_joints: int
    directions: int
    contact_rows: int
    fastest = Number("fastest")
    soonest_stop = Number("soonest_stop")

    def __init__(self, model: pin.Model, contacts: int = 0, *, patches: bool = False) -> None:
        self.model, self.name = model, model.name or "the robot"
        self.nq, self.nv = model.nq, model.nv
        self.mass = float(pin.computeTotalMass(model))
        self.gravity = float(-model.gravity.linear[2])
        self.joint_names = tuple(model.names)[1 + self.base_joints :]
        self.torque_limit: Array = np.array(model.effortLimit[self.base_dof :])
        self.velocity_limit: Array = np.array(model.velocityLimit[self.base_dof :])
        stops = (model.lowerPositionLimit, model.upperPositionLimit)
        self.joint_range: Array = np.column_stack(stops)[-len(self.joint_names) :]
        self.joint_damping: Array = np.array(model.damping[self.base_dof :])
        self.joint_friction: Array = np.array(model.upperDryFrictionLimit[self.base_dof :])
        self._data = data = model.createData()
        self.data = np.zeros(1, ROBOT_DATA)
        self.data["mass"], self.data["gravity"] = self.mass, self.gravity
        self.data["contacts"] = contacts
        self.contact_rows = rows = PATCH if patches else self.directions
        self.jacobians = j = Jacobians.zeros(data, self.directions, self.base_dof, contacts, rows)
        self.arrays = tuple(j)
        self.mass_matrix, self.nonlinear_effects = j.mass_matrix, j.nonlinear_effects
        self.joint_angle, self.joint_velocity = j.joints
        limits = (self.velocity_limit, *self.joint_range.T, self.joint_damping)
        self._joint_limits = np.vstack(limits)
        self.joint_stops: Array = self._joint_limits[1:3].T

    def __repr__(self) -> str:
        joints = ", ".join(self.joint_names)
        return f"<{type(self).__name__} {self.name}: {self.mass:.4g} kg, joints {joints}>"

    @abstractmethod
    def update(self, q: Array, v: Array) -> None:
        """Compute everything the controller needs at (q, v), each quantity once.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.

        Raises:
            DivergedError: if a value is NaN or infinite.
        """

    def _diverged(self, q: Array, v: Array) -> DivergedError:
        return DivergedError(
            f"the state of {self.name} is not finite: q = {q.tolist()}, v = {v.tolist()}"
        )

    def frame(self, name: str) -> FrameTerms:
        """Motion of a frame's origin at the last :meth:`update`.

        Args:
            name: of a frame of the model: a link's or a joint's.

        Raises:
            RobotError: if there is no such frame.
        """
        model, data = self.model, self._data
        number = model.getFrameId(name)
        if number >= model.nframes:
            known = ", ".join(frame.name for frame in model.frames[1:])
            raise RobotError(f"{self.name} has no frame {name!r}: its frames are {known}")
        pin.updateFramePlacement(model, data, number)
        place = data.oMf[number].translation.copy()
        jacobian = pin.getFrameJacobian(model, data, number, WORLD_ALIGNED)[:3]
        velocity = pin.getFrameVelocity(model, data, number, WORLD_ALIGNED).linear
        bias = pin.getFrameClassicalAcceleration(model, data, number, WORLD_ALIGNED).linear
        return FrameTerms(place, velocity, jacobian, bias)


class FixedBaseRobot(Robot):
    """Robot whose base is fixed, such as an arm: what whole-body control alone needs of it.

    Args:
        model: Pinocchio's, all of whose joints are actuated and have one degree of freedom.

    Raises:
        RobotError: if a joint has more.
    """

    base_dof = base_joints = 0
    directions = 3

    def __init__(self, model: pin.Model) -> None:
        if not model.nq == model.nv == model.njoints - 1:
            raise RobotError(
                f"{model.name or 'the robot'} has joints of several degrees of freedom: give hinges"
            )
        super().__init__(model)

    def update(self, q: Array, v: Array) -> None:
        """See :meth:`Robot.update`."""
        pin.computeAllTerms(self.model, self._data, q, v)
        now, j = self.data[0], self.jacobians
        if not gather_joints(q, v, self._joint_limits, now, j.nonlinear_effects, j.joints):
            raise self._diverged(q, v)
