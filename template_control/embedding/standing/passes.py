"""Passes of the template over one leg, and the landings after them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from template_control.arrays import Array
from template_control.embedding.standing.curves import STAND, BetweenFeet, StandingOptions
from template_control.embedding.standing.pressure import PRESSURE
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride, StrideSimulator, controls
from template_control.slip.gaits.gait import GaitsBySpeed
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale
from template_control.warm_up import ready

_FLAT = 0.02  # touchdown angle of a leg that does not land [rad]
_FLATTER = 0.05  # the way past VLO goes on beyond the flattest landing [rad]
_POINTS = 120  # of a way, between which a landing is looked for
_NEWTON = 3
_APPROACHES = 12
_SPEEDS = 25  # that gaits and passes are kept for
_SLOW_STIFFNESS = 64.0  # stiffness of the leg that slowly passes under the CoM, k l0 / (m g)
_SLOWEST = 0.05  # speed at VLO of the slowest step, over sqrt(g l0)
_ANGLES = 12  # touchdown angles tried
_FLATTEST = 1.08  # of them [rad]
_STIFFNESS = (0.5, 4.0)  # least and greatest of the leg before touchdown, over k0
# The CoM sinks over a softer leg, and the foot lands further ahead of it.
_YIELDING = (1.0, 0.85, 0.7)  # stiffnesses tried, over that with which the leg keeps its length
_STEPS = (0.15, 0.65)  # shortest and longest step, over l0
_NARROW = 0.02  # excess that a metre between the feet, more or less than CLOSING, counts as [m]
CLOSING = 0.25
"""Distance of the feet after a step from a stand, and where a walk ends, over l0."""
# For the reference template.
_LONGEST = 0.5  # way of the CoM in single stance before VLO [s]
_LANDING = (0.16, 0.35)  # bounds of the shortest time from VLO to a touchdown [s]
_SWIFTNESS = 3.2  # mean speed of the foot to its foothold between them, over the CoM's at VLO
# Of a step from a stand.
STEP_DURATION = 1.5
"""Duration of a step from a stand, about [s], for the reference template."""
NIMBLE = 1.8
"""Largest mean speed of a foot in the air [m/s], for the reference template."""
_STEP_SPEEDS = 10  # at VLO that are tried
_FASTEST = 0.16  # of them, over sqrt(g l0)
_LATE = 0.15  # the foot lifts off this long after VLO at the latest [s], for the reference template
_SPARE = 0.06  # distance of the capture point from either foot at landing, over l0
_LIFTOFFS = 16
_LANDINGS = 60
_HURRY = 0.3  # m of excess that count as a metre which the foot cannot make
# Of a state (2, 3): the template's dynamics are the same forward and backward.
_MIRROR = np.array([[-1.0, 1.0, -1.0], [1.0, -1.0, 1.0]])


class SingleSupportPass(NamedTuple):
    """A pass over a leg whose foot is at x = 0."""

    vlo: Array  # (3,) dx/dt, y, dy/dt [m/s, m, m/s]
    stiffness: float  # of the leg [N/m]
    way: Array  # (n, 2, 3) states of the CoM on the way to VLO, the last of them first


class Touchdown(NamedTuple):
    """Touchdown of a walking step."""

    angle: float  # of the leg that lands [rad]
    stiffness: float  # of the leg before it [N/m]
    state: Array  # (2, 3) of the CoM
    toes: tuple[float, float]  # x of the rear and the front foot [m]
    late: float  # by how much it comes later than the foot could [s]


class StepLanding(NamedTuple):
    """Landing of a step from a stand."""

    angle: float  # of the leg that lands [rad]
    time: float  # from where it was looked for [s]
    toe: float  # x of the foot [m]
    price: float  # of coming to rest after it [m]


class StepPass(NamedTuple):
    """The way over a foot at x = 0, and the landing after it."""

    stiffness: float  # of the leg [N/m]
    times: Array  # (n,) at which the other foot may lift off, 0 at VLO [s]
    states: Array  # (n, 2, 3) of the CoM then
    landing: StepLanding  # the best, from VLO on


class PassTable:
    """Passes over a leg by their speed at VLO, and the landings after them.

    The options are for this template. States (2, 3) of the CoM are x and y, each position, velocity
    and acceleration.
    """

    def __init__(
        self, parameters: SlipParameters, options: StandingOptions, family: GaitsBySpeed
    ) -> None:
        ready(PRESSURE if options.half_length else STAND)
        self.parameters, self.options, self.family = parameters, options, family
        self.scale = Scale.of(parameters)
        self._simulator = StrideSimulator(parameters, AUTOMATON)
        # Uphill is downhill for one who walks back.
        self._back = StrideSimulator(replace(parameters, slope=-parameters.slope), AUTOMATON)
        self._node = AUTOMATON.start(StrideKind.WALK).name
        first = AUTOMATON.start(StrideKind.STEP_FORWARD).name
        self._step_node = AUTOMATON.successor(first, Event.REAR_LIFTOFF)
        self._known: dict[float, SingleSupportPass] = {}
        # Uphill the CoM is behind the foot at VLO, and has to come over it.
        uphill = max(np.tan(parameters.slope), 0.0) * np.sqrt(parameters.gravity * options.height)
        slowest = _SLOWEST * parameters.speed_unit
        if uphill:
            slowest = float(np.hypot(slowest, uphill))
        self._speeds = np.linspace(slowest, family.speeds[1], _SPEEDS)

    def on_slope(self, slope: float) -> PassTable:
        """The same passes over a leg on ground of another angle, uphill positive [rad]."""
        ground = replace(self.parameters, slope=slope)
        return PassTable(ground, self.options, self.family)

    def feet(self, toes: tuple[float, float]) -> BetweenFeet:
        """Both feet on the ground, at x of the rear and the front one [m]."""
        return BetweenFeet(toes, self.parameters, self.options)

    def width_price(self, apart: float) -> float:
        """Price of feet that stand ``apart`` [m], not at the distance that is liked best [m]."""
        return _NARROW * abs(apart - CLOSING * self.parameters.rest_length)

    def capture(self, state: Array) -> float:
        """The capture point x + dx/dt sqrt(y / g) [m]; x where the CoM is not above the ground."""
        (x, speed, _), y = state[0], state[1, 0]
        # A robot that falls may have its CoM below where its foot was to stand.
        return float(x + speed * np.sqrt(max(y, 0.0) / self.parameters.gravity))

    def arriving(self, node: str, state: Array, u: Array, toes: Array) -> Stride:
        """The template's stride from a node on.

        ``state`` (2, 3) is the CoM's, ``u`` (NUM_SLOTS,) are controls, ``toes`` (2,) x of the rear
        and the front foot [m].
        """
        return self._simulator.run(node, state[:, :2].T.ravel(), u, toes)

    def between(self, wanted: float, present: float) -> list[float]:
        """Speeds at VLO that are tried, the best first [m/s].

        ``wanted`` is the first, or the nearest there is; none lies beyond ``present``.
        """
        low, high = min(wanted, present), max(wanted, present)
        inside = [float(v) for v in self._speeds if low < v < high]
        first = float(np.clip(wanted, self._speeds[0], self._speeds[-1]))
        return [first, *sorted(inside, key=lambda v: abs(v - wanted))]

    def at(self, speed: float) -> SingleSupportPass:
        """The pass with a speed at VLO [m/s]."""
        if speed not in self._known:
            self._known[speed] = self._made(speed)
        return self._known[speed]

    def _made(self, speed: float) -> SingleSupportPass:
        p, slowest = self.parameters, self.family.speeds[0]
        gait = self.family.nearest(speed)
        vlo, stiffness = gait.state, float(gait.controls[Slot.K_SD])
        if speed < slowest:
            stiff = _SLOW_STIFFNESS * p.mass * p.gravity / p.rest_length
            share = np.clip(2.0 * (1.0 - speed / slowest), 0.0, 1.0)
            stiffness = float(stiffness + share * (stiff - stiffness))
            load = p.mass * (p.gravity - speed**2 / p.rest_length)
            vlo = np.array([speed, p.rest_length - load / stiffness, 0.0])
        u = controls(_FLAT, stiffness, stiffness)
        past = self._back.run(self._node, [0.0, vlo[1], vlo[0], -vlo[2]], u)
        # Whatever ends the stride: before it the leg pushes.
        longest = min(_LONGEST * self.scale.time, 0.98 * past.duration)
        times = np.linspace(self.options.single, longest, _APPROACHES)
        return SingleSupportPass(vlo, stiffness, states_at(past, times) * _MIRROR)

    def touchdowns(self, z: Array, angles: tuple[float, float]) -> list[Touchdown]:
        """Steps that may be made from a VLO state z (3,).

        ``angles`` are the least and greatest touchdown angle [rad].
        """
        p, (least, most) = self.parameters, _STIFFNESS
        load = p.mass * (p.gravity - z[0] ** 2 / p.rest_length)
        k = float(load / max(p.rest_length - float(z[1]), 1e-6))  # with which it keeps its length
        k0 = p.leg_stiffness
        tried = {min(max(share * k, least * k0), most * k0) for share in _YIELDING}
        steps = [step for k in sorted(tried) for step in self._touchdowns(z, k, angles)]
        # Where no step leaves the foot its time, the one that leaves it most has to do.
        return [s for s in steps if s.late >= 0.0] or sorted(steps, key=lambda s: -s.late)[:1]

    def _touchdowns(
        self, z: Array, stiffness: float, angles: tuple[float, float]
    ) -> list[Touchdown]:
        """Of all angles from one way past VLO: the foot lands when the CoM sinks to its leg."""
        length = self.parameters.rest_length
        top = float(np.arcsin(min(z[1] / length, 1.0))) - 0.005
        tried = np.unique(np.clip(np.linspace(_FLATTEST, top, _ANGLES), *angles))
        u = controls(max(float(tried[0]) - _FLATTER, _FLAT), stiffness, stiffness)
        stride = self._simulator.run(self._node, VLO.state(z), u)
        times = _sinking(stride, length * np.sin(tried))
        landed = np.isfinite(times)
        shortest, longest = (step * length for step in _STEPS)
        soonest, latest = (time * self.scale.time for time in _LANDING)
        found = []
        for angle, time, state in zip(
            tried[landed], times[landed], states_at(stride, times[landed]), strict=True
        ):
            toe = float(state[0, 0] + length * np.cos(angle))
            if shortest <= toe <= longest or len(tried) == 1:
                swift = toe / (_SWIFTNESS * max(float(z[0]), 1e-6))
                late = float(time) - float(np.clip(swift, soonest, latest))
                found.append(Touchdown(float(angle), stiffness, state, (0.0, toe), late))
        return found

    @cached_property
    def steps(self) -> list[StepPass]:
        """Passes of a step from a stand, over the foot that stays, the slowest first."""
        speeds = np.linspace(_SLOWEST, _FASTEST, _STEP_SPEEDS) * self.parameters.speed_unit
        found = (self._step_over(self.at(float(speed))) for speed in speeds)
        return [over for over in found if over is not None]

    def _step_over(self, over: SingleSupportPass) -> StepPass | None:
        """The pass with its landing; None where no landing follows."""
        speed, height, _ = over.vlo
        start = np.array([[0.0, speed, 0.0], [height, 0.0, 0.0]])
        landings = self._landings(start, over.stiffness, 0.0)
        if not landings:
            return None
        stride = self._step_way(start, over.stiffness, 0.0)
        longest = min(_LONGEST * self.scale.time, 0.98 * stride.duration)
        times = np.linspace(-longest, _LATE * self.scale.time, _LIFTOFFS)
        states = states_at(stride, np.abs(times))
        states[times < 0.0] *= _MIRROR
        best = min(landings, key=lambda one: one.price)
        # On a way that rises and sinks more than once the foot would land where it first sinks.
        low = states[:, 1, 0] <= self.parameters.rest_length * np.sin(best.angle)
        sooner = np.flatnonzero(~low[:-1] & low[1:] & (times[1:] < best.time))
        first = int(sooner[-1]) + 1 if len(sooner) else 0
        return StepPass(over.stiffness, times[first:], states[first:], best)

    def carrying(self, start: Array, toe: float) -> float:
        """Stiffness with which a leg, its foot at x ``toe`` [m], carries the weight [N/m]."""
        p, (least, most) = self.parameters, _STIFFNESS
        length = float(np.hypot(start[0, 0] - toe, start[1, 0]))
        share = p.mass * p.gravity / (max(p.rest_length - length, 1e-6) * p.leg_stiffness)
        return min(max(share, least), most) * p.leg_stiffness

    def best_landing(
        self, start: Array, stiffness: float, feet: Sequence[float]
    ) -> StepLanding | None:
        """The best landing of a step from a state (2, 3); None where there is none.

        The leg has a stiffness [N/m]; ``feet`` are x of the foot that stands and of the other one
        [m].
        """
        landings = self._landings(start, stiffness, feet[0])
        return min(landings, key=lambda one: self.hurried(one, feet[1]), default=None)

    def hurried(self, landing: StepLanding, foot: float) -> float:
        """Price of a landing for a foot, now at x ``foot`` [m], that has to get there [m]."""
        beyond = abs(landing.toe - foot) - NIMBLE * self.scale.speed * landing.time
        return landing.price + _HURRY * max(beyond, 0.0)

    def _landings(self, start: Array, stiffness: float, toe: float) -> list[StepLanding]:
        """Landings of a step forward, from the CoM's state over a foot at x = ``toe``.

        The CoM can come to rest while its capture point is between the feet.
        """
        length = self.parameters.rest_length
        longest, duration = _STEPS[1] * length, STEP_DURATION * self.scale.time
        stride = self._step_way(start, stiffness, toe)
        times = np.linspace(0.0, 0.98 * min(stride.duration, duration), _LANDINGS)[1:]
        states = states_at(stride, times)
        # Whenever the CoM sinks the foot may land: its leg has the angle that suits the height.
        angles = np.arcsin(np.minimum(states[:, 1, 0] / length, 1.0))
        feet = states[:, 0, 0] + length * np.cos(angles)
        sinks = (states[:, 1, 1] < 0.0) & (np.maximum.accumulate(angles[::-1])[::-1] <= angles)
        sinks &= angles > 0.0  # of a robot that falls: the CoM is below the foot
        found = []
        for i in np.flatnonzero(sinks & (feet - toe <= longest)):
            foot, capture = float(feet[i]), self.capture(states[i])
            spare = _SPARE * length - min(foot - capture, capture - toe)
            price = max(spare, 0.0) + self.width_price(foot - toe)
            found.append(StepLanding(float(angles[i]), float(times[i]), foot, price))
        return found

    def _step_way(self, start: Array, stiffness: float, toe: float) -> Stride:
        """The template's way over a foot at x = ``toe``, without a landing."""
        u = controls(_FLAT, stiffness, 0.0)
        return self.arriving(self._step_node, start, u, np.array([toe, toe]))


def shifted(states: Array, x: float) -> Array:
    """The same states (n, 2, 3), ``x`` further ahead [m]."""
    there = states.copy()
    there[:, 0, 0] += x
    return there


def states_at(stride: Stride, times: ArrayLike) -> Array:
    """(n, 2, 3) states of the CoM at times (n,) of a stride [s]."""
    return stride.sample(times).reshape(-1, 3, 2).swapaxes(1, 2).copy()


def _sinking(stride: Stride, heights: Array) -> Array:
    """Times (n,) at which the CoM of a stride sinks to each of (n,) heights; NaN if never [s]."""
    time = stride.time_of(Event.TOUCHDOWN)
    end = time if np.isfinite(time) else stride.duration
    grid = np.linspace(0.0, end, _POINTS)
    levels = stride.sample(grid)[:, 1]
    falls = (levels[:-1, None] > heights) & (levels[1:, None] <= heights)
    ever = falls.any(axis=0)
    times = np.where(ever, grid[falls.argmax(axis=0) + 1], np.nan)
    for _ in range(_NEWTON):
        path = stride.sample(times[ever])
        times[ever] -= (path[:, 1] - heights[ever]) / path[:, 3]
    return times
