"""PyBullet plant: the robot headless, driven by joint torques and nothing else."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from inspect import isbuiltin
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
from template_control.robot.terms import FLOATING_DOF, PLANAR_DOF
from template_control.robot.urdf import mass_of, named
from template_control.warm_up import Part, ready

_CLOSE = 1e-6  # of the robot's mass
_BASE = -1  # PyBullet's index of the base link
_POSITION = FLOATING_DOF + 1  # numbers of a floating base's place
_ANGULAR_FIRST = (3, 4, 5, 0, 1, 2)  # places of a velocity's components, linear first
_Three = tuple[float, float, float]
_Four = tuple[float, float, float, float]


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


class _World:
    """A world of PyBullet, ``id``: the engine's functions and constants as attributes."""

    def __init__(self) -> None:
        self.id = pybullet().connect(pybullet().DIRECT)

    def __getattr__(self, name: str) -> Any:
        found = getattr(pybullet(), name)
        if isbuiltin(found):
            found = partial(found, physicsClientId=self.id)
        setattr(self, name, found)
        return found


class BulletPlant(EnginePlant):
    """A PyBullet world in DIRECT mode with its ground and one robot.

    PyBullet has the state of a floating base link's CoM in its axes of inertia; the robot's is that
    of the link's own frame.

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
        if self._floats:
            ready(READ)
        self._world: Any = _World()
        self.client = self._world.id
        self._world.setGravity(0.0, 0.0, -robot.gravity)
        self._world.setTimeStep(options.time_step)
        self._ground = _ground_bodies(options.ground, self._world)
        try:
            self.body = _load_body(robot, self._world, held=not self._floats)
            # The base link's axes of inertia in its own frame.
            base = self._world.getDynamicsInfo(self.body, _BASE)
            self._inertial = pin.XYZQUATToSE3([*base[3], *base[4]])
            count = self._world.getNumJoints(self.body)
            info = [self._world.getJointInfo(self.body, i) for i in range(count)]
            by_name = {row[1].decode(): row[0] for row in info}
            # Pinocchio sorts sibling joints by name, Bullet keeps the file's order.
            self.joints = [by_name[name] for name in robot.model.names if name in by_name]
            by_link = {row[12].decode(): row[0] for row in info}
            self._compare_masses(by_link)
            check_mass_matrix(robot, "PyBullet", self._mass_matrix)
            check_damping(robot, options.time_step)
        except RobotError:
            self.close()
            raise
        self._actuated = [by_name[name] for name in robot.joint_names]
        self._feet = {by_link[foot]: i for i, foot in enumerate(robot.feet)}
        self._trunk = _BASE if self._floats else self.joints[PLANAR_DOF - 1]
        away = self._inertial.inverse()
        self._away = np.ascontiguousarray(away.rotation), np.array(away.translation)
        self._moving = np.zeros((5, 3))
        self._configure()

    def _compare_masses(self, links: Mapping[str, int]) -> None:
        """Check that the robot weighs here what it weighs in its model."""
        given = named(ElementTree.fromstring(self.robot.urdf), "link")
        for link, index in links.items():
            mass, wanted = self._world.getDynamicsInfo(self.body, index)[0], mass_of(given[link])
            if abs(mass - wanted) > _CLOSE * self.robot.mass:
                raise RobotError(
                    f"{self.robot.path}: link {link!r} weighs {mass:g} kg in PyBullet and"
                    f" {wanted:g} kg in the URDF: give it an <inertial> with its mass"
                )

    def _mass_matrix(self, q: Array) -> Array:
        """PyBullet's (nv, nv) in the model's coordinates, at a configuration (nq,)."""
        nv, order = self.robot.nv, np.argsort(self.joints)
        base, angles = nv - len(order), q[-len(order) :][order].tolist()
        # PyBullet's base: angular velocity first, about its CoM in its axes of inertia.
        places, found = [*_ANGULAR_FIRST[:base], *(base + order)], np.empty((nv, nv))
        found[np.ix_(places, places)] = self._world.calculateMassMatrix(self.body, angles)
        turned = np.eye(nv)
        turned[:base, :base] = self._inertial.toActionMatrixInverse()[:base, :base]
        return turned.T @ found @ turned

    def _configure(self) -> None:
        p, body, scale = self._world, self.body, self.options.mass_scale
        damping = dict(zip(self._actuated, self.robot.joint_damping, strict=True))
        # One property a call: a combined call silently drops some of them.
        for ground in self._ground:
            p.changeDynamics(ground, -1, restitution=0.0)
        for link in range(_BASE, p.getNumJoints(body)):
            for name, value in (
                ("restitution", 0.0),
                ("linearDamping", 0.0),
                ("angularDamping", 0.0),
                ("jointDamping", damping.get(link, 0.0)),
                ("maxJointVelocity", 1e4),
            ):
                p.changeDynamics(body, link, **{name: value})
            if scale != 1.0:
                mass, _, inertia, *_ = p.getDynamicsInfo(body, link)
                p.changeDynamics(body, link, mass=mass * scale)
                p.changeDynamics(body, link, localInertiaDiagonal=[i * scale for i in inertia])
        dry = dict(zip(self._actuated, self.robot.joint_friction, strict=True))
        for joint in self.joints:
            # A motor that holds a joint with so much torque at most is dry friction.
            p.setJointMotorControl2(body, joint, p.VELOCITY_CONTROL, force=dry.get(joint, 0.0))
        self.set_friction(self.options.friction)

    def set_friction(self, friction: float) -> None:
        """Change the friction of the ground, but not of pieces of it that have their own.

        Args:
            friction: Coulomb coefficient between foot and ground.
        """
        p = self._world
        # Bullet multiplies the two bodies' values.
        for ground, own in self._ground.items():
            p.changeDynamics(ground, -1, lateralFriction=1.0 if own is None else own / friction)
        for link in range(_BASE, p.getNumJoints(self.body)):
            p.changeDynamics(self.body, link, lateralFriction=friction)

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.reset`."""
        self._stale = True
        count = len(self.joints)
        for joint, position, velocity in zip(self.joints, q[-count:], v[-count:], strict=True):
            self._world.resetJointState(self.body, joint, position, velocity)
        if self._floats:
            self._reset_trunk(q, v)

    def _reset_trunk(self, q: Array, v: Array) -> None:
        trunk = pin.XYZQUATToSE3(q[:_POSITION])
        place = trunk * self._inertial
        *centre, x, y, z, w = pin.SE3ToXYZQUAT(place).tolist()
        self._world.resetBasePositionAndOrientation(self.body, centre, (x, y, z, w))
        linear, angular = trunk.rotation @ v[:3], trunk.rotation @ v[3:FLOATING_DOF]
        linear = linear + np.cross(angular, place.translation - trunk.translation)
        self._world.resetBaseVelocity(self.body, linear.tolist(), angular.tolist())

    def read(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.read`."""
        p, count, moving = self._world, len(self.joints), self._moving
        angles, speeds = q[-count:], v[-count:]
        for i, state in enumerate(p.getJointStates(self.body, self.joints)):
            angles[i] = state[0]
            speeds[i] = state[1]
        if self._floats:
            place = p.getBasePositionAndOrientation(self.body)
            read_trunk(place, p.getBaseVelocity(self.body), *self._away, q, moving)
            np.matmul(moving[:3], moving[3], out=v[:3])
            np.matmul(moving[:3], moving[4], out=v[3:FLOATING_DOF])

    def _find_contacts(self) -> None:
        """See :class:`~.world.EnginePlant`.

        Asked for one body, PyBullet turns the normal towards it but not the friction, so ask for
        all. Whatever touches the robot is ground: it does not collide with itself.
        """
        feet, body = self._feet, self.body
        for contact in self._world.getContactPoints():
            sign, link = (1.0, contact[3]) if contact[1] == body else (-1.0, contact[4])
            foot = feet.get(link)
            if foot is None:
                self._trunk_lies = self._trunk_lies or link == self._trunk
                continue
            # Forces along the normal (a wall's is level) and two directions of friction.
            normal, one, other = sign * contact[9], sign * contact[10], sign * contact[12]
            out, slip, across = contact[7], contact[11], contact[13]
            force = [normal * out[i] + one * slip[i] + other * across[i] for i in range(3)]
            self._press(foot, contact[6], force)

    def step(self, torque: Array, push: float = 0.0, left: float = 0.0) -> None:
        """See :meth:`~.plant.Plant.step`; the disturbance is along the world's x and y [N]."""
        p, body, trunk = self._world, self.body, self._trunk
        self._stale = True
        forces = np.asarray(torque).tolist()  # Python's numbers: PyBullet is slow with others
        p.setJointMotorControlArray(body, self._actuated, p.TORQUE_CONTROL, forces=forces)
        if push or left:
            of_base = p.getBasePositionAndOrientation(body)
            com, *_ = of_base if trunk == _BASE else p.getLinkState(body, trunk)
            p.applyExternalForce(body, trunk, [push, left, 0.0], com, p.WORLD_FRAME)
        p.stepSimulation()

    def close(self) -> None:
        """Disconnect; the plant is unusable afterwards."""
        self._world.disconnect()


def _load_body(robot: Biped, world: Any, held: bool) -> int:
    """Body of a robot's URDF, its root link fixed to the world if ``held``; a RobotError if bad."""
    # By default Bullet recomputes inertias from shapes; pictures it does not draw it need not read.
    flags = world.URDF_USE_INERTIA_FROM_FILE | world.URDF_IGNORE_VISUAL_SHAPES
    tree = ElementTree.fromstring(robot.urdf)
    for link in tree.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)  # which PyBullet would read all the same
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_bytes(ElementTree.tostring(tree, encoding="utf-8"))
        try:
            with decimal_points():
                return int(world.loadURDF(str(path), useFixedBase=held, flags=flags))
        except world.error as error:
            raise RobotError(f"PyBullet does not read {robot.path} ({error}): change it") from None


def _ground_bodies(terrain: Terrain, world: Any) -> dict[int, float | None]:
    """Make the ground's bodies; friction of each, None where it is that of the plant's options."""
    height, stand_out = pieces(terrain)
    plane = world.createCollisionShape(world.GEOM_PLANE)
    base = world.createMultiBody(0, plane, basePosition=(0.0, 0.0, height))
    found: dict[int, float | None] = {base: None}
    for piece in stand_out:
        box = world.createCollisionShape(world.GEOM_BOX, halfExtents=piece.half_sides)
        turn = world.getQuaternionFromEuler((0.0, piece.pitch, 0.0))
        body = world.createMultiBody(0, box, basePosition=piece.centre, baseOrientation=turn)
        found[body] = piece.friction
    return found


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
