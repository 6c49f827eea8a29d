"""The template of a robot, and the gaits it walks."""

from __future__ import annotations

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.ranges import Angle
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.requirements import BASE_DOF
from template_control.slip.gaits.gait import WalkingGait, gait_at, gait_from_energy
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import REFERENCE, Scale

_TOUCHDOWN = float(np.radians(66.0))
_WALK = (_TOUCHDOWN, 1.1 / float(np.sqrt(REFERENCE.gravity * REFERENCE.rest_length)))
# Of the straight leg at touchdown, as five-link with l0 = 1 m; the test
# test_the_reference_template_is_five_link_s holds it.
_STRETCH = 0.903514524055713


@checked
def default_gait(robot: PlanarBiped, touchdown_angle: Angle | None = None) -> WalkingGait:
    """The robot's walk: its own if it has one, else 66 degrees and 1.1 m/s for l0 = 1 m.

    Args:
        robot: its last update is overwritten.
        touchdown_angle: another one than the walk's, at the same speed at VLO [rad].

    Raises:
        GaitError: if there is no gait with that angle.
    """
    parameters = template_for(robot)
    angle, speed = robot.walk or _WALK
    unit = np.sqrt(parameters.gravity * parameters.rest_length)
    return gait_at(
        parameters, angle if touchdown_angle is None else touchdown_angle, float(speed * unit)
    )


@checked
def paper_gait(parameters: SlipParameters) -> WalkingGait:
    """The equilibrium of Section IV-D: 0.9818 m and 826 J for 80 kg and l0 = 1 m."""
    scale = Scale.of(parameters)
    energy = parameters.mass / REFERENCE.mass * scale.speed**2
    return gait_from_energy(parameters, 0.9818 * scale.length, 826.0 * energy)


@checked
def template_for(robot: PlanarBiped) -> SlipParameters:
    """The reference template scaled to a robot's mass and legs by dynamic similarity.

    l0 is such that the leg is stretched as far at the default gait's touchdown as the
    five-link robot's, whose CoM is 1 m from its foot then; the stiffness keeps k l0 / (m g).

    Args:
        robot: its last update is overwritten.
    """
    q = np.zeros(robot.nv)
    for leg in robot.legs:
        q[[BASE_DOF + joint for joint in leg]] = 0.0
    robot.update(q, np.zeros(robot.nv))
    above_hip = float(robot.com[1] - robot.hip_height(q))
    reach = _STRETCH * (robot.leg_length + robot.foot_radius)
    sine, cosine = float(np.sin(_TOUCHDOWN)), float(np.cos(_TOUCHDOWN))
    length = above_hip * sine + float(np.sqrt(reach**2 - (above_hip * cosine) ** 2))
    weight = robot.mass * robot.gravity
    relative = REFERENCE.leg_stiffness * REFERENCE.rest_length
    relative /= REFERENCE.mass * REFERENCE.gravity
    return SlipParameters(robot.mass, robot.gravity, length, relative * weight / length)
