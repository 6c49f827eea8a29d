"""The robots that come with the library."""

from __future__ import annotations

from pathlib import Path

from template_control.errors import RobotError
from template_control.robot.planar_biped import PlanarBiped

_PACKAGE = Path(__file__).resolve().parents[1]
_FILES = {"five-link": "five_link.urdf"}

ROBOTS: tuple[str, ...] = tuple(_FILES)
"""Names that :func:`load_robot` knows."""


def robot_path(name: str) -> Path:
    """The URDF of a shipped robot, from a wheel or from a checkout.

    Raises:
        RobotError: if there is no such robot.
    """
    if name not in _FILES:
        raise RobotError(f"there is no robot {name!r}: give one of {list(ROBOTS)} or a URDF file")
    # A wheel carries the folder inside the package, a checkout beside it.
    for folder in (_PACKAGE / "robots", _PACKAGE.parent / "robots"):
        if (folder / _FILES[name]).is_file():
            return folder / _FILES[name]
    raise RobotError(f"{_FILES[name]} is missing from this installation: reinstall the library")


def load_robot(name: str | Path) -> PlanarBiped:
    """A shipped robot by name, or any planar biped by the path of its URDF.

    Raises:
        RobotError: if there is no such robot or file, or it is no planar biped.
    """
    text = str(name)
    if text in _FILES:
        return PlanarBiped.from_urdf(robot_path(text))
    if text.endswith(".urdf") or "/" in text:
        return PlanarBiped.from_urdf(text)
    return PlanarBiped.from_urdf(robot_path(text))
