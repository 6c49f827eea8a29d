"""Links that are fixed to each other are one rigid body: which of them has its mass.

Engines take the mass of a body's first link for that of the body: PyBullet holds a robot in the
air whose root link weighs nothing, and pushes act on the first link's centre of mass. Links keep
their names, frames and shapes; where the first one of a body has a mass of its own, the text of
the URDF stays as it is.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import defaultdict

import numpy as np
import pinocchio as pin

from template_control.robot.urdf import MOMENTS


def drop_world(robot: ET.Element) -> None:
    """Remove a massless root link that carries nothing but a floating joint, and that joint.

    Some URDFs write down that the robot floats in a world; here the root link floats anyway.

    Args:
        robot: the root element of a URDF; changed.
    """
    links = {link.get("name"): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    children = {_end(joint, "child") for joint in joints}
    for joint in joints:
        parent = _end(joint, "parent")
        alone = sum(_end(other, "parent") == parent for other in joints) == 1
        is_root = parent not in children and _inertia(links[parent]).mass == 0.0
        if joint.get("type") == "floating" and alone and is_root:
            robot.remove(joint)
            robot.remove(links[parent])


def gather_inertias(robot: ET.Element) -> None:
    """Give a massless link that moves the inertia of all links that are fixed to it.

    Args:
        robot: the root element of a URDF; changed. The links that gave their inertia have none.
    """
    links = {str(link.get("name")): link for link in robot.findall("link")}
    fixed = defaultdict(list)
    for joint in robot.findall("joint"):
        if joint.get("type") == "fixed":
            fixed[_end(joint, "parent")].append(joint)
    first = links.keys() - {_end(joint, "child") for group in fixed.values() for joint in group}
    for name in sorted(first):
        if _inertia(links[name]).mass > 0.0:
            continue
        total, found = pin.Inertia.Zero(), {name: pin.SE3.Identity()}
        waiting = [name]
        while waiting:
            parent = waiting.pop()
            for joint in fixed[parent]:
                child = _end(joint, "child")
                if child in found:  # a loop: Pinocchio says so
                    continue
                found[child] = found[parent] * _placement(joint)
                total += found[child].act(_inertia(links[child]))
                waiting.append(child)
        if total.mass > 0.0:
            for link in found:
                _set_inertia(links[link], total if link == name else None)


def _end(joint: ET.Element, end: str) -> str:
    """Name of a joint's parent or child link."""
    element = joint.find(end)
    return "" if element is None else str(element.get("link"))


def _placement(element: ET.Element | None) -> pin.SE3:
    """Where the ``<origin>`` of a joint or of an ``<inertial>`` is."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = (
        np.array([float(word) for word in origin.get(name, "0 0 0").split()])
        for name in ("xyz", "rpy")
    )
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)


def _inertia(link: ET.Element) -> pin.Inertia:
    """A link's inertia in its own frame."""
    mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
    if mass is None or inertia is None:
        return pin.Inertia.Zero()
    xx, xy, xz, yy, yz, zz = (float(inertia.get(name, "0")) for name in MOMENTS)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    own = pin.Inertia(float(mass.get("value", "0")), np.zeros(3), tensor)
    return _placement(link.find("inertial")).act(own)


def _set_inertia(link: ET.Element, inertia: pin.Inertia | None) -> None:
    """Replace a link's ``<inertial>``; None: it has none."""
    for old in link.findall("inertial"):
        link.remove(old)
    if inertia is None:
        return
    inertial = ET.SubElement(link, "inertial")
    # Python's own digits: no other text gives the same number again, in no locale.
    ET.SubElement(inertial, "origin", xyz=" ".join(map(repr, inertia.lever.tolist())))
    ET.SubElement(inertial, "mass", value=repr(float(inertia.mass)))
    tensor = inertia.inertia[np.triu_indices(3)].tolist()
    ET.SubElement(inertial, "inertia", dict(zip(MOMENTS, map(repr, tensor), strict=True)))
