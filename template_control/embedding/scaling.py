"""Dynamic similarity: one tuning for robots of any size.

The controller and the planners are tuned for the reference template (80 kg, 1 m, 9.81 m/s^2).
For another one lengths, times and speeds are scaled so that the dimensionless robot walks the
same; masses and forces follow from the robot's own model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from template_control.embedding.step_planning import ReplanOptions
from template_control.embedding.swing_foot import SwingOptions
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.requirements import BASE_DOF
from template_control.slip.gaits.gait import WalkingGait, gait_at, gait_from_energy
from template_control.slip.parameters import SlipParameters
from template_control.whole_body.tasks import Gains, Weights

REFERENCE = SlipParameters()
_TOUCHDOWN = float(np.radians(66.0))
_WALK = (_TOUCHDOWN, 1.1 / float(np.sqrt(REFERENCE.gravity * REFERENCE.rest_length)))
_STRETCH = 0.903514524055713  # of the straight leg at touchdown, as five-link with l0 = 1 m


@dataclass(frozen=True)
class Scale:
    """Units of a template over those of the reference.

    Attributes:
        length: l0 over l0.
        time: sqrt(l0 / g) over sqrt(l0 / g).
    """

    length: float
    time: float

    @classmethod
    def of(cls, parameters: SlipParameters) -> Scale:
        """Of a template."""
        length = parameters.rest_length / REFERENCE.rest_length
        return cls(length, float(np.sqrt(length * REFERENCE.gravity / parameters.gravity)))

    @property
    def speed(self) -> float:
        """Of velocities."""
        return self.length / self.time

    def state(self, values: tuple[float, float, float]) -> tuple[float, float, float]:
        """A VLO state (or a tolerance of one) in this template's units."""
        return values[0] * self.speed, values[1] * self.length, values[2] * self.speed

    def state_cost(self, values: tuple[float, float, float]) -> tuple[float, float, float]:
        """Weights of a VLO state's squares."""
        speed, length = self.speed**-2, self.length**-2
        return values[0] * speed, values[1] * length, values[2] * speed

    def gains(self, gains: Gains) -> Gains:
        """PD gains."""

        def scaled(pair: tuple[float, float]) -> tuple[float, float]:
            return pair[0] / self.time**2, pair[1] / self.time

        pairs = (gains.com, gains.trunk, gains.swing, gains.reach)
        return Gains(*(scaled(pair) for pair in pairs))

    def weights(self, weights: Weights) -> Weights:
        """Task weights: those of linear accelerations, and of the trunk's."""
        linear, angular = (self.time**2 / self.length) ** 2, self.time**4
        x, y, trunk, swing_x, swing_y = weights.rows
        rows = (x * linear, y * linear, trunk * angular, swing_x * linear, swing_y * linear)
        return replace(weights, rows=rows)

    def swing(self, options: SwingOptions) -> SwingOptions:
        """Shape of the swing."""
        return replace(
            options,
            clearance=options.clearance * self.length,
            landing_speed=options.landing_speed * self.speed,
            horizon=options.horizon * self.time,
            lead=options.lead * self.time,
            reach_acceleration=options.reach_acceleration * self.speed / self.time,
        )

    def replan(self, options: ReplanOptions) -> ReplanOptions:
        """When to plan anew."""
        return replace(
            options,
            speed=options.speed * self.speed,
            interval=options.interval * self.time,
            patience=options.patience * self.time,
            agility=options.agility / self.time**2,
        )


def default_gait(robot: PlanarBiped) -> WalkingGait:
    """The robot's walk: its own if it has one, else 66 degrees and 1.1 m/s for l0 = 1 m.

    Args:
        robot: its last update is overwritten.
    """
    parameters = template_for(robot)
    angle, speed = robot.walk or _WALK
    unit = np.sqrt(parameters.gravity * parameters.rest_length)
    return gait_at(parameters, angle, float(speed * unit))


def paper_gait(parameters: SlipParameters) -> WalkingGait:
    """The equilibrium of Section IV-D: 0.9818 m and 826 J for 80 kg and l0 = 1 m."""
    scale = Scale.of(parameters)
    energy = parameters.mass / REFERENCE.mass * scale.speed**2
    return gait_from_energy(parameters, 0.9818 * scale.length, 826.0 * energy)


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
