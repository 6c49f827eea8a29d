"""The robots that come with the library."""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from template_control.checks.checked import checked
from template_control.errors import RobotError, meant
from template_control.robot.floating_biped import FloatingBaseBiped, JointLimits
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import LEGS

AnyBiped = TypeVar("AnyBiped", PlanarBiped, FloatingBaseBiped)

_FILES = (".urdf", ".xacro")
_PACKAGE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class _Entry:
    """A robot's URDF and how it is loaded.

    Attributes:
        file: name of the URDF.
        about: one line.
        distribution: the Python package that brings the URDF; "" for ours.
        feet, sagittal_joints, foot_radius, walk: see :meth:`PlanarBiped.from_urdf`.
        planar: whether it is held in its sagittal plane, unless it is to have a floating base.
        free: whether it has a model with a floating base.
        limits: of a robot with a floating base, in place of the URDF's; None to keep those.
        flat: whether it has flat feet.
    """

    file: str
    about: str
    distribution: str = ""
    feet: tuple[str, ...] = ("left_foot", "right_foot")
    sagittal_joints: tuple[str, ...] = ()
    foot_radius: float | None = None
    walk: tuple[float, float] | None = None
    planar: bool = True
    free: bool = False
    limits: JointLimits | None = None
    flat: bool = False


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

_CORNERS = ("FL", "FR", "RL", "RR")  # as Unitree names the legs of a quadruped

_ENTRIES = {
    "five-link": _Entry("five_link.urdf", "light legs, as robots built for the SLIP have them"),
    "runner": _Entry("runner.urdf", "five-link of 65 kg with actuators for 5 m/s"),
    "human": _Entry(
        "human.urdf", "Winter's fractions of 80 kg and 1.80 m", walk=(np.radians(66.0), 0.303)
    ),
    "rabbit": _Entry(
        "rabbit.urdf",
        "RABBIT of Grenoble, five links, 62 % of its mass in the legs",
        walk=(np.radians(68.0), 0.271),
    ),
    "bolt": _Entry(
        "bolt.urdf",
        "the point-foot biped of example-robot-data, held in its sagittal plane",
        distribution="example-robot-data",
        feet=("FL_FOOT", "FR_FOOT"),
        sagittal_joints=("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE"),
        foot_radius=0.016,
        free=True,
        limits=_BOLT_ACTUATOR,
    ),
    "five-link-3d": _Entry(
        "five_link_3d.urdf",
        "five-link with hip ab- and adduction",
        sagittal_joints=("left_hip", "left_knee", "right_hip", "right_knee"),
        free=True,
    ),
    "runner-3d": _Entry(
        "runner_3d.urdf",
        "runner with hip ab- and adduction",
        sagittal_joints=("left_hip", "left_knee", "right_hip", "right_knee"),
        free=True,
    ),
    "go2": _Entry(
        "go2.urdf",
        "Unitree's quadruped of example-robot-data, which trots",
        distribution="example-robot-data",
        feet=tuple(f"{corner}_foot" for corner in _CORNERS),
        foot_radius=0.022,
        planar=False,
        free=True,
    ),
    "solo12": _Entry(
        "solo12.urdf",
        "the Open Dynamic Robot Initiative's quadruped of example-robot-data, which trots",
        distribution="example-robot-data",
        feet=("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"),
        foot_radius=0.016,
        planar=False,
        free=True,
        limits=_SOLO_ACTUATOR,
    ),
    "g1": _Entry(
        "g1_29dof_rev_1_0.urdf",
        "Unitree's humanoid of example-robot-data, on flat feet, arms and waist held",
        distribution="example-robot-data",
        feet=("left_ankle_roll_link", "right_ankle_roll_link"),
        planar=False,
        free=True,
        flat=True,
    ),
    "talos": _Entry(
        "talos_reduced.urdf",
        "PAL Robotics' humanoid of example-robot-data, on flat feet, arms and waist held",
        distribution="example-robot-data",
        feet=("leg_left_6_link", "leg_right_6_link"),
        planar=False,
        free=True,
        flat=True,
    ),
}

