"""PyBullet plant: the robot headless, driven by joint torques and nothing else."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Positive
from template_control.compiled import compiled
from template_control.errors import ParameterError, RobotError
from template_control.plant.agreement import check_damping, check_mass_matrix
from template_control.plant.c_library import decimal_points, silenced
from template_control.plant.terrain import Terrain, pieces
from template_control.plant.world import EnginePlant, WorldOptions
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import FLOATING_DOF, PATCH, PLANAR_DOF
from template_control.robot.urdf import link_masses
from template_control.warm_up import Part, ready

_CLOSE = 1e-6  # of the robot's mass
_BASE = -1  # PyBullet's index of the base link
_POSITION = FLOATING_DOF + 1  # numbers of a floating base's place
_ANGULAR_FIRST = (3, 4, 5, 0, 1, 2)  # places of a velocity's components, linear first
_Three = tuple[float, float, float]
_Four = tuple[float, float, float, float]
AXES = {2: [0, 2], 3: [0, 1, 2]}
"""Of a force's components, by how many there are."""


def moment(place: Sequence[float], force: Sequence[float]) -> tuple[float, float, float]:
    """Moment of a force about the origin [N m]; NumPy's cross product takes 40 us."""
    (x, y, z), (fx, fy, fz) = place, force
    return y * fz - z * fy, z * fx - x * fz, x * fy - y * fx


@dataclass(frozen=True, kw_only=True)
class PlantOptions(WorldOptions):
    """Options of the world in PyBullet.

    Attributes:
        friction: Coulomb coefficient between foot and ground.
    """

    kind: ClassVar[str] = "pybullet"

    friction: Positive = 0.7


@cache
def pybullet() -> Any:
    """The module, imported where a world of it is made; a ParameterError if it is not installed."""
    try:
        with silenced():  # it announces its build time on standard output or stderr
            import pybullet as module
    except ImportError:
        raise ParameterError(
            "plant pybullet needs the package pybullet: pip install 'template-control[pybullet]'"
            " (which compiles it on Python 3.12 and later), or take another plant, such as mujoco"
        ) from None
    return module


