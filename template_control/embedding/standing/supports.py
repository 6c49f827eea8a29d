"""Curves over feet that bear a moment: pairs of feet, or soles.

As :class:`~.curves.BetweenFeet`, whose feet are points. The centre of pressure may be anywhere over
the ground that the feet enclose, beyond the middle of either one too, and is planned by the
quadratic program of :mod:`~.pressure`. The feet may stand next to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from template_control.arrays import Array
from template_control.embedding.standing.curves import PLACE, BetweenFeet, Found
from template_control.embedding.standing.pressure import (
    ARRIVE,
    SMOOTH,
    Ground,
    best_pressure,
)
from template_control.slip.dynamics.timed import TERMS, Quintic, polynomial
from template_control.slip.similarity import Scale
from template_control.whole_body.solver import SOLE_SHARE

_PIECES = 20  # of a curve
_PASSING = 2.0  # longest time to a foot that is passed, over that at the present speed
# Of the ground under the feet that a plan uses: folding legs ask for a little more.
_SHARE = 0.8
# For the reference template.
# Excess that a second more or less counts as [m/s]. Near its end a curve that is planned anew had
# better miss it by millimetres than swing back once more.
_PACE = 0.01
_STILL = 0.01  # over sqrt(g l0): a CoM that is faster does not begin at rest
_DURATIONS = np.geomspace(0.03, 1.6, 14)  # that are tried [s]
UNLOADING = 0.06
"""Time over which a foot that is to lift off gives up its load [s, of the reference template]."""


@dataclass(frozen=True)
class OverFeet(BetweenFeet):
    """Curves over feet as long as the options' ``half_length`` says."""

    def to_rest(self, start: Array, lands: bool = False) -> Found:
        """See :meth:`.BetweenFeet.to_rest`."""
        rest = self.at_rest(self.place(PLACE))[None]
        return self._best(start, rest, lands, 0.0, (0.0, np.inf))[0]

    def to_liftoff(self, start: Array, ends: Array, lands: bool) -> tuple[Found, int]:
        """See :meth:`.BetweenFeet.to_liftoff`; the rear foot has no load left at the end."""
        (x, speed, _), (height, *_) = start.tolist()
        rate = float(np.sqrt(self.parameters.gravity / max(height, self.margin)))
        moves = speed > _STILL * self.parameters.speed_unit
        # Once the capture point is past the foot that stays, the CoM is not thrown back again.
        passes = moves and x + speed / rate > self.toes[1]
        longest = _PASSING * max(self.toes[1] - x, 0.0) / speed if passes else np.inf
        shortest = 0.0 if lands or moves else self.options.shift
        return self._best(start, ends, lands, UNLOADING, (shortest, longest))

    def _best(
        self, start: Array, ends: Array, lands: bool, unloading: float, within: tuple[float, float]
    ) -> tuple[Found, int]:
        """The best curve to one of several ends, and the end's number.

        It takes from ``within[0]`` to ``within[1]`` [s]; ``unloading`` is of the reference
        template [s].
        """
        unit, rules = Scale.of(self.parameters).time, self._rules
        middle, half = self.place(PLACE), _SHARE * self.options.half_length
        if self.options.slant and not unloading:  # as the CoM is held there
            half = SOLE_SHARE * self.options.half_length + self.options.slant * abs(self.spacing)
        ground = Ground(
            rear=float(self.toes[0]),
            front=float(self.toes[1]),
            low=min(middle - half, rules.low),
            high=max(middle + half, rules.high),
            gravity=self.parameters.gravity,
            reach=rules.reach,
            slack=rules.slack,
            pace=_PACE * Scale.of(self.parameters).speed,
            calm=rules.calm,
            unloading=unloading * unit,
            smooth=SMOOTH * unit,
            arrive=ARRIVE * unit,
        )
        p, rates = np.empty(_PIECES), np.empty(_PIECES)
        durations = _DURATIONS * unit
        shortest, longest = within
        durations = durations[durations <= max(longest, durations[0])]
        durations = np.unique(np.maximum(durations, shortest))
        cost, excess, end, i = best_pressure(start, ends, durations, ground, lands, p, rates)
        curve = curve_over(start, ends[end], float(durations[i]), p, rates)
        return Found(curve, excess, cost), end


def curve_over(
    start: Array, end: Array, duration: float, pressures: Array, rates: Array
) -> tuple[Quintic, ...]:
    """The curve of a duration [s] over centres of pressure (n,) [m], w (n,) being ``rates``."""
    rise = Quintic.between(start, end, duration).coefficients[1]
    (x, v), dt, time = start[0, :2], duration / len(rates), 0.0
    found = []
    for p, w in zip(pressures, rates, strict=True):
        c = np.empty((2, TERMS))
        for n in range(TERMS):  # of p + (x - p) cosh(w t) + v sinh(w t) / w
            c[0, n] = (v if n % 2 else x - p) * w ** (n - n % 2) / factorial(n)
        c[0, 0], c[1] = x, _from(rise, time)
        found.append(Quintic(c, dt))
        x, v, _ = polynomial(c[0], dt)
        time += dt
    return tuple(found)


def _from(polynomial: Array, time: float) -> Array:
    """The same polynomial (n,), its time counted from another one [s] on."""
    c = polynomial.copy()
    for i in range(len(c) - 1):
        for k in range(len(c) - 2, i - 1, -1):
            c[k] += time * c[k + 1]
    return c
