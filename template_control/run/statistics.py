"""Statistics over all ticks of a run, whichever of them a record keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from template_control import settings
from template_control.arrays import Array, IntArray
from template_control.robot.biped import Biped

AT_LIMIT = 0.999
"""Share of its limit from which on a torque is at it: the solver comes no nearer."""


@dataclass(frozen=True)
class JointTorque:
    """Torque of a joint [N m]: largest size, root mean square, and limit of the URDF."""

    peak: float
    rms: float
    limit: float


@dataclass(frozen=True)
class JointSpeed:
    """Speed of a joint [rad/s]: largest size, and limit of the URDF."""

    peak: float
    limit: float


@dataclass(frozen=True)
class JointAngle:
    """Angle of a joint [rad]: ``least``, ``most`` of the run, ``lower``, ``upper`` of the URDF."""

    least: float
    most: float
    lower: float
    upper: float


@dataclass(frozen=True)
class PlanarError:
    """Template less robot, x and y of the CoM [m]."""

    x: float
    y: float


@dataclass(frozen=True)
class Statistics:
    """Statistics over all ticks of a run.

    Attributes:
        joint_torque, joint_speed, joint_angle: by the joint's name.
        joint_work: of all joints, positive and negative counted alike [J].
        saturated_share: of the ticks, with a torque at its limit.
        qp_failures: ticks without a solved QP.
        com_error_rms, com_error_max: while a foot is to stand.
        com_error_flight_rms: in flight; None where there was none.
    """

    joint_torque: Mapping[str, JointTorque]
    joint_speed: Mapping[str, JointSpeed]
    joint_angle: Mapping[str, JointAngle]
    joint_work: float
    saturated_share: float
    qp_failures: int
    com_error_rms: PlanarError
    com_error_max: PlanarError
    com_error_flight_rms: PlanarError | None = None

    @classmethod
    def read(cls, table: Mapping[str, Any]) -> Self:
        """Statistics as a run's metadata have them, a ``table`` of plain data."""
        return settings.from_table(cls, table)


class Counts(NamedTuple):
    """Sums and extremes over some ticks.

    Of each joint (nu,) largest torque and speed, sum of its squared torques, least and most angle;
    work of all joints, taken without its sign; ticks with a torque at its limit, and without a
    solved QP; ticks in stance and in flight (2,), and there x and y of the template less the robot
    (2, 2), largest and sum of squares. SI units.
    """

    torque: Array
    speed: Array
    torque_square: Array
    least: Array
    most: Array
    work: float
    saturated: int
    failures: int
    ticks: IntArray
    error: Array
    error_square: Array


def count(block: Mapping[str, Array], torque_limit: Array) -> Counts:
    """Counts over the rows of a block, columns of the record by name; limits (nu,) in N m."""
    torque, nu = block["torque"], len(torque_limit)
    angle, speed = block["q"][:, -nu:], block["v"][:, -nu:]
    size = np.abs(torque)
    errors, stands = block["template_com"] - block["com"], block["stands"] > 0.0
    sorts = errors[stands], errors[~stands]
    return Counts(
        torque=size.max(axis=0, initial=0.0),
        speed=np.abs(speed).max(axis=0, initial=0.0),
        torque_square=(torque * torque).sum(axis=0),
        least=angle.min(axis=0, initial=np.inf),
        most=angle.max(axis=0, initial=-np.inf),
        work=float(np.abs(torque * speed).sum(axis=1) @ block["interval"]),
        saturated=int((size >= AT_LIMIT * torque_limit).any(axis=1).sum()),
        failures=int((block["solved"] == 0.0).sum()),
        ticks=np.array([len(some) for some in sorts]),
        error=np.array([np.abs(some).max(axis=0, initial=0.0) for some in sorts]),
        error_square=np.array([(some * some).sum(axis=0) for some in sorts]),
    )


_EXTREMES = {"torque": np.max, "speed": np.max, "error": np.max, "most": np.max, "least": np.min}


def statistics(counted: list[Counts], robot: Biped, torque_limit: Array) -> Statistics:
    """Statistics of a run from the counts of its blocks, one at least; limits (nu,) in N m."""
    columns = dict(zip(Counts._fields, zip(*counted, strict=True), strict=True))
    found = Counts(**{k: _EXTREMES.get(k, np.sum)(of, axis=0) for k, of in columns.items()})
    ticks = max(int(found.ticks.sum()), 1)
    squares = found.error_square / np.maximum(found.ticks, 1)[:, None]
    (stance, flight), most = np.sqrt(squares).tolist(), found.error[0].tolist()
    rms = np.sqrt(found.torque_square / ticks)

    def joints(kind: Any, *columns: Array) -> dict[str, Any]:
        rows = np.column_stack(columns).tolist()
        return {name: kind(*row) for name, row in zip(robot.joint_names, rows, strict=True)}

    return Statistics(
        joint_torque=joints(JointTorque, found.torque, rms, torque_limit),
        joint_speed=joints(JointSpeed, found.speed, robot.velocity_limit),
        joint_angle=joints(JointAngle, found.least, found.most, robot.joint_range),
        joint_work=float(found.work),
        saturated_share=float(found.saturated / ticks),
        qp_failures=int(found.failures),
        com_error_rms=PlanarError(*stance),
        com_error_max=PlanarError(*most),
        com_error_flight_rms=PlanarError(*flight) if found.ticks[1] else None,
    )
