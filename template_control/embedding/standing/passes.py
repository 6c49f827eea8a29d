"""Passes of the template over a leg, and the touchdowns of a walk's step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, Pair
from template_control.embedding.standing.curves import CLOSING, BetweenFeet, StandingOptions
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event, Slot, StrideKind
from template_control.slip.dynamics.stride import StrideSimulator, controls
from template_control.slip.gaits.gait import GaitsBySpeed
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.pressure import PRESSURE
from template_control.slip.similarity import Scale
from template_control.warm_up import ready

_FLAT = 0.02  # touchdown angle of a leg that does not land [rad]
_FLATTER = 0.05  # the way past VLO goes on beyond the flattest landing [rad]
_POINTS = 120  # of a way, between which a landing is looked for
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
_NARROW = 0.02  # price of a metre between the feet, more or less than CLOSING
_SPARE = 0.04  # distance of the capture point from either foot at a touchdown before rest, over l0
_MOVING = 0.02  # way of the CoM while the centre of pressure moves to the front foot, over l0
_OFF = 20.0  # price of a metre by which it would have to move sooner or later than it can
# For the reference template.
_LONGEST = 0.5  # way of the CoM in single stance before VLO [s]
_LANDING = (0.16, 0.35)  # bounds of the shortest time from VLO to a touchdown [s]
_SWIFTNESS = 3.2  # mean speed of the foot to its foothold between them, over the CoM's at VLO
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
    speed: float  # at VLO that it leads to; 0: rest [m/s]


class PassTable:
    """Passes over a leg by their speed at VLO, and the touchdowns after them.

    The options are for this template. States (2, 3) of the CoM are x and y, each position, velocity
    and acceleration.
    """

    def __init__(
        self, parameters: SlipParameters, options: StandingOptions, family: GaitsBySpeed
    ) -> None:
        ready(PRESSURE)
        self.parameters, self.options, self.family = parameters, options, family
        self.scale = Scale.of(parameters)
        self.simulator = StrideSimulator(parameters, AUTOMATON)
        # Uphill is downhill for one who walks back.
        self._back = StrideSimulator(replace(parameters, slope=-parameters.slope), AUTOMATON)
        self._node = AUTOMATON.start(StrideKind.WALK).name
        self._known: dict[float, SingleSupportPass] = {}
        # Uphill the CoM is behind the foot at VLO, and has to come over it.
        uphill = max(np.tan(parameters.slope), 0.0) * np.sqrt(parameters.gravity * options.height)
        slowest = float(np.hypot(_SLOWEST * parameters.speed_unit, uphill))
        self._speeds = np.linspace(slowest, family.speeds[1], _SPEEDS)

    def on_slope(self, slope: float) -> PassTable:
        """The same passes over a leg on ground of another angle, uphill positive [rad]."""
        ground = replace(self.parameters, slope=slope)
        return PassTable(ground, self.options, self.family)

    def feet(self, toes: Pair) -> BetweenFeet:
        """Both feet on the ground, at x of the rear and the front one [m]."""
        return BetweenFeet(toes, self.parameters, self.options)

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
        states = past.sample(times).reshape(-1, 3, 2).swapaxes(1, 2)
        return SingleSupportPass(vlo, stiffness, states * _MIRROR)

    def best_touchdown(
        self, z: Array, angles: Pair, speeds: Sequence[float] = ()
    ) -> Touchdown | None:
        """The step from a VLO state z (3,) after which the first speed at VLO can be had [m/s].

        Without speeds: rest. ``angles`` are the least and greatest touchdown angle [rad]. By the
        linear pendulum: where the centre of pressure moves to the foot that has landed, d ahead,
        when the CoM is s past the other one, dx/dt^2 grows by w^2 d (2 s - d).
        """
        p, length = self.parameters, self.parameters.rest_length
        low, high = (share * p.leg_stiffness for share in _STIFFNESS)
        load = p.mass * (p.gravity - z[0] ** 2 / length)
        k = float(load / max(length - float(z[1]), 1e-6))  # with which it keeps its length
        tried = sorted({min(max(share * k, low), high) for share in _YIELDING})
        steps = np.concatenate([self._touchdowns(z, k, angles) for k in tried])
        if not len(steps):
            return None
        # Where no step leaves the foot its time, the one that leaves it most has to do.
        steps = steps[steps[:, 6] >= min(0.0, steps[:, 6].max())]
        _, _, x, y, v, d, _ = steps.T
        rate = np.sqrt(p.gravity / y)
        uphill = p.gravity_parts[1] / rate**2  # on a slope the CoM is as over feet further there
        price = _NARROW * np.abs(d - CLOSING * length)[None]
        if len(speeds):
            after = np.array(speeds)[:, None]
            gained = after**2 - (rate * uphill) ** 2 - v**2 + (rate * (x - uphill)) ** 2
            s = uphill + 0.5 * (d + gained / (rate**2 * d))
            # The rear leg does not reach further, and the foot has to pass.
            last = np.sqrt(np.maximum((self.options.reach * length) ** 2 - y**2, 0.0))
            last = np.minimum(last, d - after / rate * np.sinh(rate * self.options.single))
            room = np.minimum(last - _MOVING * length - s, s - x)
            price = price + _OFF * np.maximum(-room, 0.0)
            price += self.scale.time * np.abs(after - speeds[0])
        else:
            capture = x - uphill + v / rate
            spare = np.minimum(d - capture, capture) + self.options.half_length
            price += np.maximum(_SPARE * length - spare, 0.0)
        at, i = np.unravel_index(price.argmin(), price.shape)
        speed = float(speeds[at]) if len(speeds) else 0.0
        return Touchdown(float(steps[i, 0]), float(steps[i, 1]), speed)

    def _touchdowns(self, z: Array, stiffness: float, angles: Pair) -> Array:
        """Steps (n, 7) from one way past VLO: the foot lands when the CoM sinks to its leg.

        Angle and stiffness, the CoM's x, y and dx/dt, x of the foot, and by how much it lands later
        than it could [s].
        """
        length = self.parameters.rest_length
        top = float(np.arcsin(min(z[1] / length, 1.0))) - 0.005
        angle = np.unique(np.clip(np.linspace(_FLATTEST, top, _ANGLES), *angles))
        u = controls(max(float(angle[0]) - _FLATTER, _FLAT), stiffness, stiffness)
        stride = self.simulator.run(self._node, VLO.state(z), u)
        grid = np.linspace(0.0, min(stride.time_of(Event.TOUCHDOWN), stride.duration), _POINTS)
        levels = stride.sample(grid)[:, 1]
        sinks = int(levels.argmax())
        depth = np.maximum.accumulate(-levels[sinks:])
        time = np.interp(-length * np.sin(angle), depth, grid[sinks:], np.nan, np.nan)
        lands = np.isfinite(time)
        angle, time = angle[lands], time[lands]
        x, y, v, *_ = stride.sample(time).T
        toe = x + length * np.cos(angle)
        shortest, longest = (step * length for step in _STEPS)
        soonest, latest = (bound * self.scale.time for bound in _LANDING)
        swift = toe / (_SWIFTNESS * max(float(z[0]), 1e-6))
        late = time - np.clip(swift, soonest, latest)
        same = np.full(len(angle), stiffness)
        found = np.stack((angle, same, x, y, v, toe, late), axis=-1)
        return found if len(lands) == 1 else found[(shortest <= toe) & (toe <= longest)]
