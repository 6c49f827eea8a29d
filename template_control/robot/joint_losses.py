"""What joints lose: viscous damping and dry friction, from the URDF's ``<dynamics>``."""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from template_control.errors import RobotError
from template_control.robot.requirements import BASE_DOF

_LOG = logging.getLogger(__name__)
_LOSSES = ("damping", "friction")
# Not URDF's own; written by some tools, and PyBullet has nothing that would do the same.
_ROTORS = ("armature", "rotor_inertia", "rotorInertia")


def read_losses(path: Path, robot: ET.Element, lossless: bool) -> None:
    """Check the joints' ``<dynamics>``, or remove it.

    Rotor inertias are ignored, and the log says so once.

    Args:
        path: of the URDF, for messages.
        robot: its root element; changed: a ``<dynamics>`` that tells no loss is removed.
        lossless: whether all of them are.

    Raises:
        RobotError: naming the joint whose damping or friction is no number, or below zero.
    """
    _tell_rotors(path, robot)
    for joint in robot.findall("joint"):
        for dynamics in joint.findall("dynamics"):
            told = [name for name in _LOSSES if dynamics.get(name) is not None]
            for name in told:
                text = str(dynamics.get(name))
                if not _is_loss(text):
                    raise RobotError(
                        f"{path}: joint {joint.get('name')!r}: dynamics has {name} {text!r}: give a"
                        " finite number, not below zero"
                    )
            if lossless or not told:
                joint.remove(dynamics)


def check_guide(path: Path, model: pin.Model) -> None:
    """Check that the joints of a planar robot's base lose nothing: the guide only holds it.

    Args:
        path: of the URDF, for the message.
        model: of the robot.

    Raises:
        RobotError: naming the joint that does.
    """
    for joint in range(BASE_DOF):
        if model.damping[joint] > 0.0 or model.upperDryFrictionLimit[joint] > 0.0:
            raise RobotError(
                f"{path}: base joint {model.names[1 + joint]!r} has damping or friction: leave them"
                " out, as lossless does for all joints"
            )


def _is_loss(text: str) -> bool:
    try:
        return 0.0 <= float(text) < np.inf
    except ValueError:
        return False


def _tell_rotors(path: Path, robot: ET.Element) -> None:
    """Log the first joint or transmission that tells a rotor's inertia."""
    for part in (*robot.findall("joint"), *robot.findall("transmission")):
        for element in part.iter():
            local = element.tag.rpartition("}")[2]
            if local in _ROTORS or any(name in element.attrib for name in _ROTORS):
                _log_rotor(path, str(part.get("name")))
                return


@cache
def _log_rotor(path: Path, name: str) -> None:
    _LOG.warning(
        "%s: the rotor inertia of %r is ignored, as all others: PyBullet has none",
        path,
        name,
    )
