"""Robot of an engine: its trunk's box, and checks that it is the one of the controller's model."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.errors import RobotError
from template_control.robot.biped import Biped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import PLANAR_DOF

_ANGLES = (0.3, -0.4, 0.7, 0.5)  # [rad] joints in turn; any angles at which no term vanishes
_CLOSE = 1e-6  # relative; engines agree to 1e-14


def check_mass_matrix(robot: Biped, engine: str, mass_matrix: Callable[[Array], Array]) -> None:
    """Compare an engine's mass matrix, by configuration, with Pinocchio's.

    It depends on all that moves the robot: masses, inertias, joint axes and placements.
    """
    q = _bent(robot)
    ours, theirs = _mass_matrix(robot, q), mass_matrix(q)
    scale = np.sqrt(np.diag(ours))
    off = np.abs(theirs - ours) / np.outer(scale, scale)
    if not np.isfinite(off).all() or off.max() > _CLOSE:
        row = int(np.nan_to_num(off, nan=np.inf).max(axis=1).argmax())
        joint = row - robot.base_dof
        place = "its base" if joint < 0 else f"joint {robot.joint_names[joint]!r}"
        raise RobotError(
            f"{robot.path}: {engine} has another mass matrix than the model at {place}, by"
            f" {off[row].max():.2g} of its entries: {engine} reads the URDF otherwise; write its"
            " inertias and joints more plainly, or take another plant"
        )


def check_damping(robot: Biped, time_step: float) -> None:
    """Check that damping held for a time step [s] takes away no more speed than there is.

    PyBullet and the integrator of the ideal plant overshoot then, and diverge.
    """
    damping = robot.joint_damping
    # Of the joints alone: nothing holds the base, so their inertia is at its least.
    answer = np.linalg.inv(_mass_matrix(robot, _bent(robot)))[robot.base_dof :, robot.base_dof :]
    root = np.sqrt(damping)
    rate = float(np.linalg.eigvalsh(root[:, None] * answer * root).max())
    if rate * time_step > 1.0:
        worst = robot.joint_names[int(np.argmax(damping))]
        raise RobotError(
            f"{robot.path}: joint {worst!r} has a damping of {damping.max():g} N m s/rad, too much"
            f" for a time step of {time_step:g} s: take {0.9 / rate:.2g} s, or load the robot"
            " lossless"
        )


def trunk_corners(robot: PlanarBiped) -> Array:
    """(n, 2) x and z of the corners of boxes around the upright trunk's shapes [m]."""
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
    return np.array(corners).reshape(-1, 2)


def _bent(robot: Biped) -> Array:
    """(nq,) a configuration at which no term vanishes."""
    q, nu = robot.neutral(), len(robot.joint_names)
    q[-nu:] = np.resize(_ANGLES, nu)
    return q


def _mass_matrix(robot: Biped, q: Array) -> Array:
    """Pinocchio's (nv, nv)."""
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
    return upper + np.triu(upper, 1).T
