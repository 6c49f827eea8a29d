"""A planar biped with point feet, on Pinocchio.

Frames: world x forward, y up (the URDF's z), pitch about the URDF's +y, so that a forward
lean is positive. The generalised coordinates are q = (x, z, pitch, joints) in Pinocchio's
joint order; all hinges are revolute, so nq = nv.

The URDF of a 3D biped is rewritten as a planar one, which serves Pinocchio, PyBullet and the viewer
alike: three base joints (x, z, pitch) carry the root link, all joints but the hips and knees are
fixed where they are locked, and the feet are spheres. What the plane takes away is only what it
holds: masses and inertias are kept, and forces out of the plane are the guide's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping, Sequence
from math import cos, sin
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.errors import RobotError
from template_control.robot import urdf_edits
from template_control.robot.biped import MONOPOD, SINGLE, Biped
from template_control.robot.five_link import PLANAR_BASE
from template_control.robot.legs import is_lateral
from template_control.robot.requirements import add_feet, check_planar, check_planar_legs
from template_control.robot.terms import PLANAR_DOF, gather_planar
from template_control.robot.urdf import build_model, check_bodies, end_of, named, read_urdf
from template_control.structured import keep

_PITCH = 2  # place of the trunk's pitch in q
_SAGITTAL = 4  # joints that stay
_HINGES = ("revolute", "continuous")


class PlanarBiped(Biped):
    """Model of a planar biped and its kinematics and dynamics at the last :meth:`update`.

    :meth:`from_urdf` makes one from a file. Its arguments and attributes are those of
    :class:`~.biped.Biped`, and the attributes below.

    Attributes:
        trunk_axes: (3, 3) rotation from the frame of the upright trunk to the world.
        trunk_lever: (3,) from the hips to the upright trunk's own CoM, in the world's axes [m].
        foot_turning: (2, nv) maps v to each foot's angular velocity, forward positive; and q to
            its angle.
    """

    base_dof = base_joints = PLANAR_DOF
    directions = 2

    def _prepare(self) -> None:
        model = self.model
        pin.forwardKinematics(model, self._data, self._neutral)
        self.trunk_axes: Array = self._data.oMi[PLANAR_DOF].rotation.copy()
        self.trunk_lever: Array = self.trunk_axes @ model.inertias[PLANAR_DOF].lever
        self.trunk_com = float(self.trunk_lever[2])
        self.foot_turning: Array = np.zeros((2, self.nv))
        self.foot_turning[:, _PITCH] = 1.0
        for row, leg in zip(self.foot_turning, self.legs, strict=False):
            row[[PLANAR_DOF + joint for joint in leg]] = self.joint_sign[list(leg)]
        self._kept = keep((self._sources, self.data, self.arrays[1:]))

    @classmethod
    @checked
    def from_urdf(
        cls,
        path: str | Path,
        feet: Sequence[str] = ("left_foot", "right_foot"),
        sagittal_joints: Sequence[str] = (),
        locked: Mapping[str, float] | None = None,
        foot_radius: float | None = None,
        walk: tuple[float, float] | None = None,
        *,
        foot_offset: tuple[float, float, float] | None = None,
        lossless: bool = False,
    ) -> PlanarBiped:
        """Load a planar URDF, or a 3D one that is held in its sagittal plane.

        A planar one has prismatic x, prismatic z, revolute y, then hip and knee of either leg
        about y. Of a 3D one (x forward, y left, z up) the hips and knees are named.

        Args:
            path: the URDF file.
            feet: the two foot links, or a monopod's one; each has one sphere as collision geometry.
            sagittal_joints: of a 3D URDF, the hips and knees; its other joints are locked.
            locked: angles [rad] of locked joints; 0 for those not named.
            foot_radius: of spheres to be put into the feet of a 3D URDF [m].
            foot_offset: of the spheres' centres from the foot links' origins, in the links' axes
                [m]: a sole is below its ankle.
            walk: see the attribute.
            lossless: whether the joints' damping and friction are left out.

        Meshes are looked for next to the URDF and in its package. One that is only shown may be
        missing: the log says so.

        Raises:
            RobotError: if the file is missing, no URDF, not planar, or lacks a foot; if a mass,
                an inertia or a size is none; if a mesh that touches the ground is missing.
        """
        path = Path(path)
        tree = read_urdf(path, lossless)
        if sagittal_joints:
            planarise(path, tree, feet, sagittal_joints, locked or {}, foot_radius, foot_offset)
        urdf = urdf_edits.complete(path, tree)
        model = build_model(path, urdf)
        check_planar(path, model, len(feet))
        only_3d = {"foot_radius": foot_radius, "foot_offset": foot_offset, "locked": locked or None}
        for name, value in only_3d.items():
            if value is not None and not sagittal_joints:
                raise RobotError(
                    f"{path}: {name} is for a 3D URDF, and no sagittal_joints are named: name them"
                    " too, or leave it out"
                )
        check_bodies(path, tree, model, PLANAR_DOF)
        check_planar_legs(path, model, feet)
        radius = add_feet(path, urdf, model, feet)
        groups = MONOPOD if len(feet) == 1 else SINGLE
        return cls(path, urdf, model, tuple(feet), radius, walk, groups=groups)

    def update(self, q: Array, v: Array) -> None:
        """See :meth:`~.robot.Robot.update`."""
        pin.computeAllTerms(self.model, self._data, q, v)
        # Without q: turns data.a = dJ/dt v into the CoM's bias.
        pin.centerOfMass(self.model, self._data)
        if not gather_planar(self._kept, q, v):
            raise self._diverged(q, v)

    def turn_gravity(self, angle: float) -> None:
        """Let the model stand in axes that are turned with a slope.

        Args:
            angle: of the axes' x over the horizontal [rad].
        """
        self.model.gravity.linear = self.gravity * np.array([-sin(angle), 0.0, -cos(angle)])

    def hip_height(self, q: Array) -> float:
        """Height of the point the legs hang from [m]; the base joint is placed there."""
        return float(q[1])

    def tilt(self, q: Array) -> float:
        """See :meth:`~.biped.Biped.tilt`."""
        return abs(float(q[_PITCH]))


def planarise(
    path: Path,
    robot: ET.Element,
    feet: Sequence[str],
    sagittal_joints: Sequence[str],
    locked: Mapping[str, float],
    foot_radius: float | None,
    foot_offset: Sequence[float] | None,
) -> None:
    """Make a 3D URDF a planar one, in place; arguments as of :meth:`PlanarBiped.from_urdf`."""
    if len(set(sagittal_joints)) != _SAGITTAL:
        raise RobotError(
            f"{path}: sagittal_joints are {list(sagittal_joints)}: name {_SAGITTAL} different"
            " hinges in its legs: a hip and a knee each"
        )
    urdf_edits.lock(path, robot, sagittal_joints, locked)
    joints = named(robot, "joint")
    for name in sagittal_joints:
        if joints[name].get("type") not in _HINGES:
            raise RobotError(
                f"{path}: joint {name!r} is {joints[name].get('type')}: name hips and knees, which"
                " are revolute, as sagittal_joints"
            )
        if joints[name].get("type") == "continuous":
            _bound(path, joints[name])
    hips = _check_axes(path, robot, sagittal_joints)
    root = urdf_edits.root_link(robot)
    urdf_edits.take_points(path, robot)
    _shift(robot, root, hips)
    urdf_edits.spheres(path, robot, feet, foot_radius, foot_offset)
    bases, kinds, parents, _, axes = zip(*PLANAR_BASE, strict=True)
    names, links = _free(bases, joints), _free(parents, named(robot, "link"))
    for link in links:
        ET.SubElement(robot, "link", name=link)
    rows = zip(names, kinds, links, (*links[1:], root), axes, strict=True)
    for name, kind, parent, child, axis in rows:
        joint = ET.SubElement(robot, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        ET.SubElement(joint, "axis", xyz=axis)
        ET.SubElement(joint, "limit", lower="-1e3", upper="1e3", effort="0", velocity="1e3")


def _free(names: Sequence[str], taken: Collection[str]) -> list[str]:
    """Names that no other part of the robot has, by underscores at their ends."""
    found = []
    for name in names:
        while name in taken:
            name += "_"
        found.append(name)
    return found


def _bound(path: Path, joint: ET.Element) -> None:
    """Give a hinge without stops wide ones: an angle is then one number."""
    limit = joint.find("limit")
    if limit is None:
        raise RobotError(f"{path}: joint {joint.get('name')!r} has no limit: give its torque limit")
    joint.set("type", "revolute")
    limit.set("lower", "-10")
    limit.set("upper", "10")


def _check_axes(path: Path, robot: ET.Element, sagittal: Sequence[str]) -> Array:
    """Midpoint (3,) of the hips in the root link's frame [m], once all hinges are lateral."""
    model = build_model(path, ET.tostring(robot, encoding="unicode"))
    data = model.createData()
    jacobians = pin.computeJointJacobians(model, data, pin.neutral(model))
    for name in sagittal:
        index = model.getJointId(name)
        axis = jacobians[3:, model.joints[index].idx_v]
        if not is_lateral(axis):
            raise RobotError(
                f"{path}: joint {name!r} turns about {np.round(axis, 3).tolist()} and not about"
                " the lateral axis y: name hips and knees as sagittal_joints, and lock the others"
                " where the legs are upright"
            )
    hips = [
        data.oMi[model.getJointId(name)].translation
        for name in sagittal
        if model.parents[model.getJointId(name)] == 0
    ]
    return np.mean(hips, axis=0)


def _shift(robot: ET.Element, root: str, hips: Array) -> None:
    """Move the root link's frame to the height of the hips, where the pitch joint is."""
    offset = hips * [1.0, 0.0, 1.0]
    shown = ("inertial", "visual", "collision")
    parts = [part for part in named(robot, "link")[root] if part.tag in shown]
    parts += [joint for joint in robot.findall("joint") if end_of(joint, "parent") == root]
    for part in parts:
        origin = urdf_edits.origin_of(part)
        origin.set("xyz", urdf_edits.vector_text(urdf_edits.vector(origin.get("xyz")) - offset))
