"""Edits of a URDF's text: joints that are locked, limits, feet, meshes, and links without mass."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import Interval, Positive
from template_control.errors import RobotError
from template_control.robot import urdf

_PACKAGE = ("package://", "model://")  # what the name of a package's mesh begins with


def complete(path: Path, robot: ET.Element) -> str:
    """The text of a URDF as all engines read it, once its joints and feet are as they shall be."""
    urdf.check_motion(path, robot)
    urdf.check_inertias(path, robot)
    find_meshes(path, robot)
    urdf.check_shapes(path, robot)
    gather_inertias(robot)
    write_out_massless(robot)
    return ET.tostring(robot, encoding="unicode")


def mimics(robot: ET.Element) -> dict[str, str]:
    """Names of the joints that mimic others, with those of the latter."""
    return {
        str(joint.get("name")): str(mimic.get("joint"))
        for joint in robot.findall("joint")
        for mimic in joint.findall("mimic")
    }


def moving_joints(robot: ET.Element, locked: Collection[str]) -> set[str]:
    """Names of the joints that neither are locked nor mimic a locked one."""
    leaders = mimics(robot)
    held = set(locked)
    for _ in leaders:  # one may mimic another that mimics
        held |= {name for name, leader in leaders.items() if leader in held}
    return urdf.named(robot, "joint").keys() - held


def _carriers(robot: ET.Element, link: str) -> list[ET.Element]:
    """The joints that carry a link, from its own to the root's."""
    above = {urdf.end_of(joint, "child"): joint for joint in robot.findall("joint")}
    found = []
    while link in above:
        found.append(above.pop(link))
        link = urdf.end_of(found[-1], "parent")
    return found


def joints_in_no_leg(robot: ET.Element, feet: Collection[str]) -> set[str]:
    """Names of the joints that move no foot."""
    legs = {str(joint.get("name")) for foot in feet for joint in _carriers(robot, foot)}
    return urdf.named(robot, "joint").keys() - legs


def lock(
    path: Path, robot: ET.Element, moving: Collection[str], locked: Mapping[str, float]
) -> None:
    """Hold all joints but the ``moving`` ones, where ``locked`` says [rad, m] or at 0.

    A joint that mimics a locked one and is not named itself is held at its multiple.
    """
    joints = urdf.named(robot, "joint")
    for name in (*moving, *locked):
        if name not in joints:
            raise RobotError(f"{path} has no joint {name!r}: its joints are {sorted(joints)}")
    places: dict[str, float] = dict(locked)

    def place(name: str) -> float:
        if name in places:
            return places[name]
        mimic, places[name] = joints[name].find("mimic"), 0.0  # also of one that mimics itself
        if mimic is not None:
            leader = str(mimic.get("joint"))
            if leader in moving or leader not in joints:
                state = "moves" if leader in moving else "is not there"
                raise RobotError(
                    f"{path}: joint {name!r} mimics joint {leader!r}, which {state}: name"
                    f" {name!r} among the locked joints"
                )
            multiplier = float(mimic.get("multiplier", "1"))
            places[name] = multiplier * place(leader) + float(mimic.get("offset", "0"))
        return places[name]

    held = {n: place(n) for n, j in joints.items() if n not in moving and j.get("type") != "fixed"}
    for name, position in held.items():
        _fix(joints[name], position)


def _fix(joint: ET.Element, position: float) -> None:
    """Turn a joint into a fixed one at ``position`` [rad, m]."""
    origin, axis = origin_of(joint), joint.find("axis")
    direction = vector(axis.get("xyz") if axis is not None else None, "1 0 0") * position
    rotation = pin.rpy.rpyToMatrix(vector(origin.get("rpy")))
    if joint.get("type") == "prismatic":
        origin.set("xyz", vector_text(vector(origin.get("xyz")) + rotation @ direction))
    else:
        origin.set("rpy", vector_text(pin.rpy.matrixToRpy(rotation @ pin.exp3(direction))))
    joint.set("type", "fixed")
    urdf.strip_motion(joint)


