"""A recorded robot's visuals: the shapes of its URDF, placed by Pinocchio."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from meshcat import geometry as mg
from numpy.typing import NDArray

from template_control.errors import RecordError
from template_control.robot.biped import foot_frame
from template_control.run.kinds.free_record import FreeRecord
from template_control.run.record import Record

Array = NDArray[np.float64]

# meshcat's cylinders lie along y, the URDF's along z.
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Visual:
    """One shape of the robot.

    Attributes:
        name: unique in the robot.
        geometry: for meshcat.
        offset: (4, 4) of meshcat's shape in the URDF's visual frame.
        color: red, green, blue, opacity, each from 0 to 1.
    """

    name: str
    geometry: mg.Geometry
    offset: Array
    color: tuple[float, float, float, float]


Robot = tuple[pin.Model, pin.GeometryModel, list[Visual]]
"""A robot's model, and its shapes in the geometry model's order."""


def load_visuals(record: Record) -> Robot:
    """The robot of a run, and its shapes in the geometry model's order.

    Raises:
        RecordError: if the run carries no URDF, a mesh file is missing or cannot be read, or
            the robot has nothing to see.
    """
    text = record.metadata.get("urdf")
    if not text:
        raise RecordError("the run carries no URDF, so its robot cannot be shown: walk it again")
    _check_meshes(text)
    model = model_of(record)
    try:
        shapes = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    except ValueError as error:
        lines = [line for line in str(error).splitlines() if "resource" in line or "Mesh" in line]
        raise RecordError(
            f"a mesh of {model.name} cannot be read ({lines[0] if lines else error}):"
            " put it back, or walk again with a URDF whose meshes are there"
        ) from None
    if not len(shapes.geometryObjects):
        raise RecordError(f"the URDF of {model.name} has no visuals: add some and walk again")
    return model, shapes, [_visual(shape) for shape in shapes.geometryObjects]


def model_of(record: Record) -> pin.Model:
    """The robot's model, with a free flyer where nothing held it.

    Args:
        record: the run, which carries a URDF.
    """
    text = record.metadata["urdf"]
    if isinstance(record, FreeRecord):
        return pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    return pin.buildModelFromXML(text)


def placements(model: pin.Model, shapes: pin.GeometryModel, q: Array) -> tuple[Array, Array]:
    """Where the shapes are in each of several configurations.

    Args:
        model: of the robot.
        shapes: its shapes, from :func:`load_visuals`.
        q: (F, nq) configurations [m, rad].

    Returns:
        positions: (F, shapes, 3) x forward, y to the left, z up [m].
        quaternions: (F, shapes, 4) x, y, z, w.
    """
    data, shape_data = model.createData(), shapes.createData()
    positions = np.empty((len(q), len(shapes.geometryObjects), 3))
    quaternions = np.empty((*positions.shape[:2], 4))
    for i, configuration in enumerate(q):
        pin.updateGeometryPlacements(model, data, shapes, shape_data, configuration)
        for j, placement in enumerate(shape_data.oMg):
            vector = pin.SE3ToXYZQUAT(placement)
            positions[i, j], quaternions[i, j] = vector[:3], vector[3:]
    return positions, quaternions


def foot_sides(model: pin.Model, feet: list[str]) -> Array:
    """How far the feet are to the left of the sagittal plane.

    Args:
        model: of the robot.
        feet: names of the two foot frames.

    Returns:
        (2,) y of each foot frame [m]; to the left is positive.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    return np.array([data.oMf[foot_frame(model, foot)].translation[1] for foot in feet])


def _check_meshes(text: str) -> None:
    for name in re.findall(r'<mesh[^>]*filename="([^"]+)"', text):
        path = Path(name.removeprefix("file://"))
        if "://" not in str(name.removeprefix("file://")) and not path.is_file():
            raise RecordError(
                f"the robot's mesh {path} is missing: put it back, or walk again with a URDF"
                " whose meshes are there"
            )


def _visual(shape: pin.GeometryObject) -> Visual:
    geometry: Any = shape.geometry
    offset = np.eye(4)
    kind = type(geometry).__name__
    if kind == "Box":
        drawn = mg.Box([float(2.0 * side) for side in geometry.halfSide])
    elif kind == "Sphere":
        drawn = mg.Sphere(float(geometry.radius))
    elif kind == "Cylinder":
        drawn = mg.Cylinder(float(2.0 * geometry.halfLength), float(geometry.radius))
        offset = _Y_TO_Z
    elif hasattr(geometry, "tri_indices"):
        triangles = (geometry.tri_indices(i) for i in range(geometry.num_tris))
        faces = [(t[0], t[1], t[2]) for t in triangles]
        drawn = mg.TriangularMeshGeometry(np.array(geometry.vertices()), np.array(faces))
    else:
        raise RecordError(
            f"visual {shape.name!r} is a {kind}: use a box, cylinder, sphere or mesh in the URDF"
        )
    red, green, blue, opacity = (float(c) for c in shape.meshColor)
    return Visual(shape.name, drawn, offset, (red, green, blue, opacity))
