"""Curves of the CoM between two feet on the ground: to rest, or to where the rear foot lifts off.

The centre of pressure is planned by the quadratic program of :mod:`~.planning.pressure`. It is
anywhere between the feet; pairs of feet and soles, which bear a moment, have it beyond the middle
of either one too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, Pair
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.robot.start import Pose
from template_control.slip.dynamics.timed import Quintic
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.catching import CatchingStep
from template_control.slip.planning.pressure import (
    SMOOTH,
    UNLOADING,
    Ground,
    Ways,
    best_way,
    curve_over,
)
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import LENGTH, SPEED, TIME, Scale, scaled, tuned
from template_control.whole_body.solver import SOLE_SHARE

SPACING = 0.3
"""Distance of the feet where a run begins, over l0."""
CLOSING = 0.25
"""Distance of the feet after a step from a stand, and where a walk ends, over l0."""
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
        shift: shortest time from rest to a liftoff [s]: until then the CoM of a robot on two soles,
            or two pairs of feet, has to be over those that stay.
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


class Found(NamedTuple):
    """The best curve found."""

    parts: list[tuple[Quintic, ...]]  # its pieces, by stage
    excess: float  # miss of its end, or by how far a leg leaves its reach [m]
    cost: float  # excess beyond the slack, and its price [m]
    number: int  # of the way

    @property
    def pieces(self) -> tuple[Quintic, ...]:
        """Of all stages."""
        return tuple(piece for part in self.parts for piece in part)


_PIECES = 20  # of a curve of one stage
_OF_STAGE = 8  # of each of several
_FALL = 0.5  # largest downward acceleration that a curve begins with, over g
_LED = 0.05  # excess up to which a curve is led to its end, over l0
_LOW = 0.3  # least height of the CoM that a step is planned with, over l0
_PASSING = 2.0  # longest time to a foot that is passed, over that at the present speed
# Of the ground under the feet that a plan uses: folding legs ask for a little more.
_SHARE = 0.8
_KEPT = 0.1  # share of the spacing that points keep ahead of the rear one at a start
_STILL = 0.01  # over sqrt(g l0): a CoM that is faster does not begin at rest
# For the reference template.
_ARRIVE = 2e4  # R, what an error at the end costs [s]
_CALM = 0.3  # duration that is liked best [s]
# Excess that a second more or less counts as [m/s]. Near its end a curve that is planned anew had
# better miss it by millimetres than swing back once more.
_PACE = 0.01
_DURATIONS = np.geomspace(0.03, 1.6, 14)  # that are tried [s]
# Of the time to the liftoff at the mean of both speeds, tried where the CoM moves.
_DIRECT = np.geomspace(0.8, 1.25, 8)
# Of a step: times before the liftoff, in the air and after the touchdown.
_LIFTS, _SWINGS = np.geomspace(0.03, 1.2, 8), np.geomspace(0.05, 0.6, 9)
_RESTS, _SOON = np.array([0.5, 0.7, 0.9]), np.array([1e-3])
_NIMBLE = 1.8  # mean speed of a foot in the air that is liked [m/s]
_HURRY = 0.3  # price of a metre that it cannot make with that
_SPARE = 0.03  # distance of the centre of pressure from both feet after a touchdown [m]
_NARROW = 0.02  # price of a metre between the feet beyond CLOSING
_FARTHEST = 0.65  # foothold, ahead of the foot that stands [m]


@dataclass(frozen=True)
class BetweenFeet:
    """Curves with both feet on the ground, whose ``toes`` are x of the rear and the front one [m].

    The options are for this template. States are (2, 3) x and y of the CoM, each position, velocity
    and acceleration.
    """

    toes: Pair
    parameters: SlipParameters
    options: StandingOptions

    def fits(self, found: Found) -> bool:
        """True if a curve leads to its end within the legs' reach, but for the slack."""
        return found.excess <= self.options.slack

    @cached_property
    def _scale(self) -> Scale:
        return Scale.of(self.parameters)

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

    def capture(self, state: Array) -> float:
        """The capture point x + dx/dt sqrt(y / g) [m]; x where the CoM is not above the ground."""
        (x, speed, _), y = state[0], state[1, 0]
        # A robot that falls may have its CoM below where its foot was to stand.
        return float(x + speed * np.sqrt(max(y, 0.0) / self.parameters.gravity))

    def to_rest(self, start: Array, lands: bool = False) -> Found:
        """Curve to rest at the place to stand.

        A front foot that has just landed (``lands``) takes up load at once.
        """
        o, wanted, half = self.options, self.place(PLACE), self._half
        if o.slant:  # as the CoM is held there
            half = SOLE_SHARE * o.half_length + o.slant * abs(self.spacing)
        times = _DURATIONS * self._scale.time
        stages = _stage(times, self.toes, half, wanted)
        return self._best(start, stages, self.at_rest(wanted)[None], self._price(times), lands)

    def to_liftoff(self, start: Array, ends: Array, lands: bool) -> Found:
        """Curve to one of several states (n, 2, 3) of the rear foot's liftoff.

        A front foot that has just landed (``lands``) takes up load at once. The rear foot has no
        load left at the end.
        """
        x, speed, _ = start[0].tolist()
        moves = speed > _STILL * self.parameters.speed_unit
        times = _DURATIONS * self._scale.time
        if moves and self.capture(start) > self.toes[1]:
            # Once the capture point is past the foot that stays, the CoM is not thrown back again.
            longest = _PASSING * max(self.toes[1] - x, 0.0) / speed
            times = times[times <= max(longest, times[0])]
        elif not (lands or moves):
            times = np.unique(np.maximum(times, self.options.shift))
        times = np.repeat(times[:, None], len(ends), axis=1)
        if moves:  # there is little choice
            direct = 2.0 * (ends[:, 0, 0] - x) / (speed + ends[:, 0, 1])
            times = np.vstack((times, np.maximum(direct * _DIRECT[:, None], times.min())))
        ends = np.tile(ends, (len(times), 1, 1))
        times = times.ravel()
        stages = _stage(times, self.toes, self._half, self.toes[1], lifts=1.0)
        if not (lands or moves or self._half):
            stages[:, :, 1] += _KEPT * self.spacing
        return self._best(start, stages, ends, self._price(times), lands)

    def by_step(
        self, start: Array, lifted: bool, catching: CatchingStep | None = None
    ) -> tuple[Found, float]:
        """Curve to rest by a step of the rear foot ahead, and where it lands [m].

        It lifts off, or is ``lifted``; ``catching`` may say when and where it lands, and over which
        centre of pressure.
        """
        length, unit, (_, stands) = self._scale.length, self._scale.time, self.toes
        lifts, swings, pressure = _LIFTS * unit, _SWINGS * unit, stands
        if catching is not None:
            lifts, swings, pressure = _SOON * unit, np.array([catching.lasts]), catching.pressure
        tried = np.meshgrid(lifts[: 1 if lifted else None], swings, _RESTS * unit, indexing="ij")
        both, air, rest = (times.ravel() for times in tried)
        both *= not lifted
        (x, speed, _), (y, *_) = start.tolist()
        rate = np.sqrt(self.parameters.gravity / max(y, _LOW * length))
        # Where the CoM and its capture point are at touchdown, over the foot that stands.
        growth = np.exp(rate * (both + air))
        capture = growth * (x - stands + speed / rate)
        com = 0.5 * (capture + (x - stands - speed / rate) / growth)
        closing, spare = CLOSING * length, _SPARE * length
        apart = np.maximum(np.maximum(capture + 2.0 * spare, com + 0.5 * closing), closing)
        apart = np.minimum(apart, _FARTHEST * length)
        if catching is not None:
            apart = np.full(len(air), catching.foothold - stands)
        way = apart + self.spacing + 2.0 * spare
        late = np.maximum(way - _NIMBLE * self._scale.speed * air, 0.0)
        foot, half = stands + apart, self._half
        middle = 0.5 * (stands + foot)
        feet = stands + spare * np.sign(apart), foot - spare * np.sign(apart)
        three = (
            _stage(both, self.toes, half, stands, lifts=1.0),
            _stage(air, (pressure, pressure), 0.0, pressure),
            _stage(rest, feet, half, middle),
        )
        stages = np.concatenate(three, axis=1)
        ends = np.repeat(self.at_rest(0.0)[None], len(foot), axis=0)
        ends[:, 0, 0] += middle
        price = self._price(rest) + _NARROW * np.abs(apart - closing) + _HURRY * late
        if lifted:  # it is to come down
            stages, price = stages[:, 1:], price + _PACE * self._scale.speed * air
        else:
            price += self._price(both) + self._price(air)
        found = self._best(start, stages, ends, price, False)
        return found, float(foot[found.number])

    @property
    def _half(self) -> float:
        return _SHARE * self.options.half_length

    def _price(self, lasts: Array) -> Array:
        """Of times on a curve [m]."""
        unit = self._scale
        return _PACE * unit.speed * (lasts + (_CALM * unit.time) ** 2 / lasts)

    def _best(self, start: Array, stages: Array, ends: Array, price: Array, jumps: bool) -> Found:
        """The best curve through (n, s, 7) stages of :class:`Ways` to ``ends`` (n, 2, 3)."""
        o, unit, p = self.options, self._scale, self.parameters
        start = start.copy()
        # Where a foot lands late, the template has begun to fall.
        start[1, 2] = max(start[1, 2], -_FALL * p.gravity)
        order = np.argsort(price, kind="stable")
        ways = Ways(stages, np.broadcast_to(ends, (len(price), 2, 3)), price)
        ways = Ways(*(column[order] for column in ways))
        ground = Ground(
            gravity=p.gravity_parts,
            reach=o.reach * p.rest_length,
            slack=o.slack,
            unloading=UNLOADING * unit.time,
            smooth=SMOOTH * unit.time,
            arrive=_ARRIVE * unit.time,
            jumps=jumps,
        )
        count = _PIECES if stages.shape[1] == 1 else _OF_STAGE
        pressures, rates = np.empty((2, count * stages.shape[1]))
        i, cost, excess = best_way(start, ways, ground, pressures, rates)
        lasts, end = np.repeat(ways.stages[i, :, 0] / count, count), ways.ends[i]
        led = excess <= _LED * p.rest_length
        pieces = curve_over(start, end, lasts, pressures, rates, led)
        parts = [pieces[k : k + count] for k in range(0, len(pieces), count)]
        return Found(parts, excess, cost, int(order[i]))


def _stage(
    lasts: Array,
    feet: Sequence[Array | float],
    half: float,
    wish: Array | float,
    lifts: float = 0.0,
) -> Array:
    """Stages (n, 1, 7) of :class:`Ways`, on the feet, and ``half`` around their middle."""
    rear, front = feet
    middle = 0.5 * (np.asarray(rear) + front)
    low = np.minimum(middle - half, np.minimum(rear, front))
    high = np.maximum(middle + half, np.maximum(rear, front))
    columns = np.broadcast_arrays(lasts, low, high, wish, rear, front, lifts)
    return np.stack(columns, axis=-1)[:, None]
