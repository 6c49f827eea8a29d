"""The same robot in other words: other frames of links, zeros of angles, and lengths of axes."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin


def vector(text, default="0 0 0"):
    return np.array([float(word) for word in (text or default).split()])


def placement(element):
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    return pin.SE3(pin.rpy.rpyToMatrix(vector(origin.get("rpy"))), vector(origin.get("xyz")))


def place(element, pose):
    origin = element.find("origin")
    if origin is None:
        origin = ET.SubElement(element, "origin")
    origin.set("xyz", " ".join(map(repr, pose.translation.tolist())))
    origin.set("rpy", " ".join(map(repr, pin.rpy.matrixToRpy(pose.rotation).tolist())))


@dataclass
class Rewritten:
    """A URDF whose joints have the angles ``sign * (angle - zero)`` of the first one's.

    Attributes:
        text: of the URDF.
        zero: angle of the first one at which each hinge's new angle is 0 [rad].
        sign: -1 where a hinge turns the other way.
    """

    text: str
    zero: dict = field(default_factory=dict)
    sign: dict = field(default_factory=dict)


def rewritten(text, seed, keep=(), turn=True, shift=3.0):
    """Draw other frames and zeros.

    Args:
        text: of a URDF.
        seed: of the draws.
        keep: joints whose zero and sense stay (those of a base).
        turn: whether links' frames are turned, and shifted along the hinges' axes.
        shift: the largest of a zero [rad].
    """
    rng = np.random.default_rng(seed)
    robot = ET.fromstring(text)
    frames = {link.get("name"): pin.SE3.Identity() for link in robot.findall("link")}
    found = Rewritten("")
    for joint in robot.findall("joint"):
        axis = vector(None if joint.find("axis") is None else joint.find("axis").get("xyz"))
        along = rng.uniform(-0.1, 0.1)
        rotation = pin.Quaternion.Identity()
        if turn:
            numbers = rng.normal(size=4)
            rotation = pin.Quaternion(numbers / np.linalg.norm(numbers))
        child = joint.find("child").get("link")
        frames[child] = pin.SE3(rotation.matrix(), along * axis if turn else np.zeros(3))
    for joint in robot.findall("joint"):
        name, pose = joint.get("name"), placement(joint)
        parent, child = (frames[joint.find(end).get("link")] for end in ("parent", "child"))
        zero, sign = 0.0, 1.0
        if joint.get("type") != "fixed":
            axis = vector(joint.find("axis").get("xyz"))
            if name not in keep:
                zero, sign = rng.uniform(-shift, shift), float(rng.choice([-1.0, 1.0]))
            pose = pose * pin.SE3(pin.exp3(axis * zero), np.zeros(3))
            turned = rng.uniform(0.3, 3.0) * sign * child.rotation.T @ axis
            joint.find("axis").set("xyz", " ".join(map(repr, turned.tolist())))
            limit = joint.find("limit")
            ends = sorted(sign * (float(limit.get(end)) - zero) for end in ("lower", "upper"))
            limit.set("lower", repr(ends[0]))
            limit.set("upper", repr(ends[1]))
        found.zero[name], found.sign[name] = zero, sign
        place(joint, parent.inverse() * pose * child)
    for link in robot.findall("link"):
        for part in ("inertial", "visual", "collision"):
            for element in link.findall(part):
                place(element, frames[link.get("name")].inverse() * placement(element))
    found.text = ET.tostring(robot, encoding="unicode")
    return found
