"""URDF of a five-link biped that nothing holds: a planar one's table, and hips that move aside."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import Interval, Positive
from template_control.errors import RobotError
from template_control.robot.five_link import SIDES, FiveLink, inertial, joint, urdf_of

_BALL = 0.4  # moment of inertia of a ball, over its mass and the square of its radius


@dataclass(frozen=True)
class HipBlock(Checked):
    """What is between trunk and thigh: a ball about the hip, turned by the ab-/adduction's motor.

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
class FreeFiveLink(Checked):
    """A trunk and two equal legs of hip block, thigh and shank, with spheres as feet.

    Attributes:
        planar: the links, limits and ranges of the sagittal plane. Links that are no rods are
            :class:`~template_control.robot.five_link.SolidLink`; the trunk's moments tell most.
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