@dataclass(frozen=True)
class JointLimits(Checked):
    """Limits of all joints, in place of the URDF's.

    Attributes:
        torque: the largest [N m].
        velocity: the largest [rad/s].
        ranges: of a leg's joints, from the trunk to the knee [rad]; empty to keep the URDF's.
    """

    torque: Positive
    velocity: Positive
    ranges: tuple[Interval, ...] = ()


def set_limits(path: Path, robot: ET.Element, feet: Sequence[str], limits: JointLimits) -> None:
    """Give all moving joints other limits of torque and velocity, and those of the legs ranges."""
    for joint in robot.findall("joint"):
        if joint.get("type") != "fixed":
            limit = joint.find("limit")
            if limit is None:
                limit = ET.SubElement(joint, "limit", lower="-10", upper="10")
            limit.set("effort", f"{limits.torque:.12g}")
            limit.set("velocity", f"{limits.velocity:.12g}")
    for foot in feet if limits.ranges else ():
        leg = [joint for joint in _carriers(robot, foot) if joint.get("type") != "fixed"]
        if len(leg) != len(limits.ranges):
            raise RobotError(
                f"{path}: {len(leg)} joints move foot {foot!r}, and {len(limits.ranges)} ranges are"
                " given: give one for each joint of a leg"
            )
        for joint, (lower, upper) in zip(reversed(leg), limits.ranges, strict=True):
            for limit in joint.findall("limit"):
                limit.set("lower", f"{lower:.12g}")
                limit.set("upper", f"{upper:.12g}")


def spheres(
    path: Path,
    robot: ET.Element,
    feet: Sequence[str],
    radius: float | None,
    offset: Sequence[float] | None,
) -> None:
    """Leave collision shapes to the feet alone, and give them spheres of this radius [m].

    None keeps the feet's own shapes; ``offset`` (3,) [m] is from the links' origins, in their axes.
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
                ET.SubElement(collision, "origin", xyz=vector_text(np.array(offset)))
            geometry = ET.SubElement(collision, "geometry")
            ET.SubElement(geometry, "sphere", radius=f"{radius:g}")


def find_meshes(path: Path, robot: ET.Element) -> None:
    """Write absolute paths of meshes into a URDF, so that its text can be read from anywhere.

    A relative name counts from the URDF's folder; that of a package from each folder above it, with
    and without the package's name, and from those of ``ROS_PACKAGE_PATH``. A visual whose mesh is
    missing is left out: it is not needed to walk. Of a collision shape it is a RobotError.
    """
    missing = []
    for link in robot.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = str(mesh.get("filename"))
            file = _file(path, name)
            if file is not None:
                mesh.set("filename", str(file))
            elif shape.tag == "visual":
                link.remove(shape)
                missing.append(name)
            else:
                raise RobotError(
                    f"{path}: link {link.get('name')!r}: its collision mesh {name} is missing:"
                    " put it there, or give the link a box, cylinder or sphere"
                )
    if missing:
        urdf.warn_once(
            "%s: %d meshes are missing, the first is %s: the robot walks, and is shown with sticks",
            path,
            len(missing),
            missing[0],
        )


def _file(path: Path, name: str) -> Path | None:
    """The file that a URDF calls ``name``, or None."""
    folder = path.resolve().parent
    package = next((start for start in _PACKAGE if name.startswith(start)), None)
    if package is not None:
        inside = name.removeprefix(package)
        without = inside.partition("/")[2]
        above = [f / part for f in (folder, *folder.parents) for part in (inside, without)]
        places = [*above, *(Path(root) / inside for root in _package_folders(inside))]
    else:
        file = name.removeprefix("file://")
        places = [folder / file, folder / unquote(file)]
    return next((place for place in places if place.is_file()), None)


def _package_folders(inside: str) -> list[str]:
    """Folders of ``ROS_PACKAGE_PATH`` that hold packages, or are the one that a file is in."""
    roots = [root for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if root]
    package = inside.partition("/")[0]
    return [str(Path(r).parent) if Path(r).name == package else r for r in roots]


def take_points(path: Path, robot: ET.Element) -> None:
    """Take links on the trunk whose inertia is no body's for points with their mass; and log it.

    Heads and arms often have such an inertia, and little of the trunk's. That of a root link or of
    a leg counts, and is left for :func:`check_inertias`. All joints but the legs' are fixed.
    """
    links, points = urdf.named(robot, "link"), []
    _, *on_trunk = _fixed_links(robot, root_link(robot))
    for name in on_trunk:
        if urdf.why_impossible(links[name]):
            for inertia in links[name].iterfind("inertial/inertia"):
                inertia.attrib.update(dict.fromkeys(urdf.MOMENTS, "0"))
            points.append(name)
    if points:
        text = (
            "%s: the inertia of %d links on the trunk is no body's (%s): they are taken for points"
        )
        urdf.warn_once(text, path, len(points), ", ".join(points))


def write_out_massless(robot: ET.Element) -> None:
    """Give links without ``<inertial>`` one of zero: PyBullet takes them for a kilogram."""
    for link in robot.findall("link"):
        if link.find("inertial") is None:
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value="0")
            ET.SubElement(inertial, "inertia", dict.fromkeys(urdf.MOMENTS, "0"))


def gather_inertias(robot: ET.Element) -> None:
    """Give a massless link that moves the inertia of all links that are fixed to it.

    Engines take the mass of a rigid body's first link for that of the body: PyBullet holds a robot
    in the air whose root link weighs nothing, and pushes act on the first link's centre of mass.
    """
    links = urdf.named(robot, "link")
    fixed = robot.findall("joint[@type='fixed']")
    for name in sorted(links.keys() - {urdf.end_of(joint, "child") for joint in fixed}):
        if urdf.mass_of(links[name]) > 0.0:
            continue
        frames, total = _fixed_links(robot, name), pin.Inertia.Zero()
        for other, frame in frames.items():
            if other != name:
                total += frame.act(_inertia(links[other]))
        if total.mass > 0.0:
            for link in frames:
                for old in links[link].findall("inertial"):
                    links[link].remove(old)
            _add_inertia(links[name], total)


def _fixed_links(robot: ET.Element, link: str) -> dict[str, pin.SE3]:
    """Frames in that of a link, of itself and of the links that are fixed to it."""
    found, waiting = {link: pin.SE3.Identity()}, [link]
    while waiting:
        parent = waiting.pop()
        for joint in robot.findall("joint[@type='fixed']"):
            child = urdf.end_of(joint, "child")
            if urdf.end_of(joint, "parent") == parent and child not in found:
                found[child] = found[parent] * _placement(joint)
                waiting.append(child)
    return found


def _placement(element: ET.Element | None) -> pin.SE3:
    """Frame of the ``<origin>`` of a joint or of an ``<inertial>``."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    return pin.SE3(pin.rpy.rpyToMatrix(vector(origin.get("rpy"))), vector(origin.get("xyz")))