class BulletPlant(EnginePlant):
    """A PyBullet world in DIRECT mode with its ground and one robot.

    Args:
        robot: whose URDF to load and whose joint order to speak.
        options: friction, physics step, mass error, ground.

    Raises:
        RobotError: if PyBullet does not read the URDF, or reads another robot.

    Attributes:
        client, body: PyBullet's handles of the world and the robot.
        joints: PyBullet's joint indices in the order of q.
    """

    @checked
    def __init__(self, robot: Biped, options: PlantOptions) -> None:
        super().__init__(robot)
        self.robot, self.options = robot, options
        p = self._engine = pybullet()
        self.client = c = p.connect(p.DIRECT)
        p.setGravity(0.0, 0.0, -robot.gravity, physicsClientId=c)
        p.setTimeStep(options.time_step, physicsClientId=c)
        self._ground = _ground_bodies(options.ground, c)
        try:
            self.body = self._load()
            info = self._info()
            by_name = {row[1].decode(): row[0] for row in info}
            # Pinocchio sorts sibling joints by name, Bullet keeps the file's order.
            self.joints = [by_name[name] for name in robot.model.names if name in by_name]
            self._compare_masses(info)
            check_mass_matrix(robot, "PyBullet", self._mass_matrix)
            check_damping(robot, options.time_step)
        except RobotError:
            self.close()
            raise
        by_link = {row[12].decode(): row[0] for row in info}
        self._actuated = [by_name[name] for name in robot.joint_names]
        self._feet = {by_link[foot]: i for i, foot in enumerate(robot.feet)}
        self._trunk = self._trunk_link()
        self._configure(len(info))

    def _load(self) -> int:
        return _load_body(self.robot, self.client)

    def _trunk_link(self) -> int:
        """PyBullet's index of the trunk."""
        return self.joints[PLANAR_DOF - 1]

    def _info(self) -> list[tuple[Any, ...]]:
        p, c = self._engine, self.client
        count = p.getNumJoints(self.body, physicsClientId=c)
        return [p.getJointInfo(self.body, i, physicsClientId=c) for i in range(count)]

    def _compare_masses(self, info: list[tuple[Any, ...]]) -> None:
        """Check that the robot weighs here what it weighs in its model."""
        masses = link_masses(self.robot.urdf)
        for row in info:
            link = row[12].decode()
            mass = self._engine.getDynamicsInfo(self.body, row[0], physicsClientId=self.client)[0]
            if abs(mass - masses[link]) > _CLOSE * self.robot.mass:
                raise RobotError(
                    f"{self.robot.path}: link {link!r} weighs {mass:g} kg in PyBullet and"
                    f" {masses[link]:g} kg in the URDF: give it an <inertial> with its mass"
                )

    def _mass_matrix(self, q: Array) -> Array:
        """PyBullet's (nv, nv) in the model's coordinates, at a configuration (nq,)."""
        order = np.argsort(self.joints)
        found = np.empty((self.robot.nv, self.robot.nv))
        found[np.ix_(order, order)] = self._joint_space(q[order])
        return found

    def _joint_space(self, q: Array) -> Array:
        """The same in PyBullet's own coordinates; ``q`` holds the joints in its own order."""
        angles = q.tolist()
        return np.array(
            self._engine.calculateMassMatrix(self.body, angles, physicsClientId=self.client)
        )

    def _configure(self, joints: int) -> None:
        p, c, body = self._engine, self.client, self.body
        damping = dict(zip(self._actuated, self.robot.joint_damping, strict=True))
        # One property a call: a combined call silently drops some of them.
        for ground in self._ground:
            p.changeDynamics(ground, -1, restitution=0.0, physicsClientId=c)
        for link in range(-1, joints):
            for name, value in (
                ("restitution", 0.0),
                ("linearDamping", 0.0),
                ("angularDamping", 0.0),
                ("jointDamping", damping.get(link, 0.0)),
                ("maxJointVelocity", 1e4),
            ):
                p.changeDynamics(body, link, **{name: value}, physicsClientId=c)
            if self.options.mass_scale != 1.0:
                dynamics = p.getDynamicsInfo(body, link, physicsClientId=c)
                mass, inertia = dynamics[0], dynamics[2]
                scale = self.options.mass_scale
                p.changeDynamics(body, link, mass=mass * scale, physicsClientId=c)
                p.changeDynamics(
                    body,
                    link,
                    localInertiaDiagonal=[i * scale for i in inertia],
                    physicsClientId=c,
                )
        dry = dict(zip(self._actuated, self.robot.joint_friction, strict=True))
        for joint in self.joints:
            # A motor that holds a joint with so much torque at most is dry friction.
            p.setJointMotorControl2(
                body, joint, p.VELOCITY_CONTROL, force=dry.get(joint, 0.0), physicsClientId=c
            )
        self.set_friction(self.options.friction)

    def set_friction(self, friction: float) -> None:
        """Change the friction of the ground, but not of pieces of it that have their own.

        Args:
            friction: Coulomb coefficient between foot and ground.
        """
        p, c = self._engine, self.client
        # Bullet multiplies the two bodies' values.
        for ground, own in self._ground.items():
            share = 1.0 if own is None else own / friction
            p.changeDynamics(ground, -1, lateralFriction=share, physicsClientId=c)
        for link in range(-1, p.getNumJoints(self.body, physicsClientId=c)):
            p.changeDynamics(self.body, link, lateralFriction=friction, physicsClientId=c)

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.reset`."""
        self._stale = True
        for joint, position, velocity in zip(self.joints, q, v, strict=True):
            self._engine.resetJointState(
                self.body, joint, position, velocity, physicsClientId=self.client
            )

    def read(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.read`."""
        states = self._engine.getJointStates(self.body, self.joints, physicsClientId=self.client)
        for i, state in enumerate(states):
            q[i] = state[0]
            v[i] = state[1]

    def _find_contacts(self) -> None:
        """See :class:`~.world.EnginePlant`.

        Asked for one body, PyBullet turns the normal towards it but not the friction, so ask for
        all. Whatever touches the robot is ground: it does not collide with itself.
        """
        forces, axes = self._forces, AXES[self.robot.directions]
        for contact in self._engine.getContactPoints(physicsClientId=self.client):
            sign, link = (1.0, contact[3]) if contact[1] == self.body else (-1.0, contact[4])
            foot = self._feet.get(link)
            if foot is None:
                self._trunk_lies = self._trunk_lies or link == self._trunk
                continue
            # Normal force and direction (a wall pushes sideways), two of friction.
            normal, along, across = contact[9], contact[10], contact[12]
            force = [
                sign
                * (
                    normal * contact[7][axis]
                    + along * contact[11][axis]
                    + across * contact[13][axis]
                )
                for axis in axes
            ]
            for i, part in enumerate(force):
                forces[foot, i] += part
            if forces.shape[1] == PATCH:
                for i, part in enumerate(moment(contact[6], force), 3):
                    forces[foot, i] += part

    def step(self, torque: Array, push: float = 0.0) -> None:
        """See :meth:`~.plant.Plant.step`."""
        self._advance(torque, push, 0.0)

    def _advance(self, torque: Array, push: float, left: float) -> None:
        """One physics step with a push along the world's x and y [N]."""
        p, c = self._engine, self.client
        self._stale = True
        forces = np.asarray(torque).tolist()  # Python's numbers: PyBullet is slow with others
        p.setJointMotorControlArray(
            self.body, self._actuated, p.TORQUE_CONTROL, forces=forces, physicsClientId=c
        )
        if push or left:
            p.applyExternalForce(
                self.body,
                self._trunk,
                [push, left, 0.0],
                self._trunk_com(),
                p.WORLD_FRAME,
                physicsClientId=c,
            )
        p.stepSimulation(physicsClientId=c)

    def _trunk_com(self) -> Any:
        return self._engine.getLinkState(self.body, self._trunk, physicsClientId=self.client)[0]

    def close(self) -> None:
        """Disconnect; the plant is unusable afterwards."""
        self._engine.disconnect(self.client)


