"""Reading and checks of a URDF: what Pinocchio and PyBullet would read otherwise is refused.

Both libraries pass over a number they cannot read and go on without it, each in its own way:
what is not checked here is a robot that falls for no reason.
"""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.errors import RobotError

_LOG = logging.getLogger(__name__)

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Of an ``<inertia>``: the upper triangle, row by row."""

_XACRO = "ros.org/wiki/xacro"  # in the names of xacro's own elements
_ABOUT_AXIS = ("revolute", "continuous", "prismatic", "planar")
_RANGED = ("revolute", "prismatic")
_ENDS = ("lower", "upper")
_LIMITS = ("lower", "upper", "effort", "velocity")
_ROUND = {"radius": 1, "length": 1}
_SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": _ROUND, "capsule": _ROUND}
_LOSSES = ("damping", "friction")
# Not URDF's own; written by some tools, and PyBullet has nothing that would do the same.
_ROTORS = {"armature", "rotor_inertia", "rotorInertia"}
_ROUNDING = 1e-6  # of a link's largest moment of inertia: URDFs are written with few digits


def read_urdf(path: Path, lossless: bool = False) -> ET.Element:
    """The root element of a URDF; entities of its DTD are replaced, whatever its encoding.

    Axes are made as long as 1, which PyBullet takes them for; of fixed joints they are removed, and
    a ``<dynamics>`` that states no loss, or any if the robot is to be ``lossless``. A massless root
    link that carries nothing but a floating joint is removed: the robot floats anyway.
    """
    if not path.is_file():
        raise RobotError(f"there is no URDF at {path}: give the path of a robot's .urdf file")
    try:
        robot = ET.fromstring(path.read_bytes())
    except (OSError, ValueError, LookupError, ET.ParseError) as error:
        raise RobotError(f"{path} is no URDF that can be read ({_line(error)})") from None
    if robot.tag != "robot":
        raise RobotError(f"{path} is no URDF: its root is <{robot.tag}> and not <robot>")
    if path.suffix == ".xacro" or any(_XACRO in element.tag for element in robot.iter()):
        raise RobotError(
            f"{path} is a xacro file: run xacro first, as in `xacro robot.urdf.xacro > robot.urdf`"
        )
    _check_names(path, robot)
    for link in robot.findall("link"):
        _check_inertial(path, link)
    for joint in robot.findall("joint"):
        _check_joint(path, joint)
    _drop_world(robot)
    _log_rotors(path, robot)
    for joint in robot.findall("joint"):
        _check_losses(path, joint, lossless)
    return robot


def named(robot: ET.Element, kind: str) -> dict[str, ET.Element]:
    """The elements of a ``kind``, ``link`` or ``joint``, by their names."""
    return {str(part.get("name")): part for part in robot.findall(kind)}


def _drop_world(robot: ET.Element) -> None:
    links, joints = named(robot, "link"), robot.findall("joint")
    parents = [end_of(joint, "parent") for joint in joints]
    children = {end_of(joint, "child") for joint in joints}
    for joint, parent in zip(joints, parents, strict=True):
        is_root = parent not in children and mass_of(links[parent]) == 0.0
        if joint.get("type") == "floating" and parents.count(parent) == 1 and is_root:
            robot.remove(joint)
            robot.remove(links[parent])


def build_model(path: Path, urdf: str, floating: bool = False) -> pin.Model:
    """Pinocchio's model of a URDF's text, its root link held or ``floating``.

    A RobotError if Pinocchio does not read it.
    """
    try:
        return pin.buildModelFromXML(urdf, *([pin.JointModelFreeFlyer()] if floating else []))
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{path} is no URDF that Pinocchio reads ({_line(error)})") from None


def collision_shapes(path: Path, urdf: str, model: pin.Model, mend: str) -> pin.GeometryModel:
    """Collision shapes of a URDF's text; a RobotError with a ``mend`` if a mesh cannot be read."""
    try:
        return pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise RobotError(
            f"{path}: a collision mesh cannot be read ({_line(error)}): give {mend}"
        ) from None


def end_of(joint: ET.Element, end: str) -> str:
    """Name of the link at an end of a joint, ``parent`` or ``child``; "" where none is named."""
    element = joint.find(end)
    return "" if element is None else str(element.get("link"))


def strip_motion(joint: ET.Element) -> None:
    """Remove from a fixed joint what says how it moves."""
    for name in ("axis", "limit", "dynamics", "mimic", "safety_controller", "calibration"):
        for element in joint.findall(name):
            joint.remove(element)


