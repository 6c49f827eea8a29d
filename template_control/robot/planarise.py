"""A 3D biped held in its sagittal plane: its URDF rewritten as a planar one.

The rewritten URDF serves Pinocchio, PyBullet and the viewer alike: three base joints (x, z,
pitch) carry the root link, all joints but the hips and knees are fixed where they are locked,
and the feet are spheres. What the plane takes away is only what it holds: masses and inertias
are kept, and forces out of the plane are the guide's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.errors import RobotError
from template_control.robot.urdf import build_model, root_link, strip_motion, take_points

Array = NDArray[np.float64]

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
    """Make a 3D URDF a planar one.

    Args:
        path: of the 3D URDF, for messages.
        robot: its root element; changed.
        feet: the two foot links.
        sagittal_joints: hips and knees, the four hinges about the lateral axis that stay.
        locked: angles [rad] at which other joints are held; 0 for those not named.
        foot_radius: of spheres to put into the feet [m]; None to keep the feet's own.
        foot_offset: of their centres from the feet's origins [m].

    Raises:
        RobotError: if a joint is missing or named twice, or a sagittal joint's axis is not lateral.
    """
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


def _parent(joint: ET.Element) -> str:
    parent = joint.find("parent")
    return str(parent.get("link")) if parent is not None else ""


def _vector(text: str | None, default: str = "0 0 0") -> Array:
    return np.array([float(x) for x in (text or default).split()])


def _origin(element: ET.Element) -> ET.Element:
    origin = element.find("origin")
    return ET.SubElement(element, "origin") if origin is None else origin


def _text(vector: Array) -> str:
    return " ".join(f"{x:.12g}" for x in vector)


def check_joint_names(path: Path, robot: ET.Element, names: Iterable[str]) -> None:
    """Check that joints are there.

    Args:
        path: of the URDF, for the message.
        robot: its root element.
        names: of the joints.

    Raises:
        RobotError: naming the one that is not.
    """
    joints = {str(joint.get("name")) for joint in robot.findall("joint")}
    for name in names:
        if name not in joints:
            raise RobotError(f"{path} has no joint {name!r}: its joints are {sorted(joints)}")


def moving_joints(robot: ET.Element, locked: Collection[str]) -> set[str]:
    """Names of the joints that neither are locked nor mimic a locked one.

    Args:
        robot: the root element of a URDF.
        locked: names of those that are locked.
    """
    leaders = {
        str(joint.get("name")): str(mimic.get("joint"))
        for joint in robot.findall("joint")
        for mimic in joint.findall("mimic")
    }
    held = set(locked)
    for _ in leaders:  # one may mimic another that mimics
        held |= {name for name, leader in leaders.items() if leader in held}
    return {str(joint.get("name")) for joint in robot.findall("joint")} - held


def lock(
    path: Path, robot: ET.Element, moving: Collection[str], locked: Mapping[str, float]
) -> None:
    """Hold joints where they are.

    A joint that mimics a locked one and is not named itself is held at its multiple.

    Args:
        path: of the URDF, for the message.
        robot: its root element; changed.
        moving: names of the joints that stay as they are.
        locked: position of each joint [rad, m]; 0 of those not named.

    Raises:
        RobotError: if a joint that is not named mimics one that moves.
    """
    joints = {str(joint.get("name")): joint for joint in robot.findall("joint")}
    places: dict[str, float] = dict(locked)

    def place(name: str) -> float:
        mimic = joints[name].find("mimic")
        if name not in places and mimic is None:
            places[name] = 0.0
        elif name not in places and mimic is not None:
            leader = str(mimic.get("joint"))
            if leader in moving or leader not in joints:
                state = "moves" if leader in moving else "is not there"
                raise RobotError(
                    f"{path}: joint {name!r} mimics joint {leader!r}, which {state}: name"
                    f" {name!r} among the locked joints"
                )
            places[name] = 0.0  # of a joint that mimics itself
            multiplier = float(mimic.get("multiplier", "1"))
            places[name] = multiplier * place(leader) + float(mimic.get("offset", "0"))
        return places[name]

    held = {n: place(n) for n, j in joints.items() if n not in moving and j.get("type") != "fixed"}
    for name, position in held.items():
        _fix(joints[name], position)


def _fix(joint: ET.Element, position: float) -> None:
    """Turn a joint into a fixed one at ``position`` [rad, m]."""
    origin, axis = _origin(joint), joint.find("axis")
    direction = _vector(axis.get("xyz") if axis is not None else None, "1 0 0") * position
    rotation = pin.rpy.rpyToMatrix(_vector(origin.get("rpy")))
    if joint.get("type") == "prismatic":
        origin.set("xyz", _text(_vector(origin.get("xyz")) + rotation @ direction))
    else:
        origin.set("rpy", _text(pin.rpy.matrixToRpy(rotation @ pin.exp3(direction))))
    joint.set("type", "fixed")
    strip_motion(joint)


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
    parts += [joint for joint in robot.findall("joint") if _parent(joint) == root]
    for part in parts:
        origin = _origin(part)
        origin.set("xyz", _text(_vector(origin.get("xyz")) - offset))


def spheres(
    path: Path,
    robot: ET.Element,
    feet: Sequence[str],
    radius: float | None,
    offset: Sequence[float] | None = None,
) -> None:
    """Leave collision shapes to the feet alone, and give them spheres.

    Args:
        path: of the URDF, for the message.
        robot: its root element; changed.
        feet: names of the foot links.
        radius: of the spheres [m]; None to keep the feet's own shapes.
        offset: (3,) of their centres from the links' origins, in the links' axes [m].

    Raises:
        RobotError: if the radius is not positive, or an offset comes without it.
    """
    if radius is not None and not 0.0 < radius < np.inf:
        raise RobotError(f"foot_radius is {radius!r} m: give a positive number")
    if offset is not None and radius is None:
        raise RobotError(f"{path}: foot_offset places the spheres of foot_radius: give that too")
    for link in robot.findall("link"):
        foot = link.get("name") in feet
        for collision in link.findall("collision"):
            if not foot or radius is not None:
                link.remove(collision)
        if foot and radius is not None:
            collision = ET.SubElement(link, "collision")
            if offset is not None:
                ET.SubElement(collision, "origin", xyz=_text(np.array(offset)))
            geometry = ET.SubElement(collision, "geometry")
            ET.SubElement(geometry, "sphere", radius=f"{radius:g}")
