"""The robots that come with the library."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from template_control.checks.checked import checked
from template_control.errors import RobotError, meant
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import LEGS
from template_control.robot.urdf_edits import JointLimits

AnyBiped = TypeVar("AnyBiped", PlanarBiped, FloatingBaseBiped)

_FILES = (".urdf", ".xacro")
_PACKAGE = Path(__file__).resolve().parents[1]


class _Entry(NamedTuple):
    """A robot's URDF and how it is loaded."""

    file: str
    about: str
    distribution: str = ""  # the Python package that brings the URDF; "" for ours
    planar: Mapping[str, Any] | None = None  # of from_urdf; None: it has no planar model
    floating: Mapping[str, Any] | None = None  # the same; None: its base cannot float


# Bolt's actuator, the module of the Open Dynamic Robot Initiative (Grimminger et al., "An open
# torque-controlled modular robot architecture for legged locomotion research", 2020): a motor of
# 0.025 N m/A and 300 rpm/V behind belts of 9:1, 12 A at most, 24 V. Ranges: those that the
# initiative's driver lets the real robot's joints have (odri_control_interface, config_bolt.yaml).
_BOLT_ACTUATOR = JointLimits(
    torque=0.025 * 9.0 * 12.0,
    velocity=300.0 * 24.0 / 9.0 * np.pi / 30.0,
    ranges=((-1.0, 1.0), (-1.9, 1.9), (-3.4, 3.4)),
)

# Solo12 has the same modules; ranges: those of its file there (config_solo12.yaml), but that knees
# bend behind only, as Go2's. Ahead, its running trot became faster from step to step.
_SOLO_ACTUATOR = replace(_BOLT_ACTUATOR, ranges=((-0.9, 0.9), (-1.45, 1.45), (-2.8, 0.0)))

_OTHERS = "example-robot-data"
_HINGES = ("left_hip", "left_knee", "right_hip", "right_knee")
_ENTRIES = {
    "five-link": _Entry(
        "five_link.urdf", "light legs, as robots built for the SLIP have them", planar={}
    ),
    "runner": _Entry("runner.urdf", "five-link of 65 kg with actuators for 5 m/s", planar={}),
    "human": _Entry(
        "human.urdf",
        "Winter's fractions of 80 kg and 1.80 m",
        planar={"walk": (np.radians(66.0), 0.303)},
    ),
    "rabbit": _Entry(
        "rabbit.urdf",
        "RABBIT of Grenoble, five links, 62 % of its mass in the legs",
        planar={"walk": (np.radians(68.0), 0.271)},
    ),
    "bolt": _Entry(
        "bolt.urdf",
        "the point-foot biped of example-robot-data, held in its sagittal plane",
        _OTHERS,
        planar={
            "feet": ("FL_FOOT", "FR_FOOT"),
            "sagittal_joints": ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE"),
            "foot_radius": 0.016,
        },
        floating={
            "feet": ("FL_FOOT", "FR_FOOT"),
            "foot_radius": 0.016,
            "limits": _BOLT_ACTUATOR,
        },
    ),
    "five-link-3d": _Entry(
        "five_link_3d.urdf",
        "five-link with hip ab- and adduction",
        planar={"sagittal_joints": _HINGES},
        floating={},
    ),
    "runner-3d": _Entry(
        "runner_3d.urdf",
        "runner with hip ab- and adduction",
        planar={"sagittal_joints": _HINGES},
        floating={},
    ),
    "go2": _Entry(
        "go2.urdf",
        "Unitree's quadruped of example-robot-data, which trots",
        _OTHERS,
        floating={
            "feet": ("FL_foot", "FR_foot", "RL_foot", "RR_foot"),
            "foot_radius": 0.022,
        },
    ),
    "solo12": _Entry(
        "solo12.urdf",
        "the Open Dynamic Robot Initiative's quadruped of example-robot-data, which trots",
        _OTHERS,
        floating={
            "feet": ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"),
            "foot_radius": 0.016,
            "limits": _SOLO_ACTUATOR,
        },
    ),
    "g1": _Entry(
        "g1_29dof_rev_1_0.urdf",
        "Unitree's humanoid of example-robot-data, on flat feet, arms and waist held",
        _OTHERS,
        floating={
            "feet": ("left_ankle_roll_link", "right_ankle_roll_link"),
            "flat_feet": True,
        },
    ),
    "talos": _Entry(
        "talos_reduced.urdf",
        "PAL Robotics' humanoid of example-robot-data, on flat feet, arms and waist held",
        _OTHERS,
        floating={"feet": ("leg_left_6_link", "leg_right_6_link"), "flat_feet": True},
    ),
}
_FLOATING = {name: e.floating for name, e in _ENTRIES.items() if e.floating is not None}