def check_motion(path: Path, robot: ET.Element) -> None:
    """Check that the joints that are left to move have a range, and move by themselves."""
    for joint in robot.findall("joint"):
        where = f"{path}: joint {joint.get('name')!r}"
        mimic = joint.find("mimic")
        if mimic is not None:
            raise RobotError(
                f"{where} mimics joint {mimic.get('joint')!r}, which is not simulated: make it"
                " fixed, lock it with its leader, or remove its <mimic> if it has a motor"
            )
        for limit in joint.findall("limit") if joint.get("type") in _RANGED else ():
            lower, upper = (float(limit.get(name, "0")) for name in _ENDS)
            if lower < upper:
                continue
            missing = " and no ".join(name for name in _ENDS if limit.get(name) is None)
            wrong = f" has lower {lower:g} and upper {upper:g}: give a"
            if missing:
                wrong = f": limit has no {missing}: give the"
            raise RobotError(f"{where}{wrong} range that it can turn in")


def mass_of(link: ET.Element) -> float:
    """Mass of a link [kg], 0 without ``<inertial>``."""
    mass = link.find("inertial/mass")
    return 0.0 if mass is None else float(mass.get("value", "0"))


def tensor_of(link: ET.Element) -> Array:
    """(3, 3) inertia of a link, as it states it [kg m^2]; 0 without ``<inertial>``."""
    inertia = link.find("inertial/inertia")
    given = {} if inertia is None else inertia.attrib
    xx, xy, xz, yy, yz, zz = (float(given.get(name, "0")) for name in MOMENTS)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def check_bodies(path: Path, robot: ET.Element, model: pin.Model, first: int) -> None:
    """Check that whatever a joint moves weighs something, from Pinocchio's joint ``first`` on."""
    joints = named(robot, "joint")
    for index in range(first, model.njoints):
        if model.inertias[index].mass <= 0.0 and model.names[index] in joints:
            raise RobotError(
                f"{path}: link {end_of(joints[model.names[index]], 'child')!r} weighs nothing, and"
                " so does what is fixed to it: give it an <inertial> with its mass"
            )


def check_shapes(path: Path, robot: ET.Element) -> None:
    """Check that shapes which touch the ground have a size."""
    for link in robot.findall("link"):
        for shape in link.iterfind("collision/geometry/*"):
            for name, count in _SIZES.get(shape.tag, {}).items():
                where = f"{path}: link {link.get('name')!r}: collision {shape.tag}"
                if _numbers(where, shape, name, count).min() <= 0.0:
                    raise RobotError(
                        f"{where} has {name} {shape.get(name)!r}: give a positive number"
                    )


def check_inertias(path: Path, robot: ET.Element) -> None:
    """Check that inertias are those of bodies."""
    for link in robot.findall("link"):
        reason = why_impossible(link)
        if reason:
            raise RobotError(f"{path}: link {link.get('name')!r}: {reason}")


def why_impossible(link: ET.Element) -> str:
    """The reason for which a link's inertia is no body's; "" if it may be."""
    moments = np.linalg.eigvalsh(tensor_of(link))
    slack = _ROUNDING * np.abs(moments).max()
    if moments[0] < -slack:
        return "its inertia has a negative principal moment: give none"
    if moments[2] > moments[0] + moments[1] + slack:
        return (
            f"its inertia is no body's: the principal moment {moments[2]:.4g} kg m^2 is"
            f" larger than the sum of the others, {moments[0] + moments[1]:.4g}; give all three"
        )
    return ""


def _check_losses(path: Path, joint: ET.Element, lossless: bool) -> None:
    for dynamics in joint.findall("dynamics"):
        given = [(name, dynamics.get(name, "0")) for name in _LOSSES if name in dynamics.attrib]
        for name, text in given:
            if not 0.0 <= _number(text) < np.inf:
                raise RobotError(
                    f"{path}: joint {joint.get('name')!r}: dynamics has {name} {text!r}: give a"
                    " finite number, not below zero"
                )
        if lossless or not given:
            joint.remove(dynamics)


def _number(text: str) -> float:
    """The number that a text is; NaN if it is none."""
    try:
        return float(text)
    except ValueError:
        return np.nan


def _log_rotors(path: Path, robot: ET.Element) -> None:
    """Log the first joint or transmission that has a rotor's inertia."""
    for part in (*robot.findall("joint"), *robot.findall("transmission")):
        for element in part.iter():
            if _ROTORS & {element.tag.rpartition("}")[2], *element.attrib}:
                text = "%s: the rotor inertia of %r is ignored, as all others: PyBullet has none"
                warn_once(text, path, str(part.get("name")))
                return


@cache
def warn_once(text: str, *values: object) -> None:
    """Log a warning, once for each text with its values."""
    _LOG.warning(text, *values)


