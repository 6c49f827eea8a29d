"""Dynamic similarity: one tuning for robots of any size.

Every tuned number is given for the reference template (80 kg, 1 m, 9.81 m/s^2) and knows its
dimension. For another template lengths, times and speeds are scaled so that the dimensionless
robot moves the same; masses and forces follow from the robot's own model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.slip.parameters import SlipParameters

T = TypeVar("T")

REFERENCE = SlipParameters()
"""The template that all tuning is given for."""


class Dimension(NamedTuple):
    """Dimension of a number: powers of metres and seconds; angles, shares and counts have none."""

    length: int = 0
    time: int = 0


NUMBER = Dimension()
LENGTH = Dimension(1, 0)
TIME = Dimension(0, 1)
SPEED = Dimension(1, -1)
ACCELERATION = Dimension(1, -2)
RATE = Dimension(0, -1)
"""The dimension of a damping or a bandwidth [1/s]."""
RATE_SQUARED = Dimension(0, -2)
"""The dimension of a stiffness over a mass, and of an angular acceleration [1/s^2]."""
PER_LENGTH_SQUARED = Dimension(-2, 0)
"""The dimension of a squared length's weight [1/m^2]."""
PER_SPEED_SQUARED = Dimension(-2, 2)
"""The dimension of a squared speed's weight [s^2/m^2]."""
PER_ACCELERATION_SQUARED = Dimension(-2, 4)
"""The dimension of a squared acceleration's weight [s^4/m^2]."""
PER_RATE_TO_THE_FOURTH = Dimension(0, 4)
"""The dimension of a squared angular acceleration's weight [s^4/rad^2]."""

_KEY = "dimension"


def tuned(default: T, *dimensions: Dimension) -> T:
    """A field of an options class, with its dimension and its default for the reference template.

    Of a tuple there is one dimension for all its entries, or one each; an entry that is a tuple
    itself has the dimension of its place in the outer one.
    """
    found: T = field(default=default, metadata={_KEY: dimensions or (NUMBER,)})
    return found


@dataclass(frozen=True)
class Scale(Checked):
    """Units of a template over those of the reference template.

    Attributes:
        length: l0 over the reference's l0.
        time: sqrt(l0 / g) over the reference's.
    """

    length: Positive
    time: Positive

    @classmethod
    def of(cls, parameters: SlipParameters) -> Scale:
        """The units of a template."""
        length = parameters.rest_length / REFERENCE.rest_length
        return cls(length, float(np.sqrt(length * REFERENCE.gravity / parameters.gravity)))

    @property
    def speed(self) -> float:
        """The unit of speeds."""
        return self.factor(SPEED)

    @property
    def state(self) -> Array:
        """(3,) units of a section state dx/dt, y, dy/dt."""
        return np.array([self.speed, self.length, self.speed])

    def factor(self, dimension: Dimension) -> float:
        """Factor of a number of this dimension."""
        return float(self.length**dimension.length * self.time**dimension.time)


def scaled(options: T, scale: Scale) -> T:
    """The same tuning for a template of another size, whose ``scale`` it is.

    Fields from :func:`tuned` are scaled, also those of dataclasses in fields, tuples or mappings.
    """
    changes = {
        f.name: _scaled_value(getattr(options, f.name), f.metadata.get(_KEY, ()), scale)
        for f in fields(options)  # type: ignore[arg-type]
    }
    return replace(options, **changes)  # type: ignore[type-var]


def _scaled_value(value: Any, dimensions: tuple[Dimension, ...], scale: Scale) -> Any:
    """A field's value; the ``dimensions`` are those of :func:`tuned`, none of other fields."""
    if is_dataclass(value) and not isinstance(value, type):
        return scaled(value, scale)
    if isinstance(value, Mapping):
        return {key: _scaled_value(entry, dimensions, scale) for key, entry in value.items()}
    if isinstance(value, tuple):
        if len(dimensions) < 2 or (value and isinstance(value[0], tuple)):
            return tuple(_scaled_value(entry, dimensions, scale) for entry in value)
        pairs = zip(value, dimensions, strict=True)
        return tuple(_scaled_value(entry, (dimension,), scale) for entry, dimension in pairs)
    if value is None or dimensions in ((), (NUMBER,)):
        return value
    return value * scale.factor(dimensions[0])
