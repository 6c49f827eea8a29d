"""A recorded robot's visuals: the shapes of its URDF, placed by Pinocchio."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.colors import to_rgba
from meshcat import geometry as mg

from template_control.arrays import Array, IntArray
from template_control.errors import RecordError
from template_control.robot.legs import foot_frame
from template_control.run.record import FloatingRecord, Record
from template_control.view.style import TRUNK, feet_shown

_STICK = 0.02  # radius of a stick over the template's rest length

# meshcat's cylinders lie along y, the URDF's along z.
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

_PRIMITIVES = ("Box", "Sphere", "Cylinder")


def load_shapes(record: Record) -> tuple[pin.Model, pin.GeometryModel]:
    """The robot of a run, and its shapes.

    A mesh that is missing or cannot be read is left out. Legs and trunk that have no shape then are
    drawn as sticks.
    """
    text = record.urdf
    if not text:
        raise RecordError(
            "the run carries no URDF, so its robot cannot be shown in space: draw it with plots"
        )
    model = model_of(record)
    shapes = pin.buildGeomFromUrdfString(model, _with_meshes(text), pin.GeometryType.VISUAL)
    for shape in list(shapes.geometryObjects):
        geometry = shape.geometry
        if not (type(geometry).__name__ in _PRIMITIVES or hasattr(geometry, "tri_indices")):
            shapes.removeGeometryObject(shape.name)
    seen = {shape.parentJoint for shape in shapes.geometryObjects}
    for stick in sticks(record, model):
        if stick.parentJoint not in seen:
            shapes.addGeometryObject(stick)
    return model, shapes


def _with_meshes(text: str) -> str:
    """The URDF with those visual meshes only that can be read."""
    robot, loader = ET.fromstring(text), pin.hppfcl.MeshLoader()
    for link in robot.findall("link"):
        for shape in link.findall("visual"):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            try:
                loader.load(str(mesh.get("filename")).removeprefix("file://"))
            except (ValueError, RuntimeError):
                link.remove(shape)
    return ET.tostring(robot, encoding="unicode")


def sticks(record: Record, model: pin.Model) -> list[pin.GeometryObject]:
    """Cylinders from joint to joint, to the feet, and up from the hips to twice the trunk's CoM."""
    radius = _STICK * float(record.template.rest_length)
    joints = [[model.getJointId(record.joints[i]) for i in leg] for leg in record.legs]
    made = []
    for leg, foot, (_, color) in zip(joints, record.feet, feet_shown(record), strict=True):
        ends = [model.jointPlacements[joint].translation for joint in leg[1:]]
        frame = model.getFrameId(foot, pin.FrameType.BODY)
        ends.append(model.frames[frame].placement.translation)
        made += [
            _stick(model, joint, np.zeros(3), end, radius, color)
            for joint, end in zip(leg, ends, strict=True)
        ]
    hips = [model.jointPlacements[leg[0]].translation for leg in joints]
    middle = np.mean(hips, axis=0)
    top = middle + np.array([0.0, 0.0, 2.0 * float(record.trunk_com)])
    made.append(_stick(model, model.parents[joints[0][0]], middle, top, 2.0 * radius, TRUNK))
    return [stick for stick in made if stick is not None]


def _stick(
    model: pin.Model, joint: int, begin: Array, end: Array, radius: float, color: str
) -> pin.GeometryObject | None:
    """A cylinder between two points of a joint's frame; None where they are one."""
    length = float(np.linalg.norm(end - begin))
    if length < radius:
        return None
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (end - begin) / length)
    place = pin.SE3(turn.matrix(), 0.5 * (begin + end))
    stick = pin.GeometryObject(
        f"stick_{model.names[joint]}", joint, place, pin.hppfcl.Cylinder(radius, length)
    )
    stick.meshColor = np.array(to_rgba(color))
    return stick


def model_of(record: Record) -> pin.Model:
    """The robot's model, with a free flyer where nothing held it; the run carries a URDF."""
    root = [pin.JointModelFreeFlyer()] if isinstance(record, FloatingRecord) else []
    return pin.buildModelFromXML(record.urdf, *root)


def placements(model: pin.Model, shapes: pin.GeometryModel, q: Array) -> tuple[Array, Array]:
    """Positions (F, shapes, 3) [m] and quaternions x, y, z, w of the shapes in ``q`` (F, nq)."""
    data, shape_data = model.createData(), shapes.createData()
    poses = np.empty((len(q), len(shapes.geometryObjects), 7))
    for i, configuration in enumerate(q):
        pin.updateGeometryPlacements(model, data, shapes, shape_data, configuration)
        poses[i] = [pin.SE3ToXYZQUAT(placement) for placement in shape_data.oMg]
    return poses[..., :3], poses[..., 3:]


def foot_sides(model: pin.Model, feet: Sequence[str]) -> Array:
    """(n,) y of each foot frame from the sagittal plane, to the left positive [m]."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    return np.array([data.oMf[foot_frame(model, foot)].translation[1] for foot in feet])


def triangles(mesh: Any) -> tuple[Array, IntArray]:
    """Vertices (N, 3) [m] and faces (M, 3) of a mesh."""
    faces = (mesh.tri_indices(i) for i in range(mesh.num_tris))
    return np.array(mesh.vertices()), np.array([(t[0], t[1], t[2]) for t in faces])


def drawn(geometry: Any) -> tuple[mg.Geometry, Array]:
    """What meshcat draws of a shape's geometry, and where that is in the shape's frame (4, 4)."""
    kind = type(geometry).__name__
    if kind == "Box":
        return mg.Box([float(2.0 * side) for side in geometry.halfSide]), np.eye(4)
    if kind == "Sphere":
        return mg.Sphere(float(geometry.radius)), np.eye(4)
    if kind == "Cylinder":
        return mg.Cylinder(float(2.0 * geometry.halfLength), float(geometry.radius)), _Y_TO_Z
    return mg.TriangularMeshGeometry(*triangles(geometry)), np.eye(4)