class FloatingBaseBulletPlant(BulletPlant):
    """As :class:`BulletPlant`, for a floating-base robot.

    PyBullet has the state of the base link's CoM in its axes of inertia; the robot's is that of the
    link's own frame.
    """

    def __init__(self, robot: FloatingBaseBiped, options: PlantOptions) -> None:
        ready(READ)
        super().__init__(robot, options)
        away = self._inertial.inverse()
        self._away = np.ascontiguousarray(away.rotation), np.array(away.translation)
        self._moving = np.zeros((5, 3))

    def _load(self) -> int:
        body = _load_body(self.robot, self.client, held=False)
        found = self._engine.getDynamicsInfo(body, _BASE, physicsClientId=self.client)
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
        return self._engine.getBasePositionAndOrientation(self.body, physicsClientId=self.client)[0]

    def step(self, torque: Array, push: float = 0.0, left: float = 0.0) -> None:
        """See :meth:`~.plant.Plant.step`; the disturbance is along the world's x and y [N]."""
        self._advance(torque, push, left)

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.reset`."""
        p, c = self._engine, self.client
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
        """See :meth:`~.plant.Plant.read`."""
        super().read(q[_POSITION:], v[FLOATING_DOF:])
        p, c = self._engine, self.client
        place = p.getBasePositionAndOrientation(self.body, physicsClientId=c)
        velocity, moving = p.getBaseVelocity(self.body, physicsClientId=c), self._moving
        read_trunk(place, velocity, *self._away, q, moving)
        np.matmul(moving[:3], moving[3], out=v[:3])
        np.matmul(moving[:3], moving[4], out=v[3:FLOATING_DOF])


def _load_body(robot: Biped, client: int, held: bool = True) -> int:
    """Body of a robot's URDF, its root link fixed to the world if ``held``; a RobotError if bad."""
    engine = pybullet()
    # By default Bullet recomputes inertias from shapes; pictures it does not draw it need not read.
    flags = engine.URDF_USE_INERTIA_FROM_FILE | engine.URDF_IGNORE_VISUAL_SHAPES
    tree = ElementTree.fromstring(robot.urdf)
    for link in tree.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)  # which PyBullet would read all the same
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_bytes(ElementTree.tostring(tree, encoding="utf-8"))
        try:
            with decimal_points():
                body = engine.loadURDF(
                    str(path), useFixedBase=held, flags=flags, physicsClientId=client
                )
        except engine.error as error:
            raise RobotError(f"PyBullet does not read {robot.path} ({error}): change it") from None
    return int(body)


def _ground_bodies(terrain: Terrain, client: int) -> dict[int, float | None]:
    """Make the ground's bodies; friction of each, None where it is that of the plant's options."""
    p = pybullet()

    def body(shape: int, position: tuple[float, float, float], pitch: float = 0.0) -> int:
        turn = p.getQuaternionFromEuler((0.0, pitch, 0.0))
        made = p.createMultiBody(
            0, shape, basePosition=position, baseOrientation=turn, physicsClientId=client
        )
        return int(made)

    height, stand_out = pieces(terrain)
    plane = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
    found: dict[int, float | None] = {body(plane, (0.0, 0.0, height)): None}
    for piece in stand_out:
        sides = piece.half_sides
        box = p.createCollisionShape(p.GEOM_BOX, halfExtents=sides, physicsClientId=client)
        found[body(box, piece.centre, piece.pitch)] = piece.friction
    return found


def _pose(position: Any, quaternion: Any) -> pin.SE3:
    """A frame from its place [m] and its quaternion x y z w."""
    return pin.SE3(pin.Quaternion(np.array(quaternion)).matrix(), np.array(position))


@compiled
def read_trunk(
    place: tuple[_Three, _Four],
    velocity: tuple[_Three, _Three],
    turn: Array,
    shift: Array,
    q: Array,
    moving: Array,
) -> None:
    """Write the trunk's place and quaternion x y z w into ``q``, by ``place`` of its CoM.

    ``turn`` and ``shift`` are the frame of the trunk in its axes of inertia. ``moving`` (5, 3) is
    overwritten with the world's axes in the trunk's, and the velocity of the trunk's origin and its
    angular velocity, in the world's axes.
    """
    (at, (x, y, z, w)), (linear, angular) = place, velocity
    own, away = np.empty((3, 3)), np.empty(3)
    own[0, 0], own[1, 1] = 1.0 - (2.0 * y * y + 2.0 * z * z), 1.0 - (2.0 * x * x + 2.0 * z * z)
    own[2, 2] = 1.0 - (2.0 * x * x + 2.0 * y * y)
    own[0, 1], own[1, 0] = 2.0 * y * x - 2.0 * z * w, 2.0 * y * x + 2.0 * z * w
    own[0, 2], own[2, 0] = 2.0 * z * x + 2.0 * y * w, 2.0 * z * x - 2.0 * y * w
    own[1, 2], own[2, 1] = 2.0 * z * y - 2.0 * x * w, 2.0 * z * y + 2.0 * x * w
    for i in range(3):
        for j in range(3):
            moving[j, i] = own[i, 0] * turn[0, j] + own[i, 1] * turn[1, j] + own[i, 2] * turn[2, j]
        q[i] = at[i] + (own[i, 0] * shift[0] + own[i, 1] * shift[1] + own[i, 2] * shift[2])
        away[i] = at[i] - q[i]
        moving[4, i] = angular[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        moving[3, i] = linear[i] - (angular[j] * away[k] - angular[k] * away[j])
    _near_quaternion(moving, q)


@compiled
def _near_quaternion(inverse: Array, q: Array) -> None:
    """Write the quaternion of a rotation, given by its inverse, nearer to that in ``q``."""
    m, found, i = inverse.T, np.empty(4), 3
    trace = m[0, 0] + (m[1, 1] + m[2, 2])
    if trace > 0.0:
        root = np.sqrt(trace + 1.0)
        half = 0.5 / root
        found[3] = 0.5 * root
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            found[i] = (m[k, j] - m[j, k]) * half
    else:
        i = 1 if m[1, 1] > m[0, 0] else 0
        i = 2 if m[2, 2] > m[i, i] else i
        j, k = (i + 1) % 3, (i + 2) % 3
        root = np.sqrt(m[i, i] - m[j, j] - m[k, k] + 1.0)
        half = 0.5 / root
        found[i], found[3] = 0.5 * root, (m[k, j] - m[j, k]) * half
        found[j], found[k] = (m[j, i] + m[i, j]) * half, (m[k, i] + m[i, k]) * half
    near = 0.0
    for n in range(4):
        near += found[n] * q[3 + n]
    for n in range(4):
        q[3 + n] = found[n] if near >= 0.0 else -found[n]


def read_base() -> None:
    """The state of a floating base in PyBullet."""
    three = (0.0, 0.0, 0.0)
    place, velocity = (three, (*three, 1.0)), (three, three)
    read_trunk(place, velocity, np.eye(3), np.zeros(3), np.zeros(9), np.zeros((5, 3)))


READ = (Part(read_base, 1.0),)
"""Compiled functions of a floating base in PyBullet."""
