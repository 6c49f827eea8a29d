"""Where the trunk of a robot ends, for plants that ask whether it lies on the ground."""

from __future__ import annotations

from itertools import product

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import PLANAR_DOF


def trunk_corners(robot: PlanarBiped) -> NDArray[np.float64]:
    """x and z (2, n) of the corners of boxes around the upright trunk's shapes [m]."""
    geometry = pin.buildGeomFromUrdfString(robot.model, robot.urdf, pin.GeometryType.COLLISION)
    corners = []
    for shape in geometry.geometryObjects:
        if shape.parentJoint != PLANAR_DOF:
            continue
        shape.geometry.computeLocalAABB()
        box = shape.geometry.aabb_local
        for corner in product(*zip(box.min_, box.max_, strict=True)):
            point = robot.trunk_axes @ shape.placement.act(np.array(corner))
            corners.append(point[[0, 2]])
    return np.array(corners).reshape(-1, 2).T
