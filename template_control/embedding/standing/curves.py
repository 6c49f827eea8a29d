"""Curves of the CoM between two feet on the ground: to rest, or to where the rear foot lifts off.

Over points, of the quintics tried that is taken which keeps the centre of pressure between the feet
and the legs within their reach, and of those the quickest. Pairs of feet and soles bear a moment:
the centre of pressure may be anywhere over the ground that they enclose, beyond the middle of
either one too, and is planned by the quadratic program of :mod:`~.pressure`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.compiled import compiled
from template_control.embedding.standing.pressure import (
    ARRIVE,
    LIGHTEST,
    SMOOTH,
    UNLOADING,
    Ground,
    best_pressure,
    curve_over,
)
from template_control.robot.start import Pose
from template_control.slip.dynamics.timed import TERMS, Quintic, polynomial, quintic
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import LENGTH, SPEED, TIME, Scale, scaled, tuned
from template_control.warm_up import Part
from template_control.whole_body.solver import SOLE_SHARE

SPACING = 0.3
"""Distance of the feet where a run begins, over l0."""
PLACE = 0.5
"""Place of the CoM between the feet, as a share of their spacing from the rear one."""


@dataclass(frozen=True)
class StandingOptions(Checked):
    """Tuning of a stand, and of the curves of the CoM between the feet.

    Attributes:
        height: of the CoM over the ground [m].
        slack: the centre of pressure may be this far outside the feet [m]; the QP keeps it
            inside, and the CoM a little off its curve.
        reach: longest way from a foot on the ground to the CoM, over l0.
        half_length: by how far ahead of its middle, and behind, a foot bears the centre of pressure
            [m]; 0: it is a point.
        slant: of soles that stand next to each other, by how much of their spacing the ground that
            they enclose reaches further than that, on the line midway between them: their half
            width over the distance between them to the side. A stand uses it, a start does not.
        shift: shortest time from rest to a liftoff [s]: until then the CoM of a robot on two soles
            has to be over the one that stays.
        single: shortest time on one leg before the VLO to which a start or a change of speed leads
            [s]: the other foot passes the one that stands.
        slowest: least speed at VLO that a start leads to [m/s]. From feet too close to each other
            to reach it, the robot steps first.
    """

    height: Positive = tuned(STAND_HEIGHT, LENGTH)
    slack: NotNegative = tuned(0.005, LENGTH)
    reach: Positive = tuned(1.025)
    half_length: NotNegative = tuned(0.0, LENGTH)
    slant: NotNegative = tuned(0.0)
    shift: NotNegative = tuned(0.0, TIME)
    single: NotNegative = tuned(0.15, TIME)
    slowest: NotNegative = tuned(0.0, SPEED)


@checked
def standing_pose(
    parameters: SlipParameters,
    spacing: Positive | None = None,
    options: StandingOptions | None = None,
    ground: Callable[[float], float] | None = None,
) -> Pose:
    """At rest on both feet, the rear one at x = 0.

    Args:
        parameters: the robot's template.
        spacing: of the feet [m]; None: 0.3 l0.
        options: tuning, for the reference template.
        ground: its height [m] at an x [m]; None: level.
    """
    o = scaled(options or StandingOptions(), Scale.of(parameters))
    apart = SPACING * parameters.rest_length if spacing is None else spacing
    rear, front = (0.0, 0.0) if ground is None else (ground(0.0), ground(apart))
    # From the ground at right angles to it, as the axes of a slope have it.
    over = o.height * hypot(1.0, (front - rear) / apart)
    return Pose(
        com=np.array([PLACE * apart, rear + PLACE * (front - rear) + over]),
        com_velocity=np.zeros(2),
        feet=np.array([[0.0, rear], [apart, front]]),
        feet_velocity=np.zeros((2, 2)),
    )


_SAMPLES = 20  # of a curve, its start not counted


@compiled
def best_quintic(
    starts: Array, ends: Array, durations: Array, ground: Ground, curve: Array
) -> tuple[float, float, int, int]:
    """Cost and excess [m] of the best quintic: excess beyond the slack, and time.

    ``starts`` (m, 2, 3) and ``ends`` (n, 2, 3) are x and y, each position, velocity, acceleration;
    ``durations`` (d,) are tried between each two [s]; ``curve`` (2, 6) is overwritten with
    coefficients, constant term first. Also returns the numbers of the end and of the duration.
    """
    best, least, chosen, lasting = np.inf, np.inf, 0, 0
    c = np.empty((2, TERMS))
    for i in range(durations.shape[0]):
        t = durations[i]
        time = ground.pace * (t + ground.calm * ground.calm / t)
        for s in range(starts.shape[0]):
            for e in range(ends.shape[0]):
                if time >= best:
                    continue
                for axis in range(2):
                    quintic(starts[s, axis], ends[e, axis], t, c[axis])
                excess = 0.0
                for k in range(_SAMPLES + 1):
                    excess = max(excess, _excess(c, t * k / _SAMPLES, ground))
                    if excess - ground.slack + time >= best:
                        break
                cost = max(excess - ground.slack, 0.0) + time
                if cost < best:
                    best, least, chosen, lasting = cost, excess, e, i
                    for axis in range(2):
                        for n in range(TERMS):  # Numba compiles whole copies for seconds
                            curve[axis, n] = c[axis, n]
    return best, least, chosen, lasting


@compiled
def _excess(c: Array, t: float, ground: Ground) -> float:
    """By how far a curve leaves the feet, or the legs' reach, at a time [m]."""
    x = y = ax = ay = 0.0
    for n in range(TERMS - 1, -1, -1):
        x, y = x * t + c[0, n], y * t + c[1, n]
    for n in range(TERMS - 1, 1, -1):
        ax, ay = ax * t + n * (n - 1) * c[0, n], ay * t + n * (n - 1) * c[1, n]
    across, along = ground.gravity
    p = x - y * (ax + along) / max(across + ay, LIGHTEST * across)
    away = max(x - ground.low, ground.high - x)
    far = np.sqrt(away * away + y * y) - ground.reach
    return float(max(ground.low - p, p - ground.high, far))