SHIPPED: dict[str, str] = {name: entry.about for name, entry in _ENTRIES.items()}
"""Names of all robots, with a line about each."""

ROBOTS: dict[str, str] = {
    name: SHIPPED[name] for name, e in _ENTRIES.items() if e.planar is not None
}
"""Names that :func:`load_robot` knows, with a line about each."""

FLOATING_ROBOTS = tuple(_FLOATING)
"""Names that :func:`load_floating_robot` knows."""

FLAT_FEET = tuple(name for name, given in _FLOATING.items() if "flat_feet" in given)
"""Those of them that stand on soles."""

QUADRUPEDS = tuple(n for n, given in _FLOATING.items() if len(given.get("feet", ())) > LEGS)
"""Those of them that have four legs."""


def robots() -> dict[str, str]:
    """Names of all robots that come with the library, with a line about each.

    Those of :data:`ROBOTS` have a planar model, those of :data:`FLOATING_ROBOTS` a floating base.
    """
    return dict(SHIPPED)


@checked
def robot_path(name: str) -> Path:
    """The URDF of a shipped robot, from a wheel or from a checkout.

    Raises:
        RobotError: if there is no such robot.
    """
    if name not in _ENTRIES:
        near, names = meant(name, SHIPPED), ", ".join(SHIPPED)
        raise RobotError(f"there is no robot {name!r}{near}: give one of {names}, or a URDF file")
    entry = _ENTRIES[name]
    # A wheel carries our folder inside the package, a checkout next to it.
    candidates = [root / "robots" / entry.file for root in (_PACKAGE, _PACKAGE.parent)]
    if entry.distribution:
        with suppress(importlib.metadata.PackageNotFoundError):
            files = importlib.metadata.files(entry.distribution) or []
            candidates = [Path(str(f.locate())) for f in files if f.name == entry.file]
    for path in candidates:
        if path.is_file():
            return path
    raise RobotError(
        f"{entry.file} is missing from this installation: reinstall"
        f" {entry.distribution or 'the library'}"
    )


def _load(name: str | Path, kind: type[AnyBiped], **more: Any) -> AnyBiped:
    """A shipped robot by the name that users know it by, or any by the path of its URDF."""
    text = str(name)
    if text.lstrip("\ufeff \n").startswith("<"):
        raise RobotError(
            "a robot's name or the path of its URDF is wanted, not the URDF's text: write it to a"
            " file, and give the file's path"
        )
    if text not in _ENTRIES and (text.endswith(_FILES) or "/" in text):
        return kind.from_urdf(text, **more)
    path, entry = robot_path(text), _ENTRIES[text]
    given = entry.planar if kind is PlanarBiped else entry.floating
    if given is None and kind is PlanarBiped:
        raise RobotError(f"robot {text!r} has no planar model: load it with load_floating_robot")
    if given is None:
        raise RobotError(
            f"robot {text!r} has no model with a floating base: give one of"
            f" {list(FLOATING_ROBOTS)} or a URDF file"
        )
    robot = kind.from_urdf(path, **given, **more)
    robot.model.name = robot.name = text  # not its URDF's
    return robot


@checked
def load_robot(name: str | Path) -> PlanarBiped:
    """A shipped robot by name, or any planar biped by the path of its URDF.

    Raises:
        RobotError: if there is no such robot or file, or it is no planar biped.
    """
    return _load(name, PlanarBiped)


@checked
def load_floating_robot(name: str | Path, *, upper_body: bool = False) -> FloatingBaseBiped:
    """A shipped robot by name, or any biped by the path of its URDF, with a floating base.

    Args:
        name: of the robot, or the path.
        upper_body: see :meth:`FloatingBaseBiped.from_urdf`.

    Raises:
        RobotError: if there is no such robot or file, or it is planar.
    """
    return _load(name, FloatingBaseBiped, upper_body=upper_body)
