"""Axes in which a robot moves on a slope.

In them a slope is level, and gravity is not vertical; their x points where the robot goes,
which may be backward. Template, planners, references and QP live in them; only here is the world
known.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np

from template_control.arrays import Array, Pair
from template_control.compiled import compiled
from template_control.robot.biped import Biped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import onward
from template_control.structured import structure

_BASE = 2  # the first coordinates are the base's place
FRAME = structure(
    angle=float,  # of the ground, uphill positive [rad]
    turn=(float, (_BASE, _BASE)),  # vectors of the world into axes that lean as it does
    shift=(float, (_BASE,)),  # of places, once they are turned [m]
    on=float,  # 1; -1 if these axes' x points the other way than theirs
)
"""Axes that lean with the ground, and may be turned round about the normal to it."""


@compiled
def to_world(frame: Any, x: float, y: float, out: Array) -> None:
    """Write a place of the frame's axes in the world's, (2,) [m]; ``frame`` is of ``FRAME``."""
    vector_to_world(frame, x - frame.on * frame.shift[0], y - frame.shift[1], out)


@compiled
def vector_to_world(frame: Any, x: float, y: float, out: Array) -> None:
    """As :func:`to_world`, of a vector."""
    x *= frame.on
    out[0] = x * frame.turn[0, 0] + y * frame.turn[1, 0]
    out[1] = x * frame.turn[0, 1] + y * frame.turn[1, 1]


class SlopeFrame:
    """Turns states into axes that lean with the ground, and results back into the world's.

    The robot's gravity is turned as well; a floating-base robot stays in the world's axes. ``data``
    (1,) are of ``FRAME``, ``angle`` is the ground's, uphill positive [rad]. The axes' x points
    where a planar robot goes. Of its state only the sagittal terms are turned round for that, by
    its model (``facing``), whose coordinates stay those of a trunk that faces uphill or downhill as
    it does. ``raw_state`` is q and v in the world, as they entered last. ``turns``: the robot's
    kind can be looked at in other axes; ``of_world``: its terms are in the world's.
    """

    raw_state: tuple[Array, Array]

    def __init__(self, robot: Biped, data: Any) -> None:
        self._robot, self.data = robot, data
        self._planar = robot if isinstance(robot, PlanarBiped) else None
        self.turns = self._planar is not None
        self._turn: Array = data["turn"][0]
        self._shift: Array = data["shift"][0]
        self.reset()

    def reset(self) -> None:
        """Back to the world's axes."""
        self._take(0.0, np.eye(_BASE), np.zeros(_BASE), on=1.0)
        if self._planar is not None:
            self._planar.facing = 0.0
            self._planar.turn_gravity(0.0)

    def _take(self, angle: float, turn: Array, shift: Array, on: float) -> None:
        self.angle = self.data["angle"][0] = angle
        self._turn[:], self._shift[:], self.data["on"] = turn, shift, on
        self._along = np.array([on, 1.0])  # vectors with x as these axes', or the other way
        self.of_world = angle == 0.0 and on == 1.0
        self._level = angle == 0.0 and not shift.any()

    def turn_round(self) -> None:
        """Let x point the other way; takes effect at the robot's next update."""
        assert self._planar is not None
        self._planar.facing = 0.0 if self._planar.facing else pi
        self._take(-self.angle, self._turn, self._shift, onward(self._planar.facing))

    def tilt(self, angle: float, place: Array) -> None:
        """Take the axes of an angle of the ground [rad]; ``place`` (2,) keeps its coordinates."""
        if self._planar is None or angle == self.angle:
            return
        fixed, on = self.world(place), float(self._along[0])
        c, s = cos(on * angle), sin(on * angle)
        turn = np.array([[c, s], [-s, c]])
        self._take(angle, turn, place * self._along - turn @ fixed, on)
        self._planar.turn_gravity(on * angle)

    def enter(self, q: Array, v: Array) -> tuple[Array, Array]:
        """q (nq,) and v (nv,) for the model, of the world's; the given arrays stay as they are."""
        self.raw_state = q, v
        if self._level:
            return q, v
        inside, speed = q.copy(), v.copy()
        inside[:_BASE] = self._turn @ q[:_BASE] + self._shift
        inside[_BASE] += self._along[0] * self.angle
        speed[:_BASE] = self._turn @ v[:_BASE]
        return inside, speed

    def leave(self, acceleration: Array) -> Array:
        """(nv,) acceleration in the world's coordinates, from the model's."""
        outside = acceleration.copy()
        outside[:_BASE] = acceleration[:_BASE] @ self._turn
        return outside

    def inward(self, vector: Array) -> Array:
        """(..., 2) vectors in these axes, from the world's."""
        return vector if self.of_world else (vector @ self._turn.T) * self._along

    def outward(self, vector: Array) -> Array:
        """(..., 2) vectors in the world's axes, from these."""
        return vector if self.of_world else (vector * self._along) @ self._turn

    def world(self, place: Array) -> Array:
        """(..., 2) places in the world, from these axes [m]."""
        return (place * self._along - self._shift) @ self._turn

    def foothold(self, foot: int) -> Pair:
        """x and height of a foot in the world [m]."""
        x, height = self.world(self._robot.foot_position[foot]).tolist()
        return x, height
