"""The frame in which a robot walks straight on, while it turns in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Heading:
    """A frame with x forward, y to the left and z up, turned about the vertical.

    A turn goes about a point that keeps its coordinates. About the stance foot at VLO, where the
    CoM is beside it, x of the CoM and the way walked have no jump.

    Attributes:
        angle: from the world's x to the frame's, to the left [rad]; it grows with each turn.
        pivot: (2,) x and y of a point in the world [m].
        place: (2,) its coordinates in the frame [m].
    """

    angle: float = 0.0
    pivot: tuple[float, float] = (0.0, 0.0)
    place: tuple[float, float] = (0.0, 0.0)

    def turned(self, by: float, about: Array) -> Heading:
        """The frame after a turn.

        Args:
            by: to the left [rad].
            about: (2,) or (3,) the point in the world that keeps its coordinates [m].
        """
        x, y = self.position(about)[:2]
        return Heading(self.angle + by, (float(about[0]), float(about[1])), (float(x), float(y)))

    def vector(self, world: Array) -> Array:
        """Of a vector in the world: velocity, force, momentum or angular momentum.

        Args:
            world: (..., 2) or (..., 3); z stays as it is.
        """
        return _rotated(world, -self.angle)

    def position(self, world: Array) -> Array:
        """Coordinates of points.

        Args:
            world: (..., 2) or (..., 3) their coordinates in the world [m].
        """
        away = np.array(world, dtype=float)
        away[..., :2] -= self.pivot
        found = _rotated(away, -self.angle)
        found[..., :2] += self.place
        return found

    def world_vector(self, vector: Array) -> Array:
        """The other way: a vector (..., 2) or (..., 3) of the frame in the world."""
        return _rotated(vector, self.angle)

    def world_position(self, position: Array) -> Array:
        """The other way: points (..., 2) or (..., 3) of the frame in the world [m]."""
        away = np.array(position, dtype=float)
        away[..., :2] -= self.place
        found = _rotated(away, self.angle)
        found[..., :2] += self.pivot
        return found

    def yaw(self, world: float) -> float:
        """Of a body, from the frame's x, in [-pi, pi) [rad].

        Args:
            world: its yaw in the world [rad].
        """
        return float((world - self.angle + np.pi) % (2.0 * np.pi) - np.pi)


def _rotated(vectors: Array, angle: float) -> Array:
    """Vectors (..., 2) or (..., 3) turned to the left about z; a copy."""
    turned = np.array(vectors, dtype=float)
    c, s = np.cos(angle), np.sin(angle)
    x, y = turned[..., 0].copy(), turned[..., 1].copy()
    turned[..., 0], turned[..., 1] = c * x - s * y, s * x + c * y
    return turned