SHIPPED: dict[str, str] = {name: entry.about for name, entry in _ENTRIES.items()}
"""Names of all robots, with a line about each."""

ROBOTS: dict[str, str] = {name: SHIPPED[name] for name, e in _ENTRIES.items() if e.planar}
"""Names that :func:`load_robot` knows, with a line about each."""

FLOATING_ROBOTS = tuple(name for name, entry in _ENTRIES.items() if entry.free)
"""Names that :func:`load_floating_robot` knows."""

FLAT_FEET = tuple(name for name, entry in _ENTRIES.items() if entry.flat)
"""Those of them that stand on soles."""

QUADRUPEDS = tuple(name for name, entry in _ENTRIES.items() if len(entry.feet) > LEGS)
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
    if entry.distribution:
        candidates = _files(entry)
    else:
        # A wheel carries the folder inside the package, a checkout next to it.
        candidates = [root / "robots" / entry.file for root in (_PACKAGE, _PACKAGE.parent)]
    for path in candidates:
        if path.is_file():
            return path
    raise RobotError(
        f"{entry.file} is missing from this installation: reinstall"
        f" {entry.distribution or 'the library'}"
    )


def _files(entry: _Entry) -> list[Path]:
    """Places of an entry's URDF in the package that brings it."""
    try:
        files = importlib.metadata.files(entry.distribution) or []
    except importlib.metadata.PackageNotFoundError:
        return []
    return [Path(str(f.locate())) for f in files if f.name == entry.file]


def _name(name: str | Path) -> str:
    """A robot's name or path as text; a RobotError if it is the text of a URDF."""
    text = str(name)
    if text.lstrip("\ufeff \n").startswith("<"):
        raise RobotError(
            "a robot's name or the path of its URDF is wanted, not the URDF's text: write it to a"
            " file, and give the file's path"
        )
    return text


def _named(name: str, robot: AnyBiped) -> AnyBiped:
    """The robot, by the name that users know it by and not its URDF's."""
    robot.model.name = robot.name = name
    return robot


@checked
def load_robot(name: str | Path) -> PlanarBiped:
    """A shipped robot by name, or any planar biped by the path of its URDF.

    Raises:
        RobotError: if there is no such robot or file, or it is no planar biped.
    """
    text = _name(name)
    if text not in _ENTRIES and (text.endswith(_FILES) or "/" in text):
        return PlanarBiped.from_urdf(text)
    path, entry = robot_path(text), _ENTRIES[text]
    if not entry.planar:
        raise RobotError(f"robot {text!r} has no planar model: load it with load_floating_robot")
    return _named(
        text,
        PlanarBiped.from_urdf(
            path,
            entry.feet,
            entry.sagittal_joints,
            foot_radius=entry.foot_radius,
            walk=entry.walk,
        ),
    )


@checked
def load_floating_robot(name: str | Path) -> FloatingBaseBiped:
    """A shipped robot by name, or any biped by the path of its URDF, with a floating base.

    Raises:
        RobotError: if there is no such robot or file, or it is planar.
    """
    text = _name(name)
    if text not in _ENTRIES and (text.endswith(_FILES) or "/" in text):
        return FloatingBaseBiped.from_urdf(text)
    path, entry = robot_path(text), _ENTRIES[text]
    if not entry.free:
        raise RobotError(
            f"robot {text!r} has no model with a floating base: give one of"
            f" {list(FLOATING_ROBOTS)} or a URDF file"
        )
    return _named(
        text,
        FloatingBaseBiped.from_urdf(
            path,
            entry.feet,
            entry.foot_radius,
            limits=entry.limits,
            walk=entry.walk,
            flat_feet=entry.flat,
        ),
    )
