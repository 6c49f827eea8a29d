"""Physical parameters of the bipedal SLIP."""

from __future__ import annotations

import math
from dataclasses import dataclass

from template_control.errors import ParameterError


@dataclass(frozen=True)
class SlipParameters:
    """Parameters of the bipedal SLIP (Section II-A); the defaults are Table IV's.

    Attributes:
        mass: body mass m [kg].
        gravity: gravitational acceleration g [m/s^2].
        rest_length: rest length l0 of either leg [m].
        leg_stiffness: nominal leg stiffness k0 [N/m].

    Raises:
        ParameterError: if any of them is not a positive finite number.
    """

    mass: float = 80.0
    gravity: float = 9.81
    rest_length: float = 1.0
    leg_stiffness: float = 16.5e3

    def __post_init__(self) -> None:
        for name in ("mass", "gravity", "rest_length", "leg_stiffness"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError(
                    f"SLIP parameter {name} is {value!r}: give a positive finite number"
                )
