"""Physical parameters of the bipedal SLIP."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive


@dataclass(frozen=True)
class SlipParameters(Checked):
    """Parameters of the bipedal SLIP (Section II-A); the defaults are Table IV's.

    Attributes:
        mass: body mass m [kg].
        gravity: gravitational acceleration g [m/s^2].
        rest_length: rest length l0 of either leg [m].
        leg_stiffness: nominal leg stiffness k0 [N/m].

    Raises:
        ParameterError: if any of them is not a positive finite number.
    """

    mass: Positive = 80.0
    gravity: Positive = 9.81
    rest_length: Positive = 1.0
    leg_stiffness: Positive = 16.5e3

    @property
    def speed_unit(self) -> float:
        """sqrt(g l0), the speed that others are told over [m/s]."""
        return sqrt(self.gravity * self.rest_length)