def curves() -> None:
    """The search, and a curve's value, called to compile them."""
    states = np.ones((1, 2, 3))
    ground = BetweenFeet((0.0, 1.0), SlipParameters(), StandingOptions()).ground
    best_quintic(states, states, np.ones(1), ground, np.empty((2, TERMS)))
    polynomial(np.ones(TERMS), 1.0)


STAND = (Part(curves, 0.5),)
"""Compiled functions of standing, starting and stopping."""


class Found(NamedTuple):
    """The best curve found."""

    pieces: tuple[Quintic, ...]  # in order
    excess: float  # by how far the centre of pressure leaves the feet, or a leg its reach [m]
    cost: float  # excess beyond the slack, and time [m]


_PEAK = 10.0 / np.sqrt(3.0)  # acceleration of a quintic from rest to rest, over distance / time^2
_SHIFTS = (0.05, 0.15, 0.25, 0.35, 0.45)  # of the spacing: places from which a start may set off
# Shares of the load that the front foot may take up at once where it has landed.
_LOADS = (0.33, 0.67, 1.0)
_FALL = 0.5  # largest downward acceleration that a curve begins with, over g
_MARGIN = 0.01  # of a rest place from either foot, over l0
_REST_PLACES = 9  # that are tried
_DURATIONS = 14  # that are tried, from the shortest to the longest
# For the reference template.
_SHORTEST, _LONGEST = 0.1, 1.2  # duration of a quintic [s]
_CALM = 0.3  # duration that is liked best [s]
_PACE = 0.002  # excess that a second more or less counts as [m/s]

# Over feet that bear a moment.
_PIECES = 20  # of a curve
_PASSING = 2.0  # longest time to a foot that is passed, over that at the present speed
# Of the ground under the feet that a plan uses: folding legs ask for a little more.
_SHARE = 0.8
_STILL = 0.01  # over sqrt(g l0): a CoM that is faster does not begin at rest
# Near its end a curve that is planned anew had better miss it by millimetres than swing back once
# more.
_PRESSURE_PACE = 0.01  # as _PACE
_PRESSURE_DURATIONS = np.geomspace(0.03, 1.6, 14)  # that are tried [s], for the reference template


