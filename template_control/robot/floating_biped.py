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
from math import acos, cos, isfinite, sin, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.errors import ParameterError, RobotError
from template_control.robot import urdf_edits
from template_control.robot.biped import Biped
from template_control.robot.legs import HINGES
from template_control.robot.requirements import add_feet, check_floating, feet_of_legs
from template_control.robot.sole import Sole, add_soles, find_soles, mirrored, with_balls
from template_control.robot.terms import FLOATING_DOF, MOST_SPARE, UP, gather_floating
from template_control.robot.urdf import build_model, check_bodies, read_urdf
from template_control.structured import Number, keep

_UNIT = 1e-12  # of a quaternion's square: what integrating it leaves
_ROUNDED = 1e-3  # of its length: written with few digits
_ROOT = 1  # Pinocchio's index of the free flyer
_PLACING = 3  # hinges that place a foot


class SpaceTerms(NamedTuple):
    """Terms of a robot in all three directions of its heading frame, as of ``ROBOT_DATA``."""

    com: Array
    com_velocity: Array
    com_bias: Array
    momentum: Array
    momentum_bias: Array
    foot_position: Array
    turning: Array


class FloatingBaseBiped(Biped):
    """Model of a floating-base biped, and its kinematics and dynamics at the last :meth:`update`.

    :meth:`from_urdf` makes one from a file. Its arguments and attributes are those of
    :class:`~template_control.robot.biped.Biped`, and the attributes below.

    Attributes:
        heading: angle from the world's x to the heading frame's, to the left positive [rad].
        origin: (2,) x and y of the heading frame's origin in the world [m].
        axes: (3, 3) turns vectors into the heading frame: ``vector @ axes``.
        space: what the sagittal terms leave out, in the heading frame; contacts and ``jacobians``
            have all three directions anyway.
        upper_body: indices into ``joint_names`` of the joints in no leg, arms and waist.
        spare: of the joints that place no foot the index, and the angle in :meth:`neutral` [rad]:
            of each leg with four hinges the one above the hip whose axis is nearest to the
            vertical, and the upper body's.
        sway: of flat feet and of pairs, dy/dt of the CoM over dy/dt - L_x / (m z) where the feet
            and the attitude of the trunk rest, L the angular momentum about the CoM; else 1.
        rotation: (3, 3) of the trunk, to the world; a view that the next update overwrites.
    """

    base_dof = FLOATING_DOF
    base_joints = _ROOT
    directions = 3
    sway = Number("sway")

    def _prepare(self) -> None:
        model, data = self.model, self._data
        placing = {joint for leg in self.legs for joint in leg}
        self.upper_body = tuple(j for j in range(len(self.joint_names)) if j not in placing)
        self.rotation: Array = data.oMi[_ROOT].rotation
        self._hips = [data.oMi[hip] for hip, *_ in self._hinges]
        self._in_leg = np.zeros((len(self._hips), 3))
        places, axes = zip(*((hip.translation, hip.rotation) for hip in self._hips), strict=True)
        base = self.heading_frame, (self.rotation, places, axes, self._in_leg)
        self._kept = keep((self._sources, self.data, self.arrays[1:], base))
        self.space = SpaceTerms(*(self.data[name][0] for name in SpaceTerms._fields))
        self.axes = np.eye(3)
        self.origin = self.heading_frame[:2]
        self.heading = 0.0
        self.update(self._neutral, np.zeros(self.nv))
        # A hip is the point of its axis that is in the plane in which the leg swings.
        pin.updateFramePlacements(model, data)
        for hip, foot, point in zip(self._hips, self._foot_ids, self._in_leg, strict=True):
            away = data.oMf[foot].translation[1] - hip.translation[1]
            point[:] = hip.rotation.T @ (0.0, away, 0.0)
        self.update(self._neutral, np.zeros(self.nv))
        lever = model.inertias[_ROOT].lever[2]
        self.trunk_com = float(lever - self.hip_height(self._neutral))
        axes = pin.computeJointJacobians(model, model.createData(), self._neutral)[5]
        turning = tuple(
            max(leg[:-HINGES], key=lambda j: abs(axes[FLOATING_DOF + j]))
            for leg in self.legs
            if len(leg) > _PLACING and not self.patches
        )
        angles = self._neutral[model.nq - len(self.joint_names) :]
        self.spare = tuple((j, float(angles[j])) for j in (*turning, *self.upper_body))
        if len(self.spare) > MOST_SPARE:
            raise RobotError(
                f"{self.path}: {len(self.upper_body)} joints are in no leg, and {MOST_SPARE} may"
                " move: name others, such as those of hands, among the `locked`"
            )
        now = self.data[0]
        now["spare"] = len(self.spare)
        for i, (joint, angle) in enumerate(self.spare):
            now["spare_joint"][i], now["spare_angle"][i] = joint, angle
        self.heading_frame[4] = now["hips"][1]  # of the trunk's origin
        if self.patches or self.paired:
            now["sway"] = self._sway_ratio()
            self.update(self._neutral, np.zeros(self.nv))
        for leg, group in enumerate(self.groups):
            contacts = list(group)
            away = self.contact_position[contacts] - self.space.foot_position[leg]
            self.spread[contacts] = away[:, :2]

    def _sway_ratio(self) -> float:
        """Ratio of dy/dt of the CoM to that with the momentum, dy/dt - L_x / (m z), in a sway.

        The soles and the attitude of the trunk rest in it, and the legs swing to the side.
        """
        self.update(self.bent(), np.zeros(self.nv))
        rows, j = self.placing_rows(), self.jacobians
        v = self.smallest_motion(rows, np.eye(len(rows))[1])
        height = self.space.com[UP] - self.contact_position[:, UP].mean()
        return 1.0 / (1.0 - float(j.momentum[0] @ v) / (self.mass * float(height)))

    def placing_rows(self) -> Array:
        """(6 + 3 n, nv) Jacobians of the CoM, the trunk's turning and all contacts; 6 of soles."""
        j = self.jacobians
        return np.concatenate((j.com, j.turning, j.contact.reshape(-1, self.nv)))

    def smallest_motion(self, rows: Array, wanted: Array) -> Array:
        """(nv,) the smallest v of base and legs with rows v = wanted; the upper body rests.

        Args:
            rows: (m, nv) at the last update.
            wanted: (m,).

        Raises:
            RobotError: if there is none.
        """
        rows = rows.copy()
        rows[:, [FLOATING_DOF + joint for joint in self.upper_body]] = 0.0
        solution, _, rank, _ = np.linalg.lstsq(rows, wanted, rcond=None)
        if rank < len(rows):
            raise RobotError(f"{self.name}: the legs do not determine the pose; bend them")
        return np.asarray(solution)

    @classmethod
    @checked
    def from_urdf(
        cls,
        path: str | Path,
        feet: Sequence[str] = ("left_foot", "right_foot"),
        foot_radius: float | None = None,
        limits: urdf_edits.JointLimits | None = None,
        walk: tuple[float, float] | None = None,
        *,
        groups: Sequence[Sequence[int]] | None = None,
        locked: Mapping[str, float] | None = None,
        foot_offset: tuple[float, float, float] | None = None,
        lossless: bool = False,
        flat_feet: bool = False,
        sole: Sole | None = None,
        upper_body: bool = False,
    ) -> FloatingBaseBiped:
        """Load a URDF whose root link is the trunk: x forward, y left, z up.

        Each leg ends in a hip and a knee about y; one joint or two may come before them. One with
        a flat foot has hip, knee and ankle about y among joints about other axes, in any order;
        where all are at 0 it is nearly straight and its sole level.

        Args:
            feet: the foot links; of a biped left then right, of a quadruped four.
            limits: in place of the URDF's; None to keep those.
            groups: the feet, by their places in ``feet``, of each of the two template legs; None:
                one each of a biped, the diagonal pairs of a quadruped, with which it trots.
            locked: positions of joints that are held there [rad, m]; with a joint those that mimic
                it.
            flat_feet: whether a biped stands on soles, which are found from the feet's collision
                shapes. Joints that are in no leg are then held at 0, unless ``locked`` says where.
            sole: the left one, where it is not to be found.
            upper_body: whether those of them that ``locked`` does not name move, and a task keeps
                them at 0, or where their range is nearest to it.

        The rest as in :meth:`PlanarBiped.from_urdf`; without ``foot_radius`` the feet's own
        spheres are kept.

        Raises:
            RobotError: if the file is missing, no URDF, no such robot, or lacks a foot; if a mass,
                an inertia, a size or a limit is none; if a foot is in no group, or in two; if no
                sole is found.
        """
        path = Path(path)
        tree = read_urdf(path, lossless)
        if limits is not None:
            urdf_edits.set_limits(path, tree, feet, limits)
        flat = flat_feet or sole is not None
        if flat and foot_radius is not None:
            raise RobotError(f"{path}: flat feet have no foot_radius: leave one of them out")
        if upper_body and not flat:
            raise RobotError(f"{path}: upper_body is of a robot on flat feet: give flat_feet too")
        if locked or flat:
            held = urdf_edits.joints_in_no_leg(tree, feet) if flat else set()
            if upper_body:
                held = urdf_edits.mimics(tree).keys() & held
            moving = urdf_edits.moving_joints(tree, held | (locked or {}).keys())
            urdf_edits.lock(path, tree, moving, locked or {})
            urdf_edits.take_points(path, tree)
        urdf_edits.spheres(path, tree, feet, foot_radius, foot_offset)
        urdf = urdf_edits.complete(path, tree)
        model = build_model(path, urdf, floating=True)
        check_floating(path, model, feet, flat)
        check_bodies(path, tree, model, _ROOT + 1)
        if flat:
            soles = find_soles(path, urdf, model, feet) if sole is None else mirrored(sole)
            urdf = with_balls(urdf, model, feet, soles)
            patches = add_soles(model, feet, soles)
            return cls(path, urdf, model, tuple(feet), 0.0, walk, patches=patches)
        radius = add_feet(path, urdf, model, feet)
        legs = feet_of_legs(path, model, feet, groups)
        return cls(path, urdf, model, tuple(feet), radius, walk, groups=legs)

    def update(self, q: Array, v: Array) -> None:
        """See :meth:`~.robot.Robot.update`; the quaternion (x, y, z, w) is made as long as 1.

        A ParameterError if its length is not so to 1e-3. ``q`` itself stays as it is.
        """
        x, y, z, w = q[3:7].tolist()
        square = x * x + y * y + z * z + w * w
        if abs(square - 1.0) > _UNIT:  # NaN and infinity are reported below
            length = sqrt(square)
            if isfinite(length) and abs(length - 1.0) > _ROUNDED:
                raise ParameterError(
                    f"{self.name}: the quaternion q[3:7] = {q[3:7].tolist()} has length"
                    f" {length:.6g}: give x, y, z, w of length 1"
                )
            q = q.copy()
            q[3:7] /= length
        pin.computeAllTerms(self.model, self._data, q, v)
        if not gather_floating(self._kept, q, v):
            raise self._diverged(q, v)

    @property
    def foot_rotation(self) -> Array:
        """(n, 3, 3) of each foot, to the world, at the last :meth:`update`."""
        joints = [self.model.frames[foot].parentJoint for foot in self._foot_ids]
        return np.array([self._data.oMi[joint].rotation for joint in joints])

    def face(self, heading: float, origin: Array) -> None:
        """Put the heading frame somewhere; takes effect at the next :meth:`update`.

        Args:
            heading: angle from the world's x to its own, to the left positive [rad].
            origin: (2,) x and y of its origin in the world [m].
        """
        self.heading = heading
        c, s = cos(heading), sin(heading)
        self.heading_frame[:4] = origin[0], origin[1], c, s
        self.axes[:2, :2] = (c, -s), (s, c)

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
        x0, y0, c, s = self.heading_frame[:4]
        x, y = point[..., 0], point[..., 1]
        out = np.array(point)
        out[..., 0], out[..., 1] = x0 + c * x - s * y, y0 + s * x + c * y
        return out

    def between(self, q: Array, other: Array) -> Array:
        """(nv,) the motion that leads from one configuration to another one [m, rad].

        Args:
            q, other: (nq,) configurations, not half a turn apart.
        """
        return pin.difference(self.model, q, other)

    def hip_height(self, q: Array) -> float:
        """Mean height of the hips that swing the legs forward [m], at the last update."""
        return float(self.data["hips"][0, UP])

    def yaw_inertia(self) -> float:
        """Moment of inertia about the vertical through the CoM, at the last update [kg m^2]."""
        return float(self._data.Ig.inertia[2, 2])

    def tilt(self, q: Array) -> float:
        """See :meth:`~template_control.robot.biped.Biped.tilt`."""
        return acos(min(max(float(self.rotation[2, 2]), -1.0), 1.0))
