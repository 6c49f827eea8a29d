"""Physical parameters of the bipedal SLIP."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Annotated

from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive, Range

Slope = Annotated[float, Range(-0.25 * pi, 0.25 * pi)]
"""Of ground that one walks on [rad]."""


@dataclass(frozen=True)
class SlipParameters(Checked):
    """Parameters of the bipedal SLIP (Section II-A); the defaults are Table IV's.

    Attributes:
        mass: body mass m [kg].
        gravity: gravitational acceleration g [m/s^2].
        rest_length: rest length l0 of either leg [m].
        leg_stiffness: nominal leg stiffness k0 [N/m].
        slope: angle of the ground, uphill positive [rad]. x points along the ground and y away from
            it; gravity has a part along the ground then.
        assist: forward acceleration that the legs add to their springs' in double stance [m/s^2].
            In single stance no leg can: its force passes its foot.

    Raises:
        ParameterError: if one of the first four is not a positive finite number, the slope is over
            45 degrees, or the assist is not finite.
    """

    mass: Positive = 80.0
    gravity: Positive = 9.81
    rest_length: Positive = 1.0
    leg_stiffness: Positive = 16.5e3
    slope: Slope = 0.0
    assist: Annotated[float, Range()] = 0.0

    def __repr__(self) -> str:
        text = (
            f"mass={self.mass:.6g}, gravity={self.gravity:.6g}, rest_length={self.rest_length:.6g},"
            f" leg_stiffness={self.leg_stiffness:.6g}"
        )
        more = {"slope": self.slope, "assist": self.assist}
        text += "".join(f", {name}={value:.6g}" for name, value in more.items() if value)
        return f"SlipParameters({text})"

    @property
    def gravity_parts(self) -> tuple[float, float]:
        """Gravity into the ground, and along it, backward positive [m/s^2]."""
        return self.gravity * cos(self.slope), self.gravity * sin(self.slope)

    @property
    def speed_unit(self) -> float:
        """sqrt(g l0), the unit of other speeds [m/s]."""
        return sqrt(self.gravity * self.rest_length)
