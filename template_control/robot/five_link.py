"""URDFs of five-link bipeds with point feet, planar or with a floating base, from tables."""

from __future__ import annotations

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from template_control.checks.checked import Checked
from template_control.checks.ranges import Interval, NotNegative, Positive
from template_control.errors import RobotError

_COLOURS = (
    ("grey", "0.55 0.57 0.60 1"),
    ("blue", "0.16 0.38 0.63 1"),
    ("orange", "0.86 0.45 0.13 1"),
)
# Colour of a side's leg, and its place over the hips' distance.
_SIDES = {"left": ("blue", 0.5), "right": ("orange", -0.5)}
_BALL = 0.4  # moment of inertia of a ball, over its mass and the square of its radius
PLANAR_BASE = (
    ("base_x", "prismatic", "world", "slide_x", "1 0 0"),
    ("base_z", "prismatic", "slide_x", "slide_z", "0 0 1"),
    ("base_pitch", "revolute", "slide_z", "trunk", "0 1 0"),
)
"""Joints that hold a trunk in its plane: names, kinds, parents, children and axes."""


@dataclass(frozen=True)
class Link(Checked):
    """A rigid link.

    Attributes:
        length: [m].
        mass: [kg].
        com: distance of its centre of mass from its upper joint (the trunk's: from the hip,
            upwards) [m].
        inertia: about +y through its centre of mass [kg m^2].
        side_inertia: about +x and +z there [kg m^2]; None: those of a rod along z. The plane does
            not feel them.
    """

    _error = RobotError

    length: Positive
    mass: Positive
    com: Positive
    inertia: Positive
    side_inertia: tuple[Positive, Positive] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.com > self.length:
            raise RobotError(
                f"Link.com is {self.com:g} m, outside a link of {self.length:g} m: give at most its"
                " length"
            )


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
        block: of either hip, of a robot with a floating base; None: the robot is planar. In space
            the links' ``side_inertia`` counts, the trunk's most.

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
    block: HipBlock | None = None

    def urdf(self) -> str:
        """The robot as URDF text.

        A planar one has x, z and pitch, unactuated, and hinges about +y. With a ``block`` the trunk
        is the root, and either leg has three hinges.
        """
        trunk, thigh, shank, block = self.trunk, self.thigh, self.shank, self.block
        size = f"{0.4 * trunk.length:g} {1.5 * self.hip_width:g} {trunk.length:g}"
        box = _shape(f'box size="{size}"', 0.5 * trunk.length)
        links, joints = [_link("trunk", _of_link(trunk, up=True), box, "grey", touches=True)], []
        if block is None:
            held = (f'<link name="{name}">{_MASSLESS}</link>' for name in ("slide_x", "slide_z"))
            links = ['<link name="world"/>', *held, *links]
            joints = [_joint(*row, limit=(-1e3, 1e3, 0.0, 1e3)) for row in PLANAR_BASE]
        (hip, knee), speed, lateral = self.torque_limit, self.velocity_limit, "0 1 0"
        hip_limit, knee_limit = (*self.hip_range, hip, speed), (*self.knee_range, knee, speed)
        bend, end = f"0 0 {-thigh.length:g}", f"0 0 {-shank.length:g}"
        foot_ball = _shape(f'sphere radius="{self.foot_radius:g}"')
        for side, (colour, place) in _SIDES.items():
            parent, origin = "trunk", f"0 {place * self.hip_width:g} 0"
            upper, lower, foot = f"{side}_thigh", f"{side}_shank", f"{side}_foot"
            if block is not None:
                name, moments = f"{side}_block", (_BALL * block.mass * block.radius**2,) * 3
                inertial = _inertial(0.0, block.mass, moments)
                hip_ball = _shape(f'sphere radius="{block.radius:g}"')
                links.append(_link(name, inertial, hip_ball, colour))
                limit = (*block.range, block.torque_limit, block.velocity_limit)
                ends = (f"{side}_abduction", "revolute", parent, name)
                joints.append(_joint(*ends, "1 0 0", origin, limit))
                parent, origin = name, "0 0 0"
            links += [
                _link(upper, _of_link(thigh), _rod(thigh), colour),
                _link(lower, _of_link(shank), _rod(shank), colour),
                _link(foot, _MASSLESS, foot_ball, colour, touches=True),
            ]
            joints += [
                _joint(f"{side}_hip", "revolute", parent, upper, lateral, origin, hip_limit),
                _joint(f"{side}_knee", "revolute", upper, lower, lateral, bend, knee_limit),
                _joint(f"{side}_ankle", "fixed", lower, foot, origin=end),
            ]
        colours = (f'<material name="{n}"><color rgba="{c}"/></material>' for n, c in _COLOURS)
        robot = ('<?xml version="1.0"?>', f"<robot name={quoteattr(self.name)}>")
        return "\n".join([*robot, *colours, *links, *joints, "</robot>", ""])


# Without masses PyBullet gives a link a kilogram.
_MASSLESS = (
    '\n  <inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0"'
    ' izz="0"/></inertial>'
)


def _inertial(height: float, mass: float, moments: tuple[float, float, float]) -> str:
    """``<inertial>`` of a link: height of its CoM [m], mass [kg], moments about x, y, z."""
    xx, yy, zz = moments
    return (
        f'\n  <inertial><origin xyz="0 0 {height:.8g}"/><mass value="{mass:.8g}"/>'
        f'<inertia ixx="{xx:.8g}" ixy="0" ixz="0" iyy="{yy:.8g}" iyz="0"'
        f' izz="{zz:.8g}"/></inertial>'
    )


def _of_link(link: Link, up: bool = False) -> str:
    x, z = link.side_inertia or (link.inertia, 0.1 * link.inertia)
    return _inertial(link.com if up else -link.com, link.mass, (x, link.inertia, z))


def _shape(kind: str, height: float | None = None) -> str:
    """A shape, with its middle at a ``height`` over its link's origin [m]."""
    place = "" if height is None else f'<origin xyz="0 0 {height:g}"/>'
    return f"{place}<geometry><{kind}/></geometry>"


def _rod(link: Link) -> str:
    size = f'radius="{0.1 * link.length:g}" length="{link.length:g}"'
    return _shape(f"cylinder {size}", -0.5 * link.length)


def _link(name: str, inertial: str, shape: str, colour: str, touches: bool = False) -> str:
    """A link shown as a shape, which others meet if it ``touches`` them."""
    seen = f'\n  <visual>{shape}<material name="{colour}"/></visual>'
    felt = f"\n  <collision>{shape}</collision>" if touches else ""
    return f'<link name="{name}">{inertial}{seen}{felt}</link>'


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    axis: str = "",
    origin: str = "0 0 0",
    limit: tuple[float, ...] = (),
) -> str:
    """A joint; ``limit``, with an axis: lower, upper [rad], effort [N m], velocity [rad/s]."""
    text = (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'\n  <origin xyz="{origin}"/>'
    )
    if axis:
        lower, upper, effort, velocity = limit
        text += (
            f'<axis xyz="{axis}"/><limit lower="{lower:g}" upper="{upper:g}" effort="{effort:g}"'
            f' velocity="{velocity:g}"/>'
        )
    return text + "</joint>"
