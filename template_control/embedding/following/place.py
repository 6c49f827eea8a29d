"""The robot's place on the template's path, and the template there.

The legs' swing makes the robot's CoM run ahead of the template and fall back behind it within
a step, while its angular momentum about the foot, on which all forces depend, stays the
template's. So in stance the phase is that of a point that moves with dx/dt + L / (m y), L the
angular momentum about the CoM: it starts in the CoM at every plan, and leads or lags it by
centimetres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.phases import Clock
from template_control.embedding.references.leg_forces import leg_forces
from template_control.embedding.sensing import Sensed
from template_control.embedding.station import Station
from template_control.embedding.stride_planning import StridePlanning
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]


class Place:
    """Where on the path the robot is; it persists from tick to tick.

    Args:
        parameters: the template.
        reference: (6,) which is overwritten.

    Attributes:
        time: along the path [s].
        offset: the point whose direction is the phase is this far ahead of the CoM [m].
        reference: (6,) template CoM x (relative to its rear toe), y, and two derivatives.
        forces: (2, 2) leg forces of the template there [N], rear and front.
    """

    def __init__(self, parameters: SlipParameters, reference: Array) -> None:
        p = parameters
        self.reference = reference
        self.forces = np.zeros((2, 2))
        self._ground = p
        self._body = np.array([p.mass, *p.gravity_parts, p.rest_length, p.assist])
        self.restart()

    def restart(self) -> None:
        """A new path starts where the robot is."""
        self.time = self.offset = 0.0
        self._fresh = True

    def move(
        self, station: Station, planning: StridePlanning, sensed: Sensed, speed: float, dt: float
    ) -> None:
        """Go on to where the robot is now.

        Args:
            station: of the robot.
            planning: whose path is followed.
            sensed: the robot's state.
            speed: dx/dt of its CoM [m/s].
            dt: since the last tick [s].
        """
        s, path, toe = sensed, planning.path, planning.toe
        x, y = s.state[0] + self.offset - s.toes[0], s.state[1]
        # Since the last tick, unless the path begins at this one. A direction needs a guess only.
        passed = 0.0 if self._fresh and station.control.clock is Clock.TIME else dt
        self._fresh = False
        self.time, row = station.locate(*path.curve, x, y, self.time + passed, self.reference)
        self.offset += (s.state[2] - speed) * dt
        segment = path.curve.meta[row]
        if planning.ground is not self._ground:
            self._ground = ground = planning.ground
            self._body[1:3], self._body[4] = ground.gravity_parts, ground.assist
        leg_forces(segment, toe, self.reference, self._body, self.forces)
        if segment[3] != toe:
            # Template and robot are on either side of liftoff: to each foot its own force.
            self.forces[:] = np.flipud(self.forces.copy())
