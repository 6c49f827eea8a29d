"""Curves of the CoM between two feet on the ground: to rest, or to where the rear foot lifts off.

Of the quintics tried, that is taken which keeps the centre of pressure between the feet and the
legs within their reach, and of those the quickest.
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
from template_control.robot.start import Pose
from template_control.slip.dynamics.timed import TERMS, Quintic, polynomial, quintic
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import LENGTH, SPEED, TIME, Scale, scaled, tuned
from template_control.warm_up import Part

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
_LIGHTEST = 0.05  # of the weight: legs do not pull


class Rules(NamedTuple):
    """Costs of a curve.

    Attributes:
        low, high: x between which the centre of pressure is to stay [m].
        gravity: its parts away from the ground and along it, backward [m/s^2].
        reach: longest way from a foot to the CoM [m].
        slack: excess that costs nothing [m].
        pace: price of a second more or less than ``calm`` [m/s].
        calm: duration that is liked best [s].
    """

    low: float
    high: float
    gravity: tuple[float, float]
    reach: float
    slack: float
    pace: float
    calm: float


@compiled
def best_quintic(
    starts: Array, ends: Array, durations: Array, rules: Rules, curve: Array
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
        time = rules.pace * (t + rules.calm * rules.calm / t)
        for s in range(starts.shape[0]):
            for e in range(ends.shape[0]):
                if time >= best:
                    continue
                for axis in range(2):
                    quintic(starts[s, axis], ends[e, axis], t, c[axis])
                excess = 0.0
                for k in range(_SAMPLES + 1):
                    excess = max(excess, _excess(c, t * k / _SAMPLES, rules))
                    if excess - rules.slack + time >= best:
                        break
                cost = max(excess - rules.slack, 0.0) + time
                if cost < best:
                    best, least, chosen, lasting = cost, excess, e, i
                    for axis in range(2):
                        for n in range(TERMS):  # Numba compiles whole copies for seconds
                            curve[axis, n] = c[axis, n]
    return best, least, chosen, lasting


@compiled
def _excess(c: Array, t: float, rules: Rules) -> float:
    """By how far a curve leaves the feet, or the legs' reach, at a time [m]."""
    x = y = ax = ay = 0.0
    for n in range(TERMS - 1, -1, -1):
        x, y = x * t + c[0, n], y * t + c[1, n]
    for n in range(TERMS - 1, 1, -1):
        ax, ay = ax * t + n * (n - 1) * c[0, n], ay * t + n * (n - 1) * c[1, n]
    across, along = rules.gravity
    p = x - y * (ax + along) / max(across + ay, _LIGHTEST * across)
    away = max(x - rules.low, rules.high - x)
    far = np.sqrt(away * away + y * y) - rules.reach
    return float(max(rules.low - p, p - rules.high, far))


def curves() -> None:
    """The search, and a curve's value, called to compile them."""
    states = np.ones((1, 2, 3))
    rules = Rules(0.0, 1.0, (9.81, 0.0), 1.0, 0.0, 1.0, 1.0)
    best_quintic(states, states, np.ones(1), rules, np.empty((2, TERMS)))
    polynomial(np.ones(TERMS), 1.0)


STAND = (Part(curves, 0.5),)
"""Compiled functions of standing, starting and stopping."""


class Found(NamedTuple):
    """The best curve found, its pieces in order.

    ``excess`` is by how far the centre of pressure leaves the feet, or a leg its reach; ``cost`` is
    excess beyond the slack, and time [m].
    """

    pieces: tuple[Quintic, ...]
    excess: float
    cost: float


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
_CALM = 0.3  # duration of a quintic that is liked best [s]
_PACE = 0.002  # excess that a second more or less counts as [m/s]


