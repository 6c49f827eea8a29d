"""When the robot fires an event of the automaton.

The geometric guards are the template's own functions, evaluated at the robot's CoM and
feet; touchdown is felt, and liftoff happens where the template lifts off (its beta_l) or in
a predefined direction (both of Section V-B).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.guards import guard

Array = NDArray[np.float64]

_MIN_SWING = 0.3  # of sqrt(l0 / g): earlier contacts are the foot scuffing at liftoff
_OVERSTRETCH = 0.03  # of l0: the rear leg is let go here, whatever the plan says


@dataclass
class Sensed:
    """What the robot feels, in the template's terms; overwritten at every tick.

    Attributes:
        state: (4,) x, y, dx/dt, dy/dt of the CoM [m, m/s]; dx/dt includes the angular
            momentum about the CoM as if it moved the CoM, so that m y dx/dt - m x dy/dt is
            the robot's angular momentum about its stance foot.
        toes: (2,) x of the rear and the front foot [m].
        front_contact: the front (in single stance: the swing) foot touches the ground.
        swing_time: time since the last liftoff [s].
    """

    state: Array
    toes: Array
    front_contact: bool = False
    swing_time: float = np.inf


def fired(
    event: Event,
    sensed: Sensed,
    phase_time: float,
    liftoff: float,
    rest_length: float,
    g: float,
    liftoff_angle: float | None = None,
) -> bool:
    """Whether ``event`` has happened.

    Args:
        event: a guard of the automaton.
        sensed: the robot now.
        phase_time: template time of the robot's phase [s].
        liftoff: template time of the plan's liftoff [s].
        rest_length: l0 [m].
        g: gravitational acceleration [m/s^2].
        liftoff_angle: predefined direction from the rear foot to the CoM [rad] that takes the
            place of the plan's liftoff; it decreases from pi to 0 as the robot walks forward.
    """
    if event is Event.TOUCHDOWN:
        settled = sensed.swing_time > _MIN_SWING * np.sqrt(rest_length / g)
        return sensed.front_contact and bool(settled)
    if event is Event.REAR_LIFTOFF:
        stretch = guard(int(event), sensed.state, sensed.toes, rest_length, 0.0)
        if stretch > _OVERSTRETCH * rest_length:
            return True
        if liftoff_angle is None:
            return phase_time >= liftoff
        beta = np.arctan2(sensed.state[1], sensed.state[0] - sensed.toes[0])
        return bool(beta <= liftoff_angle)
    return guard(int(event), sensed.state, sensed.toes, rest_length, 0.0) >= 0.0
