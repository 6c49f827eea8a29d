"""Axes that are turned with the ground: in them a slope is level, and gravity is not vertical.

Template, planners, references and QP live in them; only here is the world known.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from template_control.robot.biped import Biped
from template_control.robot.planar_biped import PlanarBiped

Array = NDArray[np.float64]

_BASE = 2  # the first coordinates are the base's place


class SlopeFrame:
    """Turns states into the ground's axes and what comes of them back into the world's.

    Args:
        robot: the model, whose gravity is turned as well; a free one stays in the world's axes.

    Attributes:
        angle: of the ground, uphill positive [rad].
    """

    def __init__(self, robot: Biped) -> None:
        self._planar = robot if isinstance(robot, PlanarBiped) else None
        self.reset()

    def reset(self) -> None:
        """Back to the world's axes."""
        self.angle = 0.0
        self._turn = np.eye(_BASE)
        self._shift = np.zeros(_BASE)
        self._level = True  # these are the world's axes
        if self._planar is not None:
            self._planar.turn_gravity(0.0)

    @property
    def turns(self) -> bool:
        """Whether the robot's kind can be looked at in other axes."""
        return self._planar is not None

    def lean(self, angle: float, place: Array) -> None:
        """Take other axes.

        Args:
            angle: of the ground [rad].
            place: (2,) a point in the present axes that keeps its coordinates [m].
        """
        if self._planar is None or angle == self.angle:
            return
        fixed = self.world(place)
        self.angle = angle
        c, s = cos(angle), sin(angle)
        self._turn = np.array([[c, s], [-s, c]])
        self._shift = place - self._turn @ fixed
        self._level = angle == 0.0 and not self._shift.any()
        self._planar.turn_gravity(angle)

    def enter(self, q: Array, v: Array) -> tuple[Array, Array]:
        """A robot's state in these axes; the arrays that are given stay as they are.

        Args:
            q: (nq,) configuration in the world.
            v: (nv,) velocity in the world.
        """
        if self._level:
            return q, v
        inside, speed = q.copy(), v.copy()
        inside[:_BASE] = self._turn @ q[:_BASE] + self._shift
        inside[_BASE] += self.angle
        speed[:_BASE] = self._turn @ v[:_BASE]
        return inside, speed

    def inward(self, vector: Array) -> Array:
        """(..., 2) vectors in these axes, from the world's."""
        return vector if self.angle == 0.0 else vector @ self._turn.T

    def world(self, place: Array) -> Array:
        """(..., 2) places in the world, from these axes [m]."""
        return place if self._level else (place - self._shift) @ self._turn

    def point(self, x: float, y: float) -> tuple[float, float]:
        """As :meth:`world`, of one place."""
        if not self._level:
            x, y = self.world(np.array([x, y])).tolist()
        return x, y

    def outward(self, vector: Array) -> Array:
        """(..., n) vectors in the world's axes; their first two numbers are turned."""
        if self.angle == 0.0:
            return vector
        turned = vector.copy()
        turned[..., :_BASE] = vector[..., :_BASE] @ self._turn
        return turned