def _inertia(link: ET.Element) -> pin.Inertia:
    """A link's inertia in its own frame."""
    own = pin.Inertia(urdf.mass_of(link), np.zeros(3), urdf.tensor_of(link))
    return _placement(link.find("inertial")).act(own)


def _add_inertia(link: ET.Element, inertia: pin.Inertia) -> None:
    """Give a link without ``<inertial>`` one."""
    inertial = ET.SubElement(link, "inertial")
    # Python's own digits: no other text gives the same number again, in no locale.
    ET.SubElement(inertial, "origin", xyz=" ".join(map(repr, inertia.lever.tolist())))
    ET.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    tensor = inertia.inertia[np.triu_indices(3)].tolist()
    ET.SubElement(inertial, "inertia", dict(zip(urdf.MOMENTS, map(repr, tensor), strict=True)))


def root_link(robot: ET.Element) -> str:
    """The link that is no joint's child."""
    children = {child.get("link") for child in robot.findall("joint/child")}
    return next((name for name in urdf.named(robot, "link") if name not in children), "")


def origin_of(element: ET.Element) -> ET.Element:
    """The ``<origin>`` of an element, added where there is none."""
    origin = element.find("origin")
    return ET.SubElement(element, "origin") if origin is None else origin


def vector(text: str | None, default: str = "0 0 0") -> Array:
    """Numbers of an attribute; ``default`` where it is absent."""
    return np.array([float(x) for x in (text or default).split()])


def vector_text(numbers: Array) -> str:
    """Text of an attribute, with 12 digits."""
    return " ".join(f"{x:.12g}" for x in numbers)
