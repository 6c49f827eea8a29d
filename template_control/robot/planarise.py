"""A 3D biped held in its sagittal plane: its URDF rewritten as a planar one.

The rewritten URDF serves Pinocchio, PyBullet and the viewer alike: three base joints (x, z,
pitch) carry the root link, all joints but the hips and knees are fixed where they are locked,
and the feet are spheres. What the plane takes away is only what it holds: masses and inertias
are kept, and forces out of the plane are the guide's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.errors import RobotError
from template_control.robot.urdf import build_model, end_of
from template_control.robot.urdf_edits import (
    check_joint_names,
    lock,
    origin_of,
    root_link,
    spheres,
    take_points,
    vector,
    vector_text,
)

_BASE = (
    ("base_x", "prismatic", "1 0 0"),
    ("base_z", "prismatic", "0 0 1"),
    ("base_pitch", "revolute", "0 1 0"),
)
_WORLD = ("world", "slide_x", "slide_z")
_SAGITTAL = 4  # joints that stay
_HINGES = ("revolute", "continuous")


def planarise(
    path: Path,
    robot: ET.Element,
    feet: Sequence[str],
    sagittal_joints: Sequence[str],
    locked: Mapping[str, float],
    foot_radius: float | None,
    foot_offset: Sequence[float] | None = None,
) -> None:
    """Make a 3D URDF a planar one, in place; arguments as of :meth:`PlanarBiped.from_urdf`."""
    if len(set(sagittal_joints)) != _SAGITTAL:
        raise RobotError(
            f"{path}: sagittal_joints are {list(sagittal_joints)}: name {_SAGITTAL} different"
            " hinges in its legs: a hip and a knee each"
        )
    joints = {str(joint.get("name")): joint for joint in robot.findall("joint")}
    check_joint_names(path, robot, (*sagittal_joints, *locked))
    for name in sagittal_joints:
        if joints[name].get("type") not in _HINGES:
            raise RobotError(
                f"{path}: joint {name!r} is {joints[name].get('type')}: name hips and knees, which"
                " are revolute, as sagittal_joints"
            )
    lock(path, robot, sagittal_joints, locked)
    for name in sagittal_joints:
        if joints[name].get("type") == "continuous":
            _bound(path, joints[name])
    hips = _check_axes(path, robot, sagittal_joints)
    root = root_link(robot)
    take_points(path, robot)
    _shift(robot, root, hips)
    spheres(path, robot, feet, foot_radius, foot_offset)
    links = _free(_WORLD, {str(link.get("name")) for link in robot.findall("link")})
    for link in links:
        ET.SubElement(robot, "link", name=link)
    names = _free([name for name, _, _ in _BASE], joints)
    rows = zip(names, _BASE, links, (*links[1:], root), strict=True)
    for name, (_, kind, axis), parent, child in rows:
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
        if abs(abs(axis[1]) - 1.0) > 1e-6:
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
    parts = [e for link in robot.findall("link") if link.get("name") == root for e in link]
    parts = [e for e in parts if e.tag in ("inertial", "visual", "collision")]
    parts += [joint for joint in robot.findall("joint") if end_of(joint, "parent") == root]
    for part in parts:
        origin = origin_of(part)
        origin.set("xyz", vector_text(vector(origin.get("xyz")) - offset))
