"""Robot terms that controller, whole-body QP and plants read, held in its plane or free."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from math import inf, tan
from pathlib import Path
from typing import Self

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.robot.legs import (
    add_foot_frame,
    foot_frame,
    leg_hinges,
    leg_joints,
    middle,
    straight_legs,
)
from template_control.robot.requirements import check_size, feet_of_legs
from template_control.robot.robot import Robot
from template_control.robot.sole import Patch
from template_control.robot.terms import FLOATING_DOF, UP, sources
from template_control.robot.urdf import build_model, with_masses
from template_control.structured import Number

SINGLE = ((0,), (1,))
"""Groups of a biped with point feet: each contact is a foot."""

MONOPOD = ((0,), ())
"""Groups of a robot with one leg: the front leg of the template has no contact."""

_BENT = np.array([-0.4, 0.8, -0.4])  # of hip, knee and ankle [rad]
_ABOUT = 0.9  # least cosine of the angle between a joint's axis and the one that it turns about
_LEAN_SHARE = 0.9  # of the range to the side of a flat foot's leg that is used
_KNEE = 1  # place among the hinges of a leg
_SAGITTAL = {2: 1, 3: UP}  # by directions: from forward to up


def leg_means(values: Array, groups: Sequence[Sequence[int]], axis: int = 0) -> Array:
    """Means over the contacts, along an axis, of each template leg; NaN of a leg without any."""
    missing = np.full_like(values.take(0, axis), np.nan)
    means = [values.take(group, axis).mean(axis) if group else missing for group in groups]
    return np.stack(means, axis)


class Biped(Robot):
    """A robot on two template legs, and its kinematics and dynamics at the last :meth:`update`.

    It touches the ground at *contacts*: the lowest points of its foot spheres; or patches, the
    soles of flat feet, whose points are their toes. A leg of the template is a group of contacts,
    and its foot is their mean. A biped has two groups of one; of a quadruped that trots either
    diagonal pair is a virtual leg (Raibert). A monopod's second group is empty: its
    gaits have one leg.

    Sagittal quantities have two entries, x forward and y up: of a planar robot in the world, where
    it goes backward turned round about the vertical; of a free one in its heading frame.

    Attributes are those of :class:`~.robot.Robot`, and these.

    Attributes that are constant:
        path: the URDF file.
        urdf: its text, as Pinocchio and PyBullet load it.
        model: the Pinocchio model.
        feet: names of the contacts' frames; of a biped left then right.
        groups: the contacts of each of the two template legs.
        foot_radius: radius of the foot spheres; 0 of flat feet [m].
        patches: of flat feet, the soles; () of point feet.
        walk: touchdown angle [rad] and speed at VLO over sqrt(g l0) of its default gait, or
            None where none is better than the library's.
        legs: for each foot, the indices into ``joint_names`` of its joints, hip first.
        hinges: for each foot, those of them that swing and bend the leg: hip and knee, of flat feet
            also the ankle.
        leg_length: from hip to the foot sphere's centre or to the ankle, with a knee as straight as
            its range lets it be [m].
        ankle_height: of flat feet, over the sole; 0 of point feet [m].
        toe_ahead: of flat feet, of the ankle; 0 of point feet [m].
        spread: (n, 2) x and y of each contact from its foot, where the legs hang down [m].
        half_length: by how far ahead of its middle a template leg's foot bears, and behind; 0 of a
            foot that is a point [m].
        half_width: the same to the left and right [m].
        joint_sign: (nu,) 1 of a hip or knee that turns about +y, -1 about -y; of joints above the
            hip the sign of their axis' y.
        leg_mass: of the heavier leg [kg].
        trunk_com: height of the trunk's own CoM above the hips [m].
        facing: angle from the heading, the way that the robot goes, to where the trunk is to face,
            to the left positive [rad]; takes effect at the next update. Of a planar robot, whose
            trunk faces the world's x, 0 or half a turn.
        heading_frame: (5,) of a floating-base robot x and y of its heading frame's origin in the
            world [m], cosine and sine of the heading, y of the trunk's hips in it [m]; of a planar
            one the world.

    Attributes of the last update:
        com, com_velocity: (2,) [m, m/s].
        com_jacobian: (2, nv) maps v to the CoM's velocity.
        com_bias: (2,) dJ/dt v of this Jacobian [m/s^2].
        angular_momentum: about the CoM, forward pitch positive [kg m^2/s].
        angular_momentum_jacobian: (nv,) its row of the centroidal momentum matrix.
        angular_momentum_bias: that row's time derivative times v [N m].
        contact_position: (n, d) lowest point of each foot sphere, in all ``directions`` [m].
        contact_velocity: (n, d) of the material point there [m/s]; (n, 6) of patches, with their
            angular velocity [rad/s].
        contact_jacobian: (n, d, nv) maps v to each contact's velocity; (n, 6, nv) of patches.
        contact_bias: (n, d) dJ/dt v of these Jacobians, for rolling feet [m/s^2]; (n, 6) of
            patches.
        foot_position: (2, 2) of each template leg's foot, the mean of its contacts [m].
        foot_velocity: (2, 2) [m/s].
        foot_jacobian: (2, 2, nv) maps v to each foot's velocity.
        foot_bias: (2, 2) dJ/dt v of these Jacobians [m/s^2].
        joint_places: (nu, 3) of the actuated joints in the world [m].
        hips: (2,) the point the legs hang from [m].
        hip_speed: its forward velocity [m/s].
        pitch, pitch_rate: of the trunk in the sagittal plane [rad, rad/s].
    """

    ankle_height = Number("ankle_height")
    toe_ahead = Number("toe_ahead")
    trunk_com: float
    angular_momentum = Number("momentum", 1)
    angular_momentum_bias = Number("momentum_bias", 1)
    hip_speed = Number("hip_speed")
    pitch = Number("attitude", 1)
    pitch_rate = Number("turning", 1)
    facing = Number("facing")

    def __init__(
        self,
        path: Path,
        urdf: str,
        model: pin.Model,
        feet: tuple[str, ...],
        foot_radius: float,
        walk: tuple[float, float] | None = None,
        *,
        groups: tuple[tuple[int, ...], ...] = SINGLE,
        patches: tuple[Patch, ...] = (),
    ) -> None:
        super().__init__(model, len(feet), patches=bool(patches))
        first = 1 + self.base_joints
        self.path, self.urdf = path, urdf
        self.feet, self.foot_radius, self.walk, self.groups = feet, foot_radius, walk, groups
        self.patches, flat = patches, bool(patches)
        now = self.data[0]
        for leg, group in enumerate(groups):
            now["members"][leg], now["group"][leg, : len(group)] = len(group), group
        self._foot_ids = tuple(foot_frame(model, foot) for foot in feet)
        self._leg_joints = leg_joints(model, feet, self.base_joints)
        self.legs = tuple(tuple(j - first for j in leg) for leg in self._leg_joints)
        self._hinges = tuple(leg_hinges(model, leg, flat) for leg in self._leg_joints)
        self.hinges = tuple(tuple(j - first for j in leg) for leg in self._hinges)
        straight = straight_legs(model, feet, self.base_joints, flat)
        self.leg_length, self._neutral = straight.reach, straight.q
        check_size(path, self.mass, self.leg_length, foot_radius)
        self.joint_sign: Array = np.sign(straight.axes[1, self.base_dof :])
        self.leg_mass = max(
            float(sum(model.inertias[j].mass for j in leg)) for leg in self._leg_joints
        )
        data = self._data
        self.joint_places = _in_a_row(
            [data.oMi[j].translation for j in range(first, model.njoints)]
        )
        self.heading_frame: Array = np.array([0.0, 0.0, 1.0, 0.0, 0.0])
        now["foot_radius"], now["leg_length"] = foot_radius, self.leg_length
        now["sway"], now["leg_lean"] = 1.0, inf
        self._sources = sources(model, data, self._foot_ids, self._joint_limits)
        if flat:
            self._take_patches()
        self._look()
        self.spread: Array = np.zeros((len(feet), 2))
        self._prepare()
        sides = [patch.half_sides - np.abs(patch.centre) for patch in patches] or [
            0.5 * np.ptp(self.spread[list(group)], axis=0) for group in groups if group
        ]
        self.half_length, self.half_width = np.min(sides, axis=0).tolist()

    def _take_patches(self) -> None:
        """Write what is constant of the soles, and let the knees stop where the leg is straight.

        One that bends backward, as G1's may by 0.09 rad, is trapped: the CoM can only sink after
        it has risen.
        """
        now, data, model = self.data[0], self.model.createData(), self.model
        straight = self._neutral[-len(self.joint_stops) :]
        for _, knee, _ in self.hinges:
            beyond = np.argmin(np.abs(self.joint_range[knee] - straight[knee]))
            self.joint_stops[knee, beyond] = straight[knee]
        for i, patch in enumerate(self.patches):
            now["sole_centre"][i], now["sole_half"][i] = patch.centre, patch.half_sides
        pin.framesForwardKinematics(model, data, self._neutral)
        legs = zip(self._foot_ids, self._hinges, strict=True)
        ahead, _, below = np.mean(
            [data.oMf[toe].translation - data.oMi[ankle].translation for toe, (*_, ankle) in legs],
            axis=0,
        )
        now["toe_ahead"], now["ankle_height"] = ahead, -below
        places = np.array([data.oMf[toe].translation[1] for toe in self._foot_ids])
        now["hip_side"] = places - places.mean()
        axes = np.abs(pin.computeJointJacobians(model, data, self._neutral)[3])
        stops = [
            abs(stop - self._neutral[model.idx_qs[j]])
            for leg in self._leg_joints
            for j in leg
            if axes[model.idx_vs[j]] > _ABOUT
            for stop in self.joint_range[j - 1 - self.base_joints]
        ]
        now["leg_lean"] = tan(_LEAN_SHARE * min(stops))

    def _look(self) -> None:
        """Take the views that Python reads; Pinocchio keeps its arrays in place."""
        j, now, step = self.jacobians, self.data[0], _SAGITTAL[self.directions]
        self.com: Array = now["com"][::UP]
        self.com_velocity: Array = now["com_velocity"][::UP]
        self.com_bias: Array = now["com_bias"][::UP]
        self.com_jacobian: Array = j.com[::step]
        self.angular_momentum_jacobian: Array = j.momentum[len(j.momentum) // 2]
        self.foot_position: Array = now["foot_position"][:, ::UP]
        self.foot_velocity: Array = now["foot_velocity"][:, ::UP]
        own = slice(len(self.feet)), slice(0, max(self.contact_rows, UP + 1), UP // step)
        self.contact_position: Array = now["contact_position"][own]
        self.contact_velocity: Array = now["contact_velocity"][own]
        self.contact_bias: Array = now["contact_bias"][own]
        self.contact_jacobian: Array = j.contact
        self.hips: Array = now["hips"][::UP]

    @property
    def paired(self) -> bool:
        """Whether the feet of the template's legs are groups of contacts, as a quadruped's."""
        return any(len(group) > 1 for group in self.groups)

    @property
    def foot_jacobian(self) -> Array:
        """See the class."""
        return self._means(self.contact_jacobian)

    @property
    def foot_bias(self) -> Array:
        """See the class."""
        return self._means(self.contact_bias)

    def _means(self, values: Array) -> Array:
        """(2, ...) sagittal means over the groups of contacts; views of contacts that are feet."""
        sagittal = values[:, :: _SAGITTAL[self.directions]]
        return sagittal if self.groups == SINGLE else leg_means(sagittal, self.groups)

    def changed(
        self,
        gravity: float | None = None,
        masses: Mapping[str, float] | None = None,
        groups: Sequence[Sequence[int]] = (),
    ) -> Self:
        """The same robot under another gravity, with other masses, or other groups of its feet.

        Args:
            gravity: [m/s^2]; None: as it is.
            masses: by link [kg]; their inertias grow alike.
            groups: the feet of each of the template's legs, by their places in ``feet``; none: as
                they are.

        Raises:
            RobotError: if it has no such link, or one that weighs nothing, or the groups are not
                each foot once.
        """
        urdf, model = self.urdf, self.model.copy()
        if masses:
            urdf = with_masses(self.path, urdf, masses)
            model = build_model(self.path, urdf, self.base_dof == FLOATING_DOF)
            model.name = self.name
            for foot, frame in zip(self.feet, self._foot_ids, strict=True):
                add_foot_frame(model, foot, self.model.frames[frame].placement)
        model.gravity.linear = np.array([0.0, 0.0, -(gravity or self.gravity)])
        same = self.feet, self.foot_radius, self.walk
        legs = feet_of_legs(self.path, model, self.feet, groups) if groups else self.groups
        return type(self)(self.path, urdf, model, *same, groups=legs, patches=self.patches)

    @abstractmethod
    def _prepare(self) -> None:
        """Make what :meth:`update` reads and writes."""

    def neutral(self) -> Array:
        """(nq,) upright, with straight vertical legs."""
        return self._neutral.copy()

    def bent(self, backward: bool = False) -> Array:
        """(nq,) as :meth:`neutral`, with bent legs: knees ahead, unless their range is behind.

        Args:
            backward: bend them the other way.
        """
        q = self.neutral()
        angles = q[-len(self.joint_names) :]
        for own, (_, knee, *_) in zip(map(list, self.hinges), self._hinges, strict=True):
            sign = self.joint_sign[own]
            ahead = sign[_KNEE] * (middle(self.model, knee) - angles[own[_KNEE]]) >= 0.0
            angles[own] += (1.0 if ahead != backward else -1.0) * sign * _BENT[: len(own)]
        return q

    def moved(self, q: Array, step: Array) -> Array:
        """(nq,) the configuration that a small motion leads to.

        Args:
            q: (nq,) configuration.
            step: (nv,) the motion, in the coordinates of the velocity [m, rad].
        """
        return pin.integrate(self.model, q, step)

    @abstractmethod
    def hip_height(self, q: Array) -> float:
        """Height of the point the legs hang from [m], of the last update's ``q``."""

    @abstractmethod
    def tilt(self, q: Array) -> float:
        """Angle of the trunk from the upright [rad], at the last update."""


def _in_a_row(views: list[Array]) -> Array:
    """One view (n, 3) of what n views (3,) show, which lie in memory at equal distances."""
    places = [view.__array_interface__["data"][0] for view in views]
    step = places[1] - places[0]
    assert np.all(np.diff(places) == step)  # elements of one vector of Pinocchio's
    return np.lib.stride_tricks.as_strided(views[0], (len(views), 3), (step, views[0].strides[0]))