@dataclass(frozen=True)
class BetweenFeet:
    """Curves with both feet on the ground, whose ``toes`` are x of the rear and the front one [m].

    The options are for this template. States are (2, 3) x and y of the CoM, each position, velocity
    and acceleration.
    """

    toes: tuple[float, float]
    parameters: SlipParameters
    options: StandingOptions

    def fits(self, found: Found) -> bool:
        """True if a curve keeps the centre of pressure between the feet, but for the slack."""
        return found.excess <= self.options.slack

    @cached_property
    def _scale(self) -> Scale:
        return Scale.of(self.parameters)

    @property
    def margin(self) -> float:
        """Of a rest place from either foot [m]."""
        return _MARGIN * self.parameters.rest_length

    @property
    def spacing(self) -> float:
        """Of the feet [m]."""
        return self.toes[1] - self.toes[0]

    def place(self, share: float) -> float:
        """x at a share of the spacing [m]."""
        return self.toes[0] + share * self.spacing

    def at_rest(self, x: float) -> Array:
        """The state at rest over ``x``."""
        height = self.options.height
        uphill = height * np.tan(self.parameters.slope)
        return np.array([[x + uphill, 0.0, 0.0], [height, 0.0, 0.0]])

    @cached_property
    def ground(self) -> Ground:
        """The ground that points bear."""
        o, unit = self.options, self._scale
        return Ground(
            rear=float(self.toes[0]),
            front=float(self.toes[1]),
            low=float(min(self.toes)),
            high=float(max(self.toes)),
            gravity=self.parameters.gravity_parts,
            reach=o.reach * self.parameters.rest_length,
            slack=o.slack,
            pace=_PACE * unit.speed,
            calm=_CALM * unit.time,
            unloading=0.0,
            smooth=SMOOTH * unit.time,
            arrive=ARRIVE * unit.time,
        )

    def loaded(self, start: Array) -> Array:
        """Starts (n, 2, 3), the given one first, that load the front foot at once.

        The given one alone, where a robot that falls has its CoM on the ground: no leg bears it.
        """
        x, y = start[:, 0]
        if y <= 0.0:
            return start[None]
        across, along = self.parameters.gravity_parts
        lift = max(1.0 - _FALL, 1.0 + start[1, 2] / across) * across
        starts = np.repeat(start[None], 1 + len(_LOADS), axis=0)
        for i, share in enumerate(_LOADS, 1):
            starts[i, 0, 2] = (x - self.place(share)) * lift / y - along
        return starts

    def to_rest(self, start: Array, lands: bool = False) -> Found:
        """Curve to rest where the centre of pressure allows, then to the place to stand.

        A front foot that has just landed (``lands``) takes up load at once.
        """
        wanted = self.place(PLACE)
        if self.options.half_length:
            return self._by_pressure(start, self.at_rest(wanted)[None], lands)[0]
        margin = min(self.margin, 0.5 * abs(self.spacing))
        low, high = self.ground.low + margin, self.ground.high - margin
        places = np.append(np.linspace(low, high, _REST_PLACES), wanted)
        starts = self.loaded(start) if lands else start
        stop, i = self._best(starts, np.array([self.at_rest(x) for x in places]))
        there, _ = self._best(starts, self.at_rest(wanted)[None])
        if there.cost <= stop.cost + self.ground.pace * (_LONGEST * self._scale.time):
            return there
        return _joined(stop, self._shift(places[i], wanted))

    def to_liftoff(self, start: Array, ends: Array, lands: bool) -> tuple[Found, int]:
        """Curve to one of several states (n, 2, 3) of the rear foot's liftoff, and its number.

        A front foot that has just landed (``lands``) takes up load at once; if none has, the CoM
        may first move back, and rest there. The rear foot has no load left at the end.
        """
        if self.options.half_length:
            return self._by_pressure_to_liftoff(start, ends, lands)
        found, number = self._best(self.loaded(start) if lands else start, ends)
        if lands or self.fits(found):
            return found, number
        for share in _SHIFTS:
            rest = self.at_rest(self.place(share))
            back, _ = self._best(start, rest[None])
            away, i = self._best(rest, ends)
            joined = _joined(back, away)
            if joined.cost < found.cost:
                found, number = joined, i
        return found, number

    def _best(self, start: Array, ends: Array) -> tuple[Found, int]:
        """The best quintic to one of several ends (n, 2, 3), and its number.

        There may be several starts (m, 2, 3).
        """
        unit = self._scale.time
        durations = np.geomspace(_SHORTEST * unit, _LONGEST * unit, _DURATIONS)
        curve = np.empty((2, TERMS))
        starts = start.reshape(-1, 2, 3).copy()
        # Where a foot lands late, the template has begun to fall.
        starts[:, 1, 2] = np.maximum(starts[:, 1, 2], -_FALL * self.parameters.gravity)
        cost, excess, end, i = best_quintic(starts, ends, durations, self.ground, curve)
        return Found((Quintic(curve, float(durations[i])),), excess, cost), end

    def _shift(self, start: float, end: float) -> Found:
        """From rest to rest [m], within half of what the centre of pressure allows."""
        room = 0.5 * min(abs(end - toe) for toe in self.toes) + self.options.slack
        height = self.options.height / self.parameters.gravity
        shortest = _SHORTEST * self._scale.time
        time = float(max(np.sqrt(_PEAK * abs(end - start) * height / room), shortest))
        curve = Quintic.between(self.at_rest(start), self.at_rest(end), time)
        return Found((curve,), 0.0, self.ground.pace * time)

    def _by_pressure_to_liftoff(self, start: Array, ends: Array, lands: bool) -> tuple[Found, int]:
        (x, speed, _), (height, *_) = start.tolist()
        rate = float(np.sqrt(self.parameters.gravity / max(height, self.margin)))
        moves = speed > _STILL * self.parameters.speed_unit
        # Once the capture point is past the foot that stays, the CoM is not thrown back again.
        passes = moves and x + speed / rate > self.toes[1]
        longest = _PASSING * max(self.toes[1] - x, 0.0) / speed if passes else np.inf
        shortest = 0.0 if lands or moves else self.options.shift
        return self._by_pressure(start, ends, lands, UNLOADING, (shortest, longest))

    def _by_pressure(
        self,
        start: Array,
        ends: Array,
        lands: bool,
        unloading: float = 0.0,
        within: tuple[float, float] = (0.0, np.inf),
    ) -> tuple[Found, int]:
        """The best curve over feet that bear a moment to one of several ends, and its number.

        It takes from ``within[0]`` to ``within[1]`` [s]; ``unloading`` is of the reference
        template [s].
        """
        o, unit, points = self.options, self._scale, self.ground
        middle, half = self.place(PLACE), _SHARE * o.half_length
        if o.slant and not unloading:  # as the CoM is held there
            half = SOLE_SHARE * o.half_length + o.slant * abs(self.spacing)
        ground = points._replace(
            low=min(middle - half, points.low),
            high=max(middle + half, points.high),
            gravity=(self.parameters.gravity, 0.0),
            pace=_PRESSURE_PACE * unit.speed,
            unloading=unloading * unit.time,
        )
        p, rates = np.empty(_PIECES), np.empty(_PIECES)
        shortest, longest = within
        durations = _PRESSURE_DURATIONS * unit.time
        durations = durations[durations <= max(longest, durations[0])]
        durations = np.unique(np.maximum(durations, shortest))
        cost, excess, end, i = best_pressure(start, ends, durations, ground, lands, p, rates)
        curve = curve_over(start, ends[end], float(durations[i]), p, rates)
        return Found(curve, excess, cost), end


def _joined(first: Found, second: Found) -> Found:
    return Found(
        first.pieces + second.pieces,
        max(first.excess, second.excess),
        first.cost + second.cost,
    )


def with_rest(pieces: tuple[Quintic, ...], duration: float) -> tuple[Quintic, ...]:
    """A curve to rest, and some time in which the robot comes to it.

    None is added where the duration [s] is not positive.
    """
    if duration <= 0.0:
        return pieces
    still = np.zeros_like(pieces[-1].coefficients)
    still[:, 0] = pieces[-1].end()[:, 0]
    return (*pieces, Quintic(still, duration))
