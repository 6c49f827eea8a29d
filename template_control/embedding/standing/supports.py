"""Curves over feet that bear a moment: pairs of feet, or soles.

As :class:`~.curves.BetweenFeet`, whose feet are points. The centre of pressure may be anywhere over
the ground that the feet enclose, beyond the middle of either one too, and is planned by the
quadratic program of :mod:`~.pressure`. The feet may stand next to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.com_path import TERMS, Quintic, derivatives, quintics
from template_control.embedding.standing.curves import PLACE, BetweenFeet, Found
from template_control.embedding.standing.pressure import (
    ARRIVE,
    PRESSURE,
    SMOOTH,
    Pieces,
    pressure,
)
from template_control.slip.similarity import Scale
from template_control.warm_up import ready

Array = NDArray[np.float64]

_PIECES = 20  # of a curve
_SHARE = 0.9  # of the ground under the feet that a plan uses
_LIGHTEST = 0.05  # of the weight: legs do not pull
# For the reference template.
_DURATIONS = tuple(np.geomspace(0.2, 1.6, 9))  # that are tried [s]
UNLOADING = 0.06
"""Time over which a foot that is to lift off gives up its load [s, of the reference template]."""


@dataclass(frozen=True)
class OverFeet(BetweenFeet):
    """Curves over feet as long as the options' ``half_length`` says."""

    @cached_property
    def _ground(self) -> tuple[float, float]:
        """x between which both feet bear the centre of pressure [m]."""
        middle, half = self.place(PLACE), _SHARE * self.options.half_length
        return min(middle - half, *self.toes), max(middle + half, *self.toes)

    def to_rest(self, start: Array, lands: bool = False) -> Found:
        """See :meth:`.BetweenFeet.to_rest`."""
        return self._best(start, self.at_rest(self.place(PLACE))[None], lands, False)[0]

    def to_liftoff(self, start: Array, ends: Array, lands: bool) -> tuple[Found, int]:
        """See :meth:`.BetweenFeet.to_liftoff`; the rear foot has no load left at the end."""
        return self._best(start, ends, lands, True)

    def _best(self, start: Array, ends: Array, lands: bool, unloads: bool) -> tuple[Found, int]:
        ready(PRESSURE)
        found = [
            (self._curve(start, end, float(duration), lands, unloads), i)
            for duration in np.multiply(_DURATIONS, Scale.of(self.parameters).time)
            for i, end in enumerate(ends)
        ]
        return min(found, key=lambda pair: pair[0].cost)

    def _curve(
        self, start: Array, end: Array, duration: float, lands: bool, unloads: bool
    ) -> Found:
        """The curve of a duration [s] to an end (2, 3), as near as the feet let it come."""
        p, unit = self.parameters, Scale.of(self.parameters).time
        lasts = np.full(_PIECES, duration / _PIECES)
        times = np.arange(_PIECES) * lasts[0]
        rise = quintics(start, end, np.array(duration))[1]
        y, _, lift = derivatives(rise, times + 0.5 * lasts).T
        lift = np.maximum(lift + p.gravity, _LIGHTEST * p.gravity)
        rate = np.sqrt(lift / np.maximum(y, _LIGHTEST * p.rest_length))
        low, high = (np.full(_PIECES, bound) for bound in self._ground)
        wish = np.full(_PIECES, end[0, 0])
        if unloads:
            left = np.clip((duration - times - lasts) / (UNLOADING * unit), 0.0, 1.0)
            wish[:] = self.toes[1]
            low, high = (wish + left * (bound - wish) for bound in (low, high))
        first = np.nan if lands else start[0, 0] - start[0, 2] / rate[0] ** 2
        pressures = np.empty(_PIECES)
        pieces = Pieces(lasts, rate, low, high, wish)
        prices = SMOOTH * unit, ARRIVE * unit
        miss = pressure(pieces, start[0, :2], end[0, :2], float(first), prices, pressures)
        curve, far = self._along(start, rise, pieces, pressures)
        excess = max(miss, far)
        calm = self._rules.pace * (duration + self._rules.calm**2 / duration)
        return Found(curve, excess, max(excess - self.options.slack, 0.0) + calm)

    def _along(
        self, start: Array, rise: Array, pieces: Pieces, pressures: Array
    ) -> tuple[tuple[Quintic, ...], float]:
        """The curve over these centres of pressure, and how far a leg is beyond its reach [m]."""
        x, v, time, far = start[0, 0], start[0, 1], 0.0, -np.inf
        found = []
        for dt, w, p in zip(pieces.duration, pieces.rate, pressures, strict=True):
            shifted = np.array([x - p, v])
            c = np.empty((2, TERMS))
            factor = 1.0
            for n in range(TERMS):
                c[0, n] = shifted[n % 2] * w ** (n - n % 2) / factor
                factor *= n + 1
            c[0, 0] = x
            c[1] = _from(rise, time)
            found.append(Quintic(c, float(dt)))
            x, v = derivatives(c[0], np.array(dt))[:2]
            time += dt
            away = max(abs(x - toe) for toe in self.toes)
            far = max(far, np.hypot(away, c[1, 0]) - self._rules.reach)
        return tuple(found), float(far)


def _from(polynomial: Array, time: float) -> Array:
    """The same polynomial (n,), its time counted from another one [s] on."""
    c = polynomial.copy()
    for i in range(len(c) - 1):
        for k in range(len(c) - 2, i - 1, -1):
            c[k] += time * c[k + 1]
    return c
