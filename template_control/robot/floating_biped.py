"""A floating-base biped on Pinocchio: its trunk is a free flyer.

Frames: world x forward, y left, z up. The configuration is q = (x, y, z of the trunk's origin, its
quaternion x y z w, joints), the velocity v = (linear and angular velocity of the trunk in its own
axes, joints), both in Pinocchio's order.

What :meth:`FloatingBaseBiped.update` writes stands in the *heading frame*: the world, shifted and
turned about the vertical by the heading. The sagittal controller sees the robot's x and z there,
and knows nothing of the rest. The frame rests, but for :meth:`FloatingBaseBiped.turn`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import atan2, cos, isfinite, sin, sqrt
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Interval, Positive
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.legs import HINGES
from template_control.robot.requirements import add_feet, check_floating
from template_control.robot.terms import (
    FLOATING_DOF,
    FloatingTerms,
    floating_sources,
    gather_floating,
)
from template_control.robot.urdf import build_model, check_bodies, read_losses, read_urdf
from template_control.robot.urdf_edits import (
    check_joint_names,
    complete,
    drop_world,
    lock,
    moving_joints,
    set_limits,
    set_ranges,
    spheres,
    take_points,
)

Array = NDArray[np.float64]

_UNIT = 1e-12  # of a quaternion's square: what integrating it leaves
_ROUNDED = 1e-3  # of its length: written with few digits
_ROOT = 1  # Pinocchio's index of the free flyer
_PLACING = 3  # hinges that place a foot


@dataclass(frozen=True)
class JointLimits(Checked):
    """Limits of all joints, in place of the URDF's.

    Attributes:
        torque: the largest [N m].
        velocity: the largest [rad/s].
        ranges: of a leg's joints, from the trunk to the knee [rad]; empty to keep the URDF's.
    """

    torque: Positive
    velocity: Positive
    ranges: tuple[Interval, ...] = ()


class FloatingBaseBiped(Biped):
    """Model of a floating-base biped, and its kinematics and dynamics at the last :meth:`update`.

    :meth:`from_urdf` makes one from a file. Its attributes are those of
    :class:`~template_control.robot.biped.Biped`, and those below.

    Args:
        path: the URDF file.
        urdf: its text.
        model: Pinocchio's of it.
        feet: names of the two foot frames, left then right.
        foot_radius: of the foot spheres [m].
        walk: the robot's own gait, or None.

    Attributes:
        heading: angle from the world's x to the heading frame's, to the left positive [rad].
        origin: (2,) x and y of the heading frame's origin in the world [m].
        space: all terms with three directions, in the heading frame.
        spare: of each leg with four hinges, the joint above the hip whose axis is nearest to the
            vertical: its index into ``joint_names``, and its angle in :meth:`neutral` [rad].
        rotation: (3, 3) of the trunk, to the world; a view that the next update overwrites.
    """

    base_dof = FLOATING_DOF
    base_joints = _ROOT
    directions = 3

    @staticmethod
    def _model_of(path: Path, urdf: str) -> pin.Model:
        build_model(path, urdf)  # which tells what is wrong with it
        return pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())

    def _prepare(self) -> None:
        model = self.model
        data = self._data
        self.rotation: Array = data.oMi[_ROOT].rotation
        self._hips = [data.oMi[leg[-HINGES]] for leg in self._leg_joints]
        self._in_leg = [np.zeros(3), np.zeros(3)]
        limits = self.velocity_limit, self.joint_range
        self._sources = floating_sources(model, data, self._foot_ids, self.foot_radius, limits)
        self.space = FloatingTerms.zeros(self.nv)
        self._terms = tuple(self.space)
        self._frame = np.array([0.0, 0.0, 1.0, 0.0])
        self.origin = self._frame[:2]
        self.heading = 0.0
        self._look()
        self.update(self._neutral, np.zeros(self.nv))
        # A hip is the point of its axis that is in the plane in which the leg swings.
        for hip, foot, point in zip(self._hips, self._foot_ids, self._in_leg, strict=True):
            away = data.oMf[foot].translation[1] - hip.translation[1]
            point[:] = hip.rotation.T @ (0.0, away, 0.0)
        lever = model.inertias[_ROOT].lever[2]
        self.trunk_com = float(lever - self.hip_height(self._neutral))
        axes = pin.computeJointJacobians(model, model.createData(), self._neutral)[5]
        self.spare = tuple(
            (joint, float(self._neutral[model.nq - len(self.joint_names) + joint]))
            for leg in self.legs
            if len(leg) > _PLACING
            for joint in [max(leg[:-HINGES], key=lambda j: abs(axes[FLOATING_DOF + j]))]
        )
        self._aside = float(self._middle()[1])  # of the trunk's origin

    def _look(self) -> None:
        """The sagittal terms are the space's x and z."""
        s = self.space
        self.com, self.com_velocity, self.com_bias = (
            s.com[::2],
            s.com_velocity[::2],
            s.com_bias[::2],
        )
        self.com_jacobian = s.com_jacobian[::2]
        self.angular_momentum_jacobian = s.momentum_jacobian[1]
        self.angular_momentum = self.angular_momentum_bias = 0.0
        self.contact_jacobian, self.contact_bias = s.foot_jacobian, s.foot_bias
        self.contact_velocity = np.zeros((2, 3))
        self.foot_position, self.foot_velocity = s.foot[:, ::2], self.contact_velocity[:, ::2]
        self.foot_jacobian, self.foot_bias = s.foot_jacobian[:, ::2], s.foot_bias[:, ::2]
        self.joint_velocity = s.joint_velocity

    @classmethod
    @checked
    def from_urdf(
        cls,
        path: str | Path,
        feet: Sequence[str] = ("left_foot", "right_foot"),
        foot_radius: float | None = None,
        limits: JointLimits | None = None,
        walk: tuple[float, float] | None = None,
        *,
        locked: Mapping[str, float] | None = None,
        foot_offset: tuple[float, float, float] | None = None,
        lossless: bool = False,
    ) -> FloatingBaseBiped:
        """Load a URDF whose root link is the trunk: x forward, y left, z up.

        Either leg ends in a hip and a knee about y; one joint or two may come before them.

        Args:
            path: the URDF file.
            feet: the two foot links, left then right.
            foot_radius: of spheres to be put into the feet [m]; None to keep the feet's own.
            limits: in place of the URDF's; None to keep those.
            walk: see :class:`~template_control.robot.biped.Biped`.
            locked: positions of joints that are held there [rad, m]; with a joint those that mimic
                it.
            foot_offset: of the spheres' centres from the foot links' origins, in the links' axes
                [m]: a sole is below its ankle.
            lossless: whether the joints' damping and friction are left out.

        Raises:
            RobotError: if the file is missing, no URDF, no such biped, or lacks a foot; if a mass,
                an inertia, a size or a limit is none.
        """
        path = Path(path)
        tree = read_urdf(path)
        drop_world(tree)
        read_losses(path, tree, lossless)
        if limits is not None:
            set_limits(tree, limits.torque, limits.velocity)
            if limits.ranges:
                set_ranges(path, tree, feet, limits.ranges)
        if locked:
            check_joint_names(path, tree, locked)
            lock(path, tree, moving_joints(tree, locked), locked)
            take_points(path, tree)
        spheres(path, tree, feet, foot_radius, foot_offset)
        urdf = complete(path, tree)
        model = cls._model_of(path, urdf)
        check_floating(path, model, feet)
        check_bodies(path, tree, model, _ROOT + 1)
        radius = add_feet(path, urdf, model, feet)
        return cls(path, urdf, model, (feet[0], feet[1]), radius, walk)

    def update(self, q: Array, v: Array) -> None:
        """See :meth:`~template_control.robot.biped.Biped.update`.

        Args:
            q: (nq,) configuration; its quaternion (x, y, z, w) is made as long as 1 if its length
                is so to 1e-3. ``q`` itself stays as it is.
            v: (nv,) velocity.

        Raises:
            ParameterError: if a value is NaN or infinite, or the quaternion has another length.
        """
        x, y, z, w = q[3:7].tolist()
        square = x * x + y * y + z * z + w * w
        if abs(square - 1.0) > _UNIT:  # NaN and infinity are told below
            q = self._with_unit(q, sqrt(square))
        finite, self.fastest, self.soonest_stop = gather_floating(
            self._sources, q, v, self._compute(q, v), self._frame, self._terms
        )
        self._check_finite(finite, q, v)
        s = self.space
        self.angular_momentum, self.angular_momentum_bias = s.momentum[1], s.momentum_bias[1]
        np.matmul(s.foot_jacobian, v, out=self.contact_velocity)

    def _with_unit(self, q: Array, length: float) -> Array:
        """A configuration whose quaternion is as long as 1.

        Raises:
            ParameterError: if it was longer or shorter by more than rounding.
        """
        if isfinite(length) and abs(length - 1.0) > _ROUNDED:
            raise ParameterError(
                f"{self.name}: the quaternion q[3:7] = {q[3:7].tolist()} has length {length:.6g}:"
                " give x, y, z, w of length 1"
            )
        q = q.copy()
        q[3:7] /= length
        return q

    def faced(self, vector: Array) -> Array:
        """(..., 3) vectors in the heading frame, from the world's axes."""
        c, s = cos(self.heading), sin(self.heading)
        return vector @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def face(self, heading: float, origin: Array) -> None:
        """Put the heading frame somewhere; takes effect at the next :meth:`update`.

        Args:
            heading: angle from the world's x to its own, to the left positive [rad].
            origin: (2,) x and y of its origin in the world [m].
        """
        self.heading = heading
        self._frame[:] = origin[0], origin[1], cos(heading), sin(heading)

    def turn(self, angle: float, about: Array) -> None:
        """Turn the heading frame; takes effect at the next :meth:`update`.

        Args:
            angle: to the left positive [rad].
            about: (2,) the point that keeps its coordinates in the heading frame, x and y there
                [m].
        """
        pivot = self.to_world(about)
        heading = self.heading + angle
        c, s = cos(heading), sin(heading)
        x, y = about
        self.face(heading, np.array([pivot[0] - c * x + s * y, pivot[1] - s * x - c * y]))

    def to_world(self, point: Array) -> Array:
        """A point of the heading frame in the world.

        Args:
            point: (..., 2) or (..., 3) [m].
        """
        x0, y0, c, s = self._frame
        x, y = point[..., 0], point[..., 1]
        out = np.array(point)
        out[..., 0], out[..., 1] = x0 + c * x - s * y, y0 + s * x + c * y
        return out

    def moved(self, q: Array, step: Array) -> Array:
        """See :meth:`~template_control.robot.biped.Biped.moved`."""
        return np.asarray(pin.integrate(self.model, q, step))

    def between(self, q: Array, other: Array) -> Array:
        """(nv,) the motion that leads from one configuration to another one [m, rad].

        Args:
            q, other: (nq,) configurations, not half a turn apart.
        """
        return np.asarray(pin.difference(self.model, q, other))

    def _middle(self) -> Array:
        """(3,) between the hips, in the world, at the last update [m]."""
        left, right = (
            hip.translation + hip.rotation @ point
            for hip, point in zip(self._hips, self._in_leg, strict=True)
        )
        return np.asarray(0.5 * (left + right))

    def joint_positions(self, out: Array) -> None:
        """See :meth:`~template_control.robot.biped.Biped.joint_positions`."""
        x0, y0, c, s = self._frame
        for i, place in enumerate(self._joint_places):
            out[i, 0], out[i, 1] = c * (place[0] - x0) + s * (place[1] - y0), place[2]

    def hip_height(self, q: Array) -> float:
        """Mean height of the hips that swing the legs forward [m], at the last update."""
        return float(self._middle()[2])

    def hips(self, q: Array, v: Array) -> tuple[Array, float]:
        """See :meth:`~template_control.robot.biped.Biped.hips`: their mean."""
        x0, y0, c, s = self._frame
        x, y, z = self._middle().tolist()
        away = z - float(q[2])
        # The hips move with the trunk, whose origin is elsewhere.
        moving, turning = self.rotation @ v[:3], self.space.turning
        speed = c * moving[0] + s * moving[1] + turning[1] * away - turning[2] * self._aside
        return np.array([c * (x - x0) + s * (y - y0), z]), float(speed)

    def trunk(self, q: Array, v: Array) -> tuple[float, float]:
        """See :meth:`~template_control.robot.biped.Biped.trunk`: in the sagittal plane."""
        return self.roll_pitch_yaw()[1], float(self.space.turning[1])

    def roll_pitch_yaw(self) -> tuple[float, float, float]:
        """Attitude of the trunk in the heading frame, at the last update [rad].

        Roll and pitch are the angles of its upward axis from the vertical, about the heading
        frame's x and y; yaw is that of its forward axis about the vertical.
        """
        (xx, _, xz), (yx, _, yz), (_, _, zz) = self.rotation.tolist()
        c, s = float(self._frame[2]), float(self._frame[3])
        ahead, left = c * xz + s * yz, c * yz - s * xz
        return atan2(-left, zz), atan2(ahead, zz), atan2(c * yx - s * xx, c * xx + s * yx)

    def tilt(self, q: Array) -> float:
        """See :meth:`~template_control.robot.biped.Biped.tilt`."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0)))
