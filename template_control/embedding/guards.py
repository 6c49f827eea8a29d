"""When the robot fires an event of the automaton.

The geometric guards are the template's own functions, evaluated at the robot's CoM and feet.
Touchdown is felt. Liftoff happens where the template lifts off (its beta_l) or in a predefined
direction (both of Section V-B).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Range
from template_control.embedding.sensing import Sensed
from template_control.slip.automaton.hybrid import Edge
from template_control.slip.automaton.vocabulary import Event, Leg, Reset
from template_control.slip.dynamics.guards import guard
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import TIME, tuned

Array = NDArray[np.float64]

PLACED = {Reset.PLACE_REAR: Leg.REAR, Reset.PLACE_FRONT: Leg.FRONT}
"""The leg that a reset puts on the ground."""


@dataclass(frozen=True)
class GuardOptions(Checked):
    """When a touchdown or a liftoff has happened, by contacts that are believed.

    Attributes:
        shortest_swing: shortest time in the air, over sqrt(l0 / g). An earlier contact is the
            foot that scuffs at liftoff.
        surprise: a foot that is not in front of the CoM lands this long before its touchdown is
            due at the earliest [s]. An earlier contact is one that scuffs.
        overstretch: share of l0. A rear leg that is longer than l0 by it is let go, whatever the
            path says.
        liftoff_angle: direction beta from the rear foot to the CoM [rad, from forward
            horizontal] at which that foot lifts off; beta decreases from pi to 0 as the robot
            moves forward. None: "at the same configuration (namely, the same beta_l) as that
            of SLIP", Fig. 13(b); an angle: "the leg lifts off at a predefined configuration",
            whatever the template does, Fig. 13(c).

    Raises:
        ParameterError: if the angle is not between 0 and pi.
    """

    shortest_swing: NotNegative = tuned(0.3)
    surprise: NotNegative = tuned(0.05, TIME)
    overstretch: NotNegative = tuned(0.03)
    liftoff_angle: Annotated[float, Range(0.0, np.pi, above=True, below=True)] | None = tuned(None)


@dataclass(frozen=True)
class RobotGuards:
    """The automaton's guards, as the robot feels them.

    Attributes:
        parameters: the template.
        options: tuning.
    """

    parameters: SlipParameters
    options: GuardOptions

    @cached_property
    def _shortest_time(self) -> float:
        """Of a swing [s]."""
        p = self.parameters
        return float(self.options.shortest_swing * np.sqrt(p.rest_length / p.gravity))

    def fired(self, edge: Edge, sensed: Sensed, due: float) -> bool:
        """Whether the edge's event has happened.

        Args:
            edge: a way out of the present node.
            sensed: the robot now.
            due: time until the template's path comes to that event [s].
        """
        felt = _FELT[edge.event]
        if felt is not None:
            return felt(self, edge, sensed, due)
        return self._value(edge.event, sensed) >= 0.0

    def _value(self, event: Event, sensed: Sensed) -> float:
        # In Python, on its own numbers: quicker than passing arrays to compiled code.
        state, toes = sensed.state.tolist(), sensed.toes.tolist()
        return float(guard.py_func(int(event), state, toes, self.parameters.rest_length, 0.0))

    def _touchdown(self, edge: Edge, sensed: Sensed, due: float) -> bool:
        leg = PLACED[edge.reset]
        foot = sensed.feet[leg]
        if not sensed.contact[foot] or sensed.swing_time[foot] <= self._shortest_time:
            return False
        return bool(sensed.toes[leg] > sensed.state[0]) or due <= self.options.surprise

    def _rear_liftoff(self, edge: Edge, sensed: Sensed, due: float) -> bool:
        stretch = self._value(edge.event, sensed)
        if stretch > self.options.overstretch * self.parameters.rest_length:
            return True
        if stretch > 0.0 and due == np.inf:
            return True  # the template's leg would not push any more
        angle = self.options.liftoff_angle
        if angle is None:
            return due <= 0.0
        beta = np.arctan2(sensed.state[1], sensed.state[0] - sensed.toes[0])
        return bool(beta <= angle)

    def _due(self, edge: Edge, sensed: Sensed, due: float) -> bool:
        return due <= 0.0


_NOT_GEOMETRIC: dict[Event, Callable[[RobotGuards, Edge, Sensed, float], bool]] = {
    Event.TOUCHDOWN: RobotGuards._touchdown,
    Event.REAR_LIFTOFF: RobotGuards._rear_liftoff,
    Event.FRONT_LIFTOFF: RobotGuards._due,
    Event.REST: RobotGuards._due,
}
_FELT = [_NOT_GEOMETRIC.get(event) for event in Event]
"""By Event: how the robot feels what it does not read off the template's geometry."""
