"""URDF of a planar five-link biped with point feet, from a table of its links."""

from __future__ import annotations

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from template_control.checks.checked import Checked
from template_control.checks.ranges import Interval, NotNegative, Positive
from template_control.errors import RobotError

_COLOURS = {"grey": "0.55 0.57 0.60 1", "blue": "0.16 0.38 0.63 1", "orange": "0.86 0.45 0.13 1"}
_SIDES = (("left", "blue", 0.5), ("right", "orange", -0.5))
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
        thigh, shank = self.thigh, self.shank
        parts = [
            f"<robot name={quoteattr(self.name)}>",
            *(f'<material name="{n}"><color rgba="{c}"/></material>' for n, c in _COLOURS.items()),
            '<link name="world"/>',
            *(f'<link name="{name}">{_massless()}</link>' for name in ("slide_x", "slide_z")),
            self._trunk(),
        ]
        for side, colour, _ in _SIDES:
            parts += [
                _segment(f"{side}_thigh", thigh, colour),
                _segment(f"{side}_shank", shank, colour),
                self._foot(f"{side}_foot", colour),
            ]
        parts += [_joint(*row, limit=(-1e3, 1e3, 0.0, 1e3)) for row in _BASE]
        axis = "0 1 0"
        for side, _, share in _SIDES:
            hip, knee = self.torque_limit
            parts += [
                _joint(
                    f"{side}_hip",
                    "revolute",
                    "trunk",
                    f"{side}_thigh",
                    axis,
                    origin=f"0 {share * self.hip_width:g} 0",
                    limit=(*self.hip_range, hip, self.velocity_limit),
                ),
                _joint(
                    f"{side}_knee",
                    "revolute",
                    f"{side}_thigh",
                    f"{side}_shank",
                    axis,
                    origin=f"0 0 {-thigh.length:g}",
                    limit=(*self.knee_range, knee, self.velocity_limit),
                ),
                _joint(
                    f"{side}_ankle",
                    "fixed",
                    f"{side}_shank",
                    f"{side}_foot",
                    origin=f"0 0 {-shank.length:g}",
                ),
            ]
        return "\n".join(['<?xml version="1.0"?>', *parts, "</robot>", ""])

    def _trunk(self) -> str:
        trunk = self.trunk
        size = f"{0.4 * trunk.length:g} {1.5 * self.hip_width:g} {trunk.length:g}"
        box = f'<geometry><box size="{size}"/></geometry>'
        place = f'<origin xyz="0 0 {0.5 * trunk.length:g}"/>'
        return (
            f'<link name="trunk">{_inertial(trunk, up=True)}\n'
            f'  <visual>{place}{box}<material name="grey"/></visual>\n'
            f"  <collision>{place}{box}</collision></link>"
        )

    def _foot(self, name: str, colour: str) -> str:
        sphere = f'<geometry><sphere radius="{self.foot_radius:g}"/></geometry>'
        return (
            f'<link name="{name}">{_massless()}\n  <visual>{sphere}<material name="{colour}"/>'
            f"</visual>\n  <collision>{sphere}</collision></link>"
        )


def _inertia(value: float) -> str:
    # Out of the plane any physically valid number serves: a link that is a rod along z.
    return (
        f'<inertia ixx="{value:.8g}" ixy="0" ixz="0" iyy="{value:.8g}" iyz="0"'
        f' izz="{0.1 * value:.8g}"/>'
    )


def _inertial(link: Link, up: bool = False) -> str:
    height = link.com if up else -link.com
    return (
        f'\n  <inertial><origin xyz="0 0 {height:.8g}"/><mass value="{link.mass:.8g}"/>'
        f"{_inertia(link.inertia)}</inertial>"
    )


def _massless() -> str:
    # Without an explicit zero PyBullet gives a link a kilogram.
    return '\n  <inertial><mass value="0"/>' + _inertia(0.0) + "</inertial>"


def _segment(name: str, link: Link, colour: str) -> str:
    radius = 0.1 * link.length
    return (
        f'<link name="{name}">{_inertial(link)}\n'
        f'  <visual><origin xyz="0 0 {-0.5 * link.length:g}"/><geometry>'
        f'<cylinder radius="{radius:g}" length="{link.length:g}"/></geometry>'
        f'<material name="{colour}"/></visual></link>'
    )


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    axis: str = "",
    origin: str = "0 0 0",
    limit: tuple[float, float, float, float] | None = None,
) -> str:
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
