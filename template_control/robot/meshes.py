"""Where the meshes of a URDF are: beside it, in its package, or nowhere."""

from __future__ import annotations

import logging
import os
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from template_control.errors import RobotError

_LOG = logging.getLogger(__name__)
_PACKAGE = ("package://", "model://")


def find_meshes(path: Path, robot: ET.Element) -> None:
    """Write absolute paths of meshes into a URDF, so that its text can be read from anywhere.

    A visual whose mesh is missing is left out, and the log says so once: it is not needed to
    walk.

    Args:
        path: of the URDF. A relative name counts from its folder; that of a package counts from
            each folder above it, with and without the package's name, and from those of the
            environment variable ``ROS_PACKAGE_PATH``.
        robot: its root element; changed.

    Raises:
        RobotError: if the mesh of a collision shape is missing.
    """
    missing = []
    for link in robot.findall("link"):
        for part in ("visual", "collision"):
            for shape in link.findall(part):
                mesh = shape.find("geometry/mesh")
                if mesh is None:
                    continue
                name = str(mesh.get("filename"))
                file = _file(path, name)
                if file is not None:
                    mesh.set("filename", str(file))
                elif part == "visual":
                    link.remove(shape)
                    missing.append(name)
                else:
                    raise RobotError(
                        f"{path}: link {link.get('name')!r}: its collision mesh {name} is missing:"
                        " put it there, or give the link a box, cylinder or sphere"
                    )
    if missing:
        _tell(path, len(missing), missing[0])


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


@cache
def _tell(path: Path, count: int, name: str) -> None:
    _LOG.warning(
        "%s: %d meshes are missing, the first is %s: the robot walks, and is shown with sticks",
        path,
        count,
        name,
    )