def _line(error: Exception) -> str:
    text = str(error).strip()
    return text.splitlines()[0] if text else "unreadable"


def _check_names(path: Path, robot: ET.Element) -> None:
    links = [str(link.get("name")) for link in robot.findall("link")]
    joints = [str(joint.get("name")) for joint in robot.findall("joint")]
    for kind, names in (("link", links), ("joint", joints)):
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise RobotError(f"{path} has two {kind}s {twice[0]!r}: give each its own name")
    for joint in robot.findall("joint"):
        for end in ("parent", "child"):
            element = joint.find(end)
            name = None if element is None else element.get("link")
            if name not in links:
                raise RobotError(
                    f"{path}: joint {joint.get('name')!r} has no {end} link {name!r}: its links"
                    f" are {links}"
                )
    children = Counter(end_of(joint, "child") for joint in robot.findall("joint"))
    for name, count in children.items():
        if count > 1:
            raise RobotError(f"{path}: link {name!r} is the child of {count} joints: cut the loop")
    if len(children) == len(links):
        raise RobotError(f"{path}: each link is a joint's child: one is to be the root")


def _numbers(where: str, element: ET.Element, name: str, count: int, default: str = "") -> Array:
    """(count,) finite numbers of an attribute; a RobotError if it has not as many."""
    text = element.get(name, default)
    values = np.array([_number(word) for word in text.split()])
    if len(values) != count or not np.isfinite(values).all():
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        hint = "; run xacro first" if "$" in text else ""
        raise RobotError(f"{where} has {name} {text!r}: give {wanted}{hint}")
    return values


def _check_origin(where: str, element: ET.Element) -> None:
    for origin in element.findall("origin"):
        for name in ("xyz", "rpy"):
            _numbers(f"{where}: origin", origin, name, 3, "0 0 0")


def _check_inertial(path: Path, link: ET.Element) -> None:
    where = f"{path}: link {link.get('name')!r}"
    inertial = link.find("inertial")
    for part in (*link.findall("visual"), *link.findall("collision"), inertial):
        if part is not None:
            _check_origin(f"{where}: {part.tag}", part)
    if inertial is None:
        return
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise RobotError(f"{where}: <inertial> lacks <mass> or <inertia>: give both")
    if _numbers(f"{where}: mass", mass, "value", 1)[0] < 0.0:
        raise RobotError(f"{where}: mass has value {mass.get('value')!r}: give none below zero")
    for name in MOMENTS:  # Pinocchio passes over an <inertial> that lacks one
        inertia.set(name, inertia.get(name, "0"))
        _numbers(f"{where}: inertia", inertia, name, 1)


def _check_joint(path: Path, joint: ET.Element) -> None:
    where = f"{path}: joint {joint.get('name')!r}"
    _check_origin(where, joint)
    if joint.get("type") == "fixed":
        strip_motion(joint)
    for axis in joint.findall("axis"):
        direction = _numbers(f"{where}: axis", axis, "xyz", 3, "1 0 0")
        length = float(np.linalg.norm(direction))
        if length == 0.0 and joint.get("type") in _ABOUT_AXIS:
            raise RobotError(f"{where}: axis is 0 0 0: give its direction")
        if length not in (0.0, 1.0):
            axis.set("xyz", " ".join(map(repr, (direction / length).tolist())))
    for mimic in joint.findall("mimic"):
        _numbers(f"{where}: mimic", mimic, "multiplier", 1, "1")
        _numbers(f"{where}: mimic", mimic, "offset", 1, "0")
    for limit in joint.findall("limit"):
        for name, most in (("effort", "torque or force"), ("velocity", "speed")):
            if limit.get(name) is None:
                raise RobotError(f"{where}: limit has no {name}: give the joint's largest {most}")
        for name in _LIMITS:
            text = limit.get(name, "0")
            if np.isnan(_number(text)):
                raise RobotError(f"{where}: limit has {name} {text!r}: give a number")


def with_masses(path: Path, urdf: str, masses: Mapping[str, float]) -> str:
    """The text of a URDF with other masses by link [kg], and with inertias in proportion."""
    robot = ET.fromstring(urdf)
    links = {name: link for name, link in named(robot, "link").items() if mass_of(link) > 0.0}
    for name, mass in masses.items():
        if name not in links:
            raise RobotError(f"{path}: no link {name} with a mass: give some of {', '.join(links)}")
        ratio = mass / mass_of(links[name])
        for element in links[name].iterfind("inertial/*"):
            for key in {"mass": ("value",), "inertia": MOMENTS}.get(element.tag, ()):
                element.set(key, repr(ratio * float(element.get(key, "0"))))
    return ET.tostring(robot, encoding="unicode")
