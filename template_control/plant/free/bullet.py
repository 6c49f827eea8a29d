"""A free biped in PyBullet: its trunk is the body's base, and only joint torques drive it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.bullet_bodies import load_body
from template_control.plant.quiet import silenced
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import FLOATING_DOF

with silenced():  # PyBullet announces its build time on standard output or stderr
    import pybullet

Array = NDArray[np.float64]

_BASE = -1  # PyBullet's index of the base link
_POSITION = FLOATING_DOF + 1
_ANGULAR_FIRST = (3, 4, 5, 0, 1, 2)  # places of a velocity's components, linear first


class FreeBulletPlant(BulletPlant):
    """As :class:`~template_control.plant.bullet.BulletPlant`, for a robot that nothing holds.

    PyBullet tells and sets the state of the base link's CoM in its axes of inertia; the robot's is
    that of the link's own frame.

    Args:
        robot: whose URDF to load and whose joint order to speak.
        options: friction, physics step, mass error, step of the ground.

    Raises:
        RobotError: if PyBullet does not read the URDF, or reads another robot.
    """

    def __init__(self, robot: FloatingBaseBiped, options: PlantOptions) -> None:
        super().__init__(robot, options)
        self._away = self._inertial.inverse()

    def _load(self) -> int:
        body = load_body(self.robot, self.client, held=False)
        found = pybullet.getDynamicsInfo(body, _BASE, physicsClientId=self.client)
        self._inertial = _pose(found[3], found[4])
        return body

    def _mass_matrix(self, q: Array) -> Array:
        # PyBullet's base: angular velocity first, about its CoM in its axes of inertia.
        order = np.argsort(self.joints)
        place = np.concatenate((_ANGULAR_FIRST, FLOATING_DOF + order))
        found, turned = np.empty((self.robot.nv, self.robot.nv)), np.eye(self.robot.nv)
        found[np.ix_(place, place)] = self._joint_space(q[_POSITION:][order])
        turned[:FLOATING_DOF, :FLOATING_DOF] = self._inertial.toActionMatrixInverse()
        return turned.T @ found @ turned

    def _trunk_link(self) -> int:
        return _BASE

    def _trunk_com(self) -> Any:
        return pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self.client)[0]

    def step(self, torque: Array, push: float = 0.0, aside: float = 0.0) -> None:
        """See :meth:`~template_control.plant.plant.Plant.step`.

        Args:
            torque: (nu,) joint torques [N m].
            push, aside: disturbance on the trunk's centre of mass along the world's x and y [N].
        """
        self._advance(torque, push, aside)

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~template_control.plant.plant.Plant.reset`."""
        p, c = pybullet, self.client
        super().reset(q[_POSITION:], v[FLOATING_DOF:])
        trunk = _pose(q[:3], q[3:_POSITION])
        place = trunk * self._inertial
        quaternion = pin.Quaternion(place.rotation).coeffs().tolist()
        p.resetBasePositionAndOrientation(
            self.body, place.translation.tolist(), quaternion, physicsClientId=c
        )
        linear, angular = trunk.rotation @ v[:3], trunk.rotation @ v[3:FLOATING_DOF]
        linear = linear + np.cross(angular, place.translation - trunk.translation)
        p.resetBaseVelocity(self.body, linear.tolist(), angular.tolist(), physicsClientId=c)

    def read(self, q: Array, v: Array) -> None:
        """See :meth:`~template_control.plant.plant.Plant.read`."""
        super().read(q[_POSITION:], v[FLOATING_DOF:])
        p, c = pybullet, self.client
        position, quaternion = p.getBasePositionAndOrientation(self.body, physicsClientId=c)
        linear, angular = p.getBaseVelocity(self.body, physicsClientId=c)
        place = _pose(position, quaternion)
        trunk = place * self._away
        back = trunk.rotation.T
        speed = linear - np.cross(angular, place.translation - trunk.translation)
        q[:3], v[:3], v[3:FLOATING_DOF] = trunk.translation, back @ speed, back @ angular
        coefficients = pin.Quaternion(trunk.rotation).coeffs()
        # Of the two quaternions of a rotation the one nearer to the last.
        near = float(coefficients @ q[3:_POSITION]) >= 0.0
        q[3:_POSITION] = coefficients if near else -coefficients


def _pose(position: Any, quaternion: Any) -> pin.SE3:
    """A frame from its place [m] and its quaternion x y z w."""
    return pin.SE3(pin.Quaternion(np.array(quaternion)).matrix(), np.array(position))
