"""The ground's slope as the feet tell it, and the axes that lean with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.learners.slope import SlopeEstimate, SlopeOptions
from template_control.embedding.references.slope_frame import SlopeFrame
from template_control.embedding.sensing import Sensing
from template_control.embedding.stride_planning import StridePlanning
from template_control.robot.biped import Biped

Array = NDArray[np.float64]


class SlopingGround:
    """Learns how steep the ground is, and turns the axes as far as the planner knows slopes.

    Args:
        robot: the model; every tick updates it, in these axes.
        options: of the slope's estimate.
        length: l0 of the template [m].

    Attributes:
        frame: the axes.
        slope: the estimate.
        told: the robot's configuration and velocity in the world, as they were measured last.
    """

    told: tuple[Array, Array]

    def __init__(self, robot: Biped, options: SlopeOptions, length: float) -> None:
        self._robot = robot
        self.frame = SlopeFrame(robot)
        self.slope = SlopeEstimate(options, length)

    def begin(self, foot: int) -> None:
        """Forget an earlier run; ``foot`` stands."""
        self.slope.begin(self._foothold(foot))

    def stand(self, foot: int, other: int) -> None:
        """Both feet stand: the ground is as steep as the line through them.

        Args:
            foot, other: the rear and the front one.
        """
        self.slope.stand(self._foothold(foot), self._foothold(other))

    def enter(self, q: Array, v: Array) -> tuple[Array, Array]:
        """As :meth:`.SlopeFrame.enter`; what is told is kept."""
        self.told = q, v
        return self.frame.enter(q, v)

    def land(self, foot: int) -> None:
        """A foot has landed: learn the slope."""
        self.slope.land(self._foothold(foot), self._foothold(1 - foot))

    def lean(self, slope: float, foot: int, planning: StridePlanning, sensing: Sensing) -> bool:
        """Turn the axes about a foot, and read the robot's model in them.

        Args:
            slope: of the ground [rad].
            foot: that keeps its coordinates.
            planning: which is asked what slope it plans for.
            sensing: whose state has to be read again if the axes have turned.

        Returns:
            Whether they turned.
        """
        robot, frame = self._robot, self.frame
        slope = planning.on_slope(slope) if frame.turns else 0.0
        if slope == frame.angle:
            return False
        unhit = frame.outward(sensing.unhit)
        frame.lean(slope, robot.foot_position[foot].copy())
        sensing.unhit[:] = frame.inward(unhit)
        robot.update(*frame.enter(*self.told))
        return True

    def _foothold(self, foot: int) -> tuple[float, float]:
        """x and height of a foot in the world [m]."""
        x, y = self._robot.foot_position[foot].tolist()
        return self.frame.point(x, y)
