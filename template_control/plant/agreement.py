"""Check that an engine simulates the robot of the controller's model, and no other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.errors import RobotError
from template_control.robot.biped import Biped

Array = NDArray[np.float64]

_ANGLES = (0.3, -0.4, 0.7, 0.5)  # [rad] joints in turn; any angles at which no term vanishes
_CLOSE = 1e-6  # relative; engines agree to 1e-14


def check_mass_matrix(robot: Biped, engine: str, mass_matrix: Callable[[Array], Array]) -> None:
    """Compare an engine's mass matrix with Pinocchio's.

    It depends on all that moves the robot: masses, centres of mass, inertias, joint axes and
    placements, of the base too.

    Args:
        robot: the model.
        engine: its name, for the message.
        mass_matrix: the engine's (nv, nv), in the model's coordinates, at a configuration (nq,).

    Raises:
        RobotError: naming the joint or the base where they differ.
    """
    q = robot.neutral()
    nu = len(robot.joint_names)
    q[-nu:] = np.resize(_ANGLES, nu)
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
    ours = upper + np.triu(upper, 1).T
    theirs = mass_matrix(q)
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