@dataclass(frozen=True)
class BetweenFeet:
    """Curves with both feet on the ground, whose ``toes`` are x of the rear and the front one [m].

    The options are for this template.
    """

    toes: tuple[float, float]
    parameters: SlipParameters
    options: StandingOptions

    def fits(self, found: Found) -> bool:
        """True if a curve keeps the centre of pressure between the feet, but for the slack."""
        return found.excess <= self.options.slack

    @cached_property
    def _pace(self) -> float:
        return _PACE * Scale.of(self.parameters).speed

    @cached_property
    def _durations(self) -> tuple[float, float]:
        unit = Scale.of(self.parameters).time
        return _SHORTEST * unit, _LONGEST * unit

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
        """(2, 3) x and y, each position, velocity and acceleration, at rest over ``x``."""
        height = self.options.height
        uphill = height * np.tan(self.parameters.slope)
        return np.array([[x + uphill, 0.0, 0.0], [height, 0.0, 0.0]])

    @cached_property
    def _rules(self) -> Rules:
        p, o = self.parameters, self.options
        reach = o.reach * p.rest_length
        return Rules(
            low=min(self.toes),
            high=max(self.toes),
            gravity=p.gravity_parts,
            reach=reach,
            slack=o.slack,
            pace=self._pace,
            calm=_CALM * Scale.of(p).time,
        )

    def loaded(self, start: Array) -> Array:
        """Starts (n, 2, 3) with accelerations that load the front foot at once.

        ``start`` (2, 3) is x and y, each position, velocity and acceleration; the first of them.
        The only one, where a robot that falls has its CoM on the ground: no leg bears it.
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

    def best(self, start: Array, ends: Array) -> tuple[Found, int]:
        """The best quintic to one of several ends (n, 2, 3), and the end's number.

        ``start`` (2, 3) is x and y, each position, velocity and acceleration; or (m, 2, 3) of
        these.
        """
        durations = np.geomspace(*self._durations, _DURATIONS)
        curve = np.empty((2, TERMS))
        starts = start.reshape(-1, 2, 3).copy()
        # Where a foot lands late, the template has begun to fall.
        starts[:, 1, 2] = np.maximum(starts[:, 1, 2], -_FALL * self.parameters.gravity)
        cost, excess, end, i = best_quintic(starts, ends, durations, self._rules, curve)
        return Found((Quintic(curve, float(durations[i])),), excess, cost), end

    def to_rest(self, start: Array, lands: bool = False) -> Found:
        """Curve to rest where the centre of pressure allows, then to the place to stand.

        ``start`` (2, 3) is x and y, each position, velocity and acceleration; a front foot that has
        just landed (``lands``) takes up load at once.
        """
        margin = min(self.margin, 0.5 * abs(self.spacing))
        low, high = min(self.toes) + margin, max(self.toes) - margin
        wanted = self.place(PLACE)
        places = np.append(np.linspace(low, high, _REST_PLACES), wanted)
        starts = self.loaded(start) if lands else start
        stop, i = self.best(starts, np.array([self.at_rest(x) for x in places]))
        there, _ = self.best(starts, self.at_rest(wanted)[None])
        if there.cost <= stop.cost + self._pace * self._durations[1]:
            return there
        return self._joined(stop, self._shift(places[i], wanted))

    def to_liftoff(self, start: Array, ends: Array, lands: bool) -> tuple[Found, int]:
        """Curve to one of several states in which the rear foot lifts off, and the end's number.

        ``start`` (2, 3) and ``ends`` (n, 2, 3) are x and y, each position, velocity and
        acceleration. A front foot that has just landed (``lands``) takes up load at once; if none
        has, the CoM may first move back, and rest there.
        """
        found, number = self.best(self.loaded(start) if lands else start, ends)
        if lands or self.fits(found):
            return found, number
        for share in _SHIFTS:
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
        time = max(np.sqrt(_PEAK * abs(end - start) * height / room), self._durations[0])
        curve = Quintic.between(self.at_rest(start), self.at_rest(end), float(time))
        return Found((curve,), 0.0, self._pace * float(time))

    def _joined(self, first: Found, second: Found) -> Found:
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
