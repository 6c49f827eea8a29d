"""How a CoM passes over a foot that stays, and where the other one then lands.

All is seen in the direction of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.standing.vaults import Vault, Vaults
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Slot
from template_control.slip.dynamics.stride import Stride

Array = NDArray[np.float64]

_FLAT = 0.02  # touchdown angle of a leg that does not land [rad]
_STATES = 16
_LANDINGS = 60
_HURRY = 0.3  # m of excess that count as a metre which the foot cannot make


class Landing(NamedTuple):
    """Where a step forward lands.

    Attributes:
        angle: touchdown angle [rad].
        time: from where it was looked for [s].
        toe: x of the foot [m].
        price: of coming to rest after it [m].
    """

    angle: float
    time: float
    toe: float
    price: float


class Pass(NamedTuple):
    """The way over a foot at x = 0, and the landing after it.

    Attributes:
        stiffness: of the leg [N/m].
        times: (n,) at which the other foot may lift off, 0 at VLO [s].
        states: (n, 2, 3) x and y then, each position, velocity and acceleration.
        landing: the best, from VLO on.
    """

    stiffness: float
    times: Array
    states: Array
    landing: Landing


class Passes:
    """Passes over a leg, and landings.

    Args:
        vaults: passes by their speed at VLO.
        node: of the automaton, in single stance before a touchdown.

    Attributes:
        known: passes with their landings, the slowest first.
    """

    def __init__(self, vaults: Vaults, node: str) -> None:
        self.parameters, self.options = vaults.parameters, vaults.options
        self._vaults, self._node = vaults, node
        self.known = self._found()

    def _found(self) -> list[Pass]:
        o, p = self.options, self.parameters
        speeds = np.linspace(o.slowest, o.passes[1], o.passes[0])
        speeds *= p.speed_unit
        found = (self._over(self._vaults.at(float(speed))) for speed in speeds)
        return [over for over in found if over is not None]

    def carrying(self, start: Array, toe: float) -> float:
        """Stiffness with which a leg carries the weight where the CoM is [N/m].

        Args:
            start: (2, 3) x and y of the CoM, each position, velocity and acceleration.
            toe: x of the leg's foot [m].
        """
        p, (least, most) = self.parameters, self.options.stiffness
        length = float(np.hypot(start[0, 0] - toe, start[1, 0]))
        share = p.mass * p.gravity / (max(p.rest_length - length, 1e-6) * p.leg_stiffness)
        return min(max(share, least), most) * p.leg_stiffness

    def best(self, start: Array, stiffness: float, feet: Sequence[float]) -> Landing | None:
        """The best landing; None where there is none.

        Args:
            start: (2, 3) x and y of the CoM, each position, velocity and acceleration.
            stiffness: of the leg [N/m].
            feet: x of the foot that stands and of the other one [m].
        """
        landings = self._landings(start[:, :2].T.ravel(), stiffness, feet[0])
        return min(landings, key=lambda one: self.hurried(one, feet[1]), default=None)

    def hurried(self, landing: Landing, foot: float) -> float:
        """Price of a landing for a foot that has to get there [m].

        Args:
            landing: of the step.
            foot: x of the foot now [m].
        """
        beyond = abs(landing.toe - foot) - self.options.nimble * landing.time
        return landing.price + _HURRY * max(beyond, 0.0)

    def _over(self, vault: Vault) -> Pass | None:
        """The pass of a vault; None where no landing follows."""
        speed, height, _ = vault.vlo
        start = np.array([0.0, height, speed, 0.0])
        landings = self._landings(start, vault.stiffness, 0.0)
        if not landings:
            return None
        stride = self._way(start, vault.stiffness, 0.0)
        longest = min(self.options.single[1], 0.98 * stride.duration)
        times = np.linspace(-longest, self.options.late, _STATES)
        x, y, dx, dy, ddx, ddy = stride.sample(np.abs(times)).T
        sign = np.where(times < 0.0, -1.0, 1.0)
        across = np.stack((sign * x, dx, sign * ddx), axis=-1)
        up = np.stack((y, sign * dy, ddy), axis=-1)
        states = np.stack((across, up), axis=1)
        best = min(landings, key=lambda one: one.price)
        return Pass(vault.stiffness, times, states, best)

    def _landings(self, state: Array, stiffness: float, toe: float) -> list[Landing]:
        """Where a step forward may land, from the CoM's state (4,) over a foot at x = ``toe``."""
        length, (_, longest) = self.parameters.rest_length, self.options.steps
        stride = self._way(state, stiffness, toe)
        times = np.linspace(0.0, 0.98 * min(stride.duration, self.options.step), _LANDINGS)[1:]
        path = stride.sample(times)
        # Whenever the CoM sinks the foot may land: its leg has the angle that suits the height.
        angles = np.arcsin(np.minimum(path[:, 1] / length, 1.0))
        feet = path[:, 0] + length * np.cos(angles)
        sinks = (path[:, 3] < 0.0) & (np.maximum.accumulate(angles[::-1])[::-1] <= angles)
        return [
            Landing(float(angles[i]), float(times[i]), foot, self._priced(row, toe, foot))
            for i, (row, foot) in enumerate(
                zip(path.reshape(-1, 3, 2).swapaxes(1, 2), feet.tolist(), strict=True)
            )
            if sinks[i] and foot - toe <= longest
        ]

    def _priced(self, state: Array, toe: float, foot: float) -> float:
        """Price of a landing between two feet, with (2, 3) x and y of the CoM [m].

        The CoM can come to rest while its capture point is between them.
        """
        capture = self.capture(state)
        left = min(foot - capture, capture - toe)
        apart = abs(foot - toe - self.options.closing)
        return max(self.options.spare - left, 0.0) + self.options.narrow * apart

    def capture(self, state: Array) -> float:
        """The capture point x + dx/dt sqrt(y / g) [m]; x where the CoM is not above the ground.

        Args:
            state: (2, 3) x and y of the CoM, each position, velocity and acceleration.
        """
        (x, speed, _), y = state[0], state[1, 0]
        # A robot that falls may have its CoM below where its foot was to stand.
        return float(x + speed * np.sqrt(max(y, 0.0) / self.parameters.gravity))

    def _way(self, state: Array, stiffness: float, toe: float) -> Stride:
        """The template's way over a foot at x = ``toe``, without a landing."""
        u = np.zeros(NUM_SLOTS)
        u[Slot.TOUCHDOWN_ANGLE], u[Slot.K_SC] = _FLAT, stiffness
        return self._vaults.arriving(self._node, state, u, np.array([toe, toe]))
