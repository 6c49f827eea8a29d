"""Curves of the CoM between two feet on the ground: to rest, or to where the rear foot lifts off.

Of the quintics tried, that is taken which keeps the centre of pressure between the feet and the
legs within their reach, and of those the quickest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.com_path import TERMS, Quintic, quintics
from template_control.embedding.standing.curve_search import Rules, best_quintic
from template_control.embedding.standing.options import StandingOptions
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_PEAK = 10.0 / np.sqrt(3.0)  # acceleration of a quintic from rest to rest, over distance / time^2


class Found(NamedTuple):
    """The best curve found.

    Attributes:
        pieces: in order.
        excess: by how far the centre of pressure leaves the feet, or a leg its reach [m].
        cost: excess beyond the slack, and time [m].
    """

    pieces: tuple[Quintic, ...]
    excess: float
    cost: float


@dataclass(frozen=True)
class BetweenFeet:
    """Both feet on the ground.

    Attributes:
        toes: x of the rear and the front one [m].
        parameters: the template.
        options: tuning, for that template.
    """

    toes: tuple[float, float]
    parameters: SlipParameters
    options: StandingOptions

    @property
    def spacing(self) -> float:
        """Of the feet [m]."""
        return self.toes[1] - self.toes[0]

    def place(self, share: float) -> float:
        """x at a share of the spacing [m]."""
        return self.toes[0] + share * self.spacing

    def at_rest(self, x: float) -> Array:
        """(2, 3) x and y, each position, velocity and acceleration, at rest over ``x``."""
        height = self.options.height
        uphill = height * np.tan(self.parameters.slope)
        return np.array([[x + uphill, 0.0, 0.0], [height, 0.0, 0.0]])

    @cached_property
    def _rules(self) -> Rules:
        p, o = self.parameters, self.options
        reach = o.reach * p.rest_length
        return Rules(
            min(self.toes), max(self.toes), p.gravity_parts, reach, o.slack, o.pace, o.calm
        )

    def loaded(self, start: Array) -> Array:
        """Starts (n, 2, 3) with accelerations that load the front foot at once.

        Args:
            start: (2, 3) x and y, each position, velocity and acceleration; the first of them. The
                only one, where a robot that falls has its CoM on the ground: no leg bears it.
        """
        x, y = start[:, 0]
        if y <= 0.0:
            return start[None]
        across, along = self.parameters.gravity_parts
        lift = max(1.0 - self.options.fall, 1.0 + start[1, 2] / across) * across
        starts = np.repeat(start[None], 1 + len(self.options.loads), axis=0)
        for i, share in enumerate(self.options.loads, 1):
            starts[i, 0, 2] = (x - self.place(share)) * lift / y - along
        return starts

    def best(self, start: Array, ends: Array) -> tuple[Found, int]:
        """The best quintic to one of several ends, and the end's number.

        Args:
            start: (2, 3) x and y, each position, velocity and acceleration; or (m, 2, 3) of these.
            ends: (n, 2, 3) the same.
        """
        o = self.options
        durations = np.geomspace(*o.durations, o.trials[0])
        curve = np.empty((2, TERMS))
        starts = start.reshape(-1, 2, 3).copy()
        # Where a foot lands late, the template has begun to fall.
        starts[:, 1, 2] = np.maximum(starts[:, 1, 2], -o.fall * self.parameters.gravity)
        cost, excess, end, i = best_quintic(starts, ends, durations, self._rules, curve)
        return Found((Quintic(curve, float(durations[i])),), excess, cost), end

    def to_rest(self, start: Array, lands: bool = False) -> Found:
        """To rest where the centre of pressure allows, then to the place to stand.

        Args:
            start: (2, 3) x and y, each position, velocity and acceleration.
            lands: whether the front foot has just landed: it takes up load at once.
        """
        o = self.options
        margin = min(o.margin, 0.5 * abs(self.spacing))
        low, high = min(self.toes) + margin, max(self.toes) - margin
        wanted = self.place(o.place)
        places = np.append(np.linspace(low, high, o.trials[1]), wanted)
        starts = self.loaded(start) if lands else start
        stop, i = self.best(starts, np.array([self.at_rest(x) for x in places]))
        there, _ = self.best(starts, self.at_rest(wanted)[None])
        if there.cost <= stop.cost + o.pace * o.durations[1]:
            return there
        return self._joined(stop, self._shift(places[i], wanted))

    def to_liftoff(self, start: Array, ends: Array, lands: bool) -> tuple[Found, int]:
        """To one of several states in which the rear foot lifts off.

        Args:
            start: (2, 3) x and y, each position, velocity and acceleration.
            ends: (n, 2, 3) the same.
            lands: whether the front foot has just landed: it takes up load at once. If not, the
                CoM may first move back, and rest there.

        Returns:
            What was found, and the number of the end.
        """
        found, number = self.best(self.loaded(start) if lands else start, ends)
        if lands or found.excess <= self.options.slack:
            return found, number
        for share in self.options.shifts:
            place = self.place(share)
            back, _ = self.best(start, self.at_rest(place)[None])
            away, i = self.best(self.at_rest(place), ends)
            joined = self._joined(back, away)
            if joined.cost < found.cost:
                found, number = joined, i
        return found, number

    def _shift(self, start: float, end: float) -> Found:
        """From rest to rest [m], within half of what the centre of pressure allows."""
        room = 0.5 * min(abs(end - toe) for toe in self.toes) + self.options.slack
        height = self.options.height / self.parameters.gravity
        time = max(np.sqrt(_PEAK * abs(end - start) * height / room), self.options.durations[0])
        curve = quintics(self.at_rest(start), self.at_rest(end), np.array(time))
        return Found((Quintic(curve, float(time)),), 0.0, self.options.pace * float(time))

    def _joined(self, first: Found, second: Found) -> Found:
        return Found(
            first.pieces + second.pieces,
            max(first.excess, second.excess),
            first.cost + second.cost,
        )
