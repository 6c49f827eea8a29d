"""URDFs of five-link bipeds with point feet, planar or with a floating base, from tables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from template_control.checks.checked import Checked
from template_control.checks.ranges import Interval, NotNegative, Positive
from template_control.errors import RobotError

_COLOURS = {"grey": "0.55 0.57 0.60 1", "blue": "0.16 0.38 0.63 1", "orange": "0.86 0.45 0.13 1"}
SIDES = {"left": ("blue", 0.5), "right": ("orange", -0.5)}
"""Colour of a side's leg, and its place over the hips' distance."""

_BALL = 0.4  # moment of inertia of a ball, over its mass and the square of its radius
_BASE = (
    ("base_x", "prismatic", "world", "slide_x", "1 0 0"),
    ("base_z", "prismatic", "slide_x", "slide_z", "0 0 1"),
    ("base_pitch", "revolute", "slide_z", "trunk", "0 1 0"),
)


@dataclass(frozen=True)
class Link(Checked):
    """A rigid link of the sagittal plane.

    Attributes:
        length: [m].
        mass: [kg].
        com: distance of its centre of mass from its upper joint (the trunk's: from the hip,
            upwards) [m].
        inertia: about +y through its centre of mass [kg m^2].
    """

    _error = RobotError

    length: Positive
    mass: Positive
    com: Positive
    inertia: Positive

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.com > self.length:
            raise RobotError(
                f"{type(self).__name__}.com is {self.com:g} m, outside a link of {self.length:g} m:"
                " give at most its length"
            )

    @property
    def moments(self) -> tuple[float, float, float]:
        """About x, y and z through its centre of mass [kg m^2].

        The plane does not feel the first and the last: they are those of a rod along z.
        """
        return self.inertia, self.inertia, 0.1 * self.inertia


@dataclass(frozen=True)
class SolidLink(Link):
    """A link of a robot that moves in space.

    Attributes:
        side_inertia: about +x and +z through its centre of mass [kg m^2]. ``inertia`` is about +y.
    """

    side_inertia: tuple[Positive, Positive]

    @property
    def moments(self) -> tuple[float, float, float]:
        """See :attr:`Link.moments`."""
        return self.side_inertia[0], self.inertia, self.side_inertia[1]


@dataclass(frozen=True)
class FiveLink(Checked):
    """A trunk and two equal legs of thigh and shank, with spheres as feet.

    Attributes:
        name: of the robot.
        trunk, thigh, shank: the links.
        torque_limit: of each hip and each knee [N m].
        velocity_limit: of all four [rad/s].
        hip_width: between the hips; the plane does not feel it [m].
        foot_radius: of the spheres [m].
        hip_range, knee_range: forward pitch and knee flexion positive [rad].

    Raises:
        RobotError: if a number of a link is not positive and finite.
    """

    _error = RobotError

    name: str
    trunk: Link
    thigh: Link
    shank: Link
    torque_limit: tuple[Positive, Positive]
    velocity_limit: Positive = 20.0
    hip_width: NotNegative = 0.2
    foot_radius: Positive = 0.01
    hip_range: Interval = (-2.0, 1.5)
    knee_range: Interval = (0.0, 2.5)

    def urdf(self) -> str:
        """The robot as URDF text, planar: x, z and pitch unactuated, hinges about +y."""
        parts = [
            '<link name="world"/>',
            *(f'<link name="{name}">{massless()}</link>' for name in ("slide_x", "slide_z")),
            self.trunk_link(),
        ]
        for side in SIDES:
            parts += self.leg_links(side)
        parts += [joint(*row, limit=(-1e3, 1e3, 0.0, 1e3)) for row in _BASE]
        for side in SIDES:
            parts += self.leg_joints(side, "trunk", self.hip_place(side))
        return urdf_of(self.name, parts)

    def hip_place(self, side: str) -> str:
        """Place of a hip in the trunk, as URDF text.

        Args:
            side: of :data:`SIDES`.
        """
        return f"0 {SIDES[side][1] * self.hip_width:g} 0"

    def leg_joints(self, side: str, parent: str, origin: str) -> list[str]:
        """Hip, knee and the fixed ankle, as URDF text.

        Args:
            side: of :data:`SIDES`.
            parent: link that the thigh hangs from.
            origin: of the hip there.
        """
        (hip, knee), speed, axis = self.torque_limit, self.velocity_limit, "0 1 0"
        hip_limit, knee_limit = (*self.hip_range, hip, speed), (*self.knee_range, knee, speed)
        thigh, shank = f"{side}_thigh", f"{side}_shank"
        bend, end = f"0 0 {-self.thigh.length:g}", f"0 0 {-self.shank.length:g}"
        return [
            joint(f"{side}_hip", "revolute", parent, thigh, axis, origin=origin, limit=hip_limit),
            joint(f"{side}_knee", "revolute", thigh, shank, axis, origin=bend, limit=knee_limit),
            joint(f"{side}_ankle", "fixed", shank, f"{side}_foot", origin=end),
        ]

    def trunk_link(self) -> str:
        """The trunk as URDF text."""
        trunk = self.trunk
        size = f"{0.4 * trunk.length:g} {1.5 * self.hip_width:g} {trunk.length:g}"
        box = f'<geometry><box size="{size}"/></geometry>'
        place = f'<origin xyz="0 0 {0.5 * trunk.length:g}"/>'
        return (
            f'<link name="trunk">{_inertial(trunk, up=True)}\n'
            f'  <visual>{place}{box}<material name="grey"/></visual>\n'
            f"  <collision>{place}{box}</collision></link>"
        )

    def leg_links(self, side: str) -> list[str]:
        """Thigh, shank and foot as URDF text.

        Args:
            side: of :data:`SIDES`.
        """
        colour = SIDES[side][0]
        sphere = f'<geometry><sphere radius="{self.foot_radius:g}"/></geometry>'
        return [
            _segment(f"{side}_thigh", self.thigh, colour),
            _segment(f"{side}_shank", self.shank, colour),
            f'<link name="{side}_foot">{massless()}\n'
            f'  <visual>{sphere}<material name="{colour}"/></visual>\n'
            f"  <collision>{sphere}</collision></link>",
        ]


def urdf_of(name: str, parts: Iterable[str]) -> str:
    """A URDF's text from the robot's name and its links and joints."""
    colours = (f'<material name="{n}"><color rgba="{c}"/></material>' for n, c in _COLOURS.items())
    head = ('<?xml version="1.0"?>', f"<robot name={quoteattr(name)}>")
    return "\n".join([*head, *colours, *parts, "</robot>", ""])


def inertial(height: float, mass: float, moments: tuple[float, float, float]) -> str:
    """``<inertial>`` of a link: height of its CoM [m], mass [kg], moments about x, y, z."""
    xx, yy, zz = moments
    return (
        f'\n  <inertial><origin xyz="0 0 {height:.8g}"/><mass value="{mass:.8g}"/>'
        f'<inertia ixx="{xx:.8g}" ixy="0" ixz="0" iyy="{yy:.8g}" iyz="0"'
        f' izz="{zz:.8g}"/></inertial>'
    )


def massless() -> str:
    """Masses of a link that has none; without them PyBullet gives it a kilogram."""
    return (
        '\n  <inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0"'
        ' izz="0"/></inertial>'
    )


def _inertial(link: Link, up: bool = False) -> str:
    return inertial(link.com if up else -link.com, link.mass, link.moments)


def _segment(name: str, link: Link, colour: str) -> str:
    radius = 0.1 * link.length
    return (
        f'<link name="{name}">{_inertial(link)}\n'
        f'  <visual><origin xyz="0 0 {-0.5 * link.length:g}"/><geometry>'
        f'<cylinder radius="{radius:g}" length="{link.length:g}"/></geometry>'
        f'<material name="{colour}"/></visual></link>'
    )


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    axis: str = "",
    origin: str = "0 0 0",
    limit: tuple[float, float, float, float] | None = None,
) -> str:
    """A joint as URDF text; ``limit``: lower, upper [rad], effort [N m], velocity [rad/s]."""
    text = (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'\n  <origin xyz="{origin}"/>'
    )
    if axis:
        text += f'<axis xyz="{axis}"/>'
    if limit is not None:
        lower, upper, effort, velocity = limit
        text += (
            f'<limit lower="{lower:g}" upper="{upper:g}" effort="{effort:g}"'
            f' velocity="{velocity:g}"/>'
        )
    return text + "</joint>"


@dataclass(frozen=True)
class HipBlock(Checked):
    """Link between trunk and thigh: a ball about the hip, turned by the ab-/adduction's motor.

    Attributes:
        mass: [kg].
        radius: [m].
        torque_limit: of the ab-/adduction [N m].
        velocity_limit: [rad/s].
        range: about +x [rad]: the left leg goes outward with positive angles, the right one inward.
    """

    _error = RobotError

    mass: Positive
    radius: Positive
    torque_limit: Positive
    velocity_limit: Positive = 20.0
    range: Interval = (-0.43, 0.43)


@dataclass(frozen=True)
class FloatingBaseFiveLink(Checked):
    """A trunk and two equal legs of hip block, thigh and shank, with spheres as feet.

    Attributes:
        planar: the links, limits and ranges of the sagittal plane. Links that are no rods are
            :class:`SolidLink`; the trunk's moments count most.
        block: of either hip.

    Raises:
        RobotError: if a number of the hip block is not positive and finite.
    """

    _error = RobotError

    planar: FiveLink
    block: HipBlock

    def urdf(self) -> str:
        """The robot as URDF text: the trunk is the root, and either leg has three hinges."""
        planar, block = self.planar, self.block
        moment = _BALL * block.mass * block.radius**2
        ball = inertial(0.0, block.mass, (moment, moment, moment))
        shape = f'<geometry><sphere radius="{block.radius:g}"/></geometry>'
        limit = (*block.range, block.torque_limit, block.velocity_limit)
        parts = [planar.trunk_link()]
        for side, (colour, _) in SIDES.items():
            parts.append(
                f'<link name="{side}_block">{ball}\n'
                f'  <visual>{shape}<material name="{colour}"/></visual></link>'
            )
            parts += planar.leg_links(side)
        for side in SIDES:
            names = (f"{side}_abduction", "revolute", "trunk", f"{side}_block", "1 0 0")
            parts.append(joint(*names, origin=planar.hip_place(side), limit=limit))
            parts += planar.leg_joints(side, f"{side}_block", "0 0 0")
        return urdf_of(planar.name, parts)
