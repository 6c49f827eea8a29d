"""How the template passes over one leg, from a liftoff to VLO and from there to a touchdown.

A gait passes at its own height with its own stiffness. Slower than any gait, the leg keeps its
length as it passes, k (l0 - y) = m (g - v^2 / l0), and is the stiffer the slower it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.standing.curve_search import STAND
from template_control.embedding.standing.options import StandingOptions
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import Event, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride, StrideSimulator, controls
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.warm_up import ready

Array = NDArray[np.float64]

_FLAT = 0.02  # touchdown angle of a leg that does not land [rad]
_FLATTER = 0.05  # the way past VLO goes on beyond the flattest landing [rad]
_POINTS = 120  # of a way, between which a landing is looked for
_NEWTON = 3
_STATES = 12
_SPEEDS = 25  # that gaits and vaults are kept for


class Family(NamedTuple):
    """Walking gaits by their speed at VLO.

    Attributes:
        gait: with a speed [m/s].
        speeds: slowest and fastest [m/s].
    """

    gait: Callable[[float], Gait]
    speeds: tuple[float, float]


class Vault(NamedTuple):
    """A VLO, and the leg that passes it.

    Attributes:
        vlo: (3,) dx/dt, y, dy/dt [m/s, m, m/s].
        stiffness: of the leg [N/m].
    """

    vlo: Array
    stiffness: float


class Touchdown(NamedTuple):
    """Where a step lands.

    Attributes:
        angle: its touchdown angle [rad].
        stiffness: of the leg before it [N/m].
        state: (2, 3) x and y of the CoM, each position, velocity, acceleration.
        toes: x of the rear and the front foot [m].
        late: by how much it comes later than the foot could [s].
    """

    angle: float
    stiffness: float
    state: Array
    toes: tuple[float, float]
    late: float


class Vaults:
    """Passes over a leg by their speed at VLO.

    Args:
        parameters: the template.
        options: tuning, for that template.
        family: the gaits.
        automaton: of the strides.
    """

    def __init__(
        self,
        parameters: SlipParameters,
        options: StandingOptions,
        family: Family,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        ready(STAND)
        self.parameters, self.options, self.family = parameters, options, family
        self._automaton = automaton
        self._simulator = StrideSimulator(parameters, automaton)
        self._node = automaton.start(StrideKind.WALK).name
        self._known: dict[float, Vault] = {}
        self._ways: dict[float, Array] = {}
        unit = parameters.speed_unit
        # Uphill the CoM is behind the foot at VLO, and has to come over it.
        uphill = max(np.tan(parameters.slope), 0.0) * np.sqrt(parameters.gravity * options.height)
        slowest = options.slowest * unit
        if uphill:
            slowest = float(np.hypot(slowest, uphill))
        self._speeds = np.linspace(slowest, family.speeds[1], _SPEEDS)

    def on_slope(self, slope: float) -> Vaults:
        """The same passes over a leg on other ground.

        Args:
            slope: its angle, uphill positive [rad].
        """
        ground = replace(self.parameters, slope=slope)
        return Vaults(ground, self.options, self.family, self._automaton)

    def between(self, wanted: float, present: float) -> list[float]:
        """Speeds at VLO that are tried, the best first [m/s].

        Args:
            wanted: the first, or the nearest there is [m/s].
            present: none lies beyond it [m/s].
        """
        low, high = min(wanted, present), max(wanted, present)
        inside = [float(v) for v in self._speeds if low < v < high]
        first = float(np.clip(wanted, self._speeds[0], self._speeds[-1]))
        return [first, *sorted(inside, key=lambda v: abs(v - wanted))]

    def at(self, speed: float) -> Vault:
        """The pass with a speed at VLO [m/s]."""
        if speed not in self._known:
            self._known[speed] = self._made(speed)
        return self._known[speed]

    def _made(self, speed: float) -> Vault:
        p, (slowest, fastest) = self.parameters, self.family.speeds
        if speed >= slowest:
            gait = self.family.gait(min(speed, fastest))
            return Vault(gait.state, float(gait.controls[Slot.K_SD]))
        own = float(self.family.gait(slowest).controls[Slot.K_SD])
        stiff = self.options.vault * p.mass * p.gravity / p.rest_length
        share = np.clip(2.0 * (1.0 - speed / slowest), 0.0, 1.0)
        stiffness = float(own + share * (stiff - own))
        load = p.mass * (p.gravity - speed**2 / p.rest_length)
        return Vault(np.array([speed, p.rest_length - load / stiffness, 0.0]), stiffness)

    def approach(self, vault: Vault, toe: float) -> Array:
        """States (n, 2, 3) on the way to VLO over ``toe`` [m], the last of them first.

        The template's dynamics are the same forward and backward.

        Args:
            vault: where they lead to.
            toe: x of the foot [m].
        """
        speed = float(vault.vlo[0])
        if speed not in self._ways:
            self._ways[speed] = self._way(vault)
        states = self._ways[speed].copy()
        states[:, 0, 0] += toe
        return states

    def _way(self, vault: Vault) -> Array:
        speed, height, vertical = vault.vlo
        u = controls(_FLAT, vault.stiffness, vault.stiffness)
        # Uphill is downhill for one who walks back.
        back = replace(self.parameters, slope=-self.parameters.slope)
        simulator = StrideSimulator(back, self._automaton)
        past = simulator.run(self._node, [0.0, height, speed, -vertical], u)
        shortest, longest = self.options.single
        # Whatever ends the stride: before it the leg pushes.
        longest = min(longest, 0.98 * past.duration)
        x, y, dx, dy, ddx, ddy = past.sample(np.linspace(shortest, longest, _STATES)).T
        return np.stack(
            (np.stack((-x, dx, -ddx), axis=-1), np.stack((y, -dy, ddy), axis=-1)), axis=1
        )

    def _keeping(self, z: Array) -> float:
        """Stiffness with which the leg keeps its length from VLO state ``z`` (3,) [N/m]."""
        p = self.parameters
        load = p.mass * (p.gravity - z[0] ** 2 / p.rest_length)
        bent = max(p.rest_length - float(z[1]), 1e-6)
        return float(load / bent)

    def touchdowns(self, z: Array, angles: tuple[float, float]) -> list[Touchdown]:
        """Steps that may be made from a VLO.

        Args:
            z: (3,) state at VLO.
            angles: least and greatest touchdown angle [rad].
        """
        k, (least, most) = self._keeping(z), self.options.stiffness
        k0 = self.parameters.leg_stiffness
        tried = {min(max(share * k, least * k0), most * k0) for share in self.options.yielding}
        steps = [step for k in sorted(tried) for step in self._landings(z, k, angles)]
        # Where no step leaves the foot its time, the one that leaves it most has to do.
        return [s for s in steps if s.late >= 0.0] or sorted(steps, key=lambda s: -s.late)[:1]

    def _landings(self, z: Array, stiffness: float, angles: tuple[float, float]) -> list[Touchdown]:
        """Of all angles from one way past VLO: the foot lands when the CoM sinks to its leg."""
        p, (number, flattest) = self.parameters, self.options.angles
        top = float(np.arcsin(min(z[1] / p.rest_length, 1.0))) - 0.005
        tried = np.unique(np.clip(np.linspace(flattest, top, number), *angles))
        u = controls(max(float(tried[0]) - _FLATTER, _FLAT), stiffness, stiffness)
        stride = self._simulator.run(self._node, VLO.state(z), u)
        times = _sinking(stride, p.rest_length * np.sin(tried))
        landed = np.isfinite(times)
        states = stride.sample(times[landed]).reshape(-1, 3, 2).swapaxes(1, 2)
        shortest, longest = self.options.steps
        found = []
        for angle, time, state in zip(tried[landed], times[landed], states, strict=True):
            toe = float(state[0, 0] + p.rest_length * np.cos(angle))
            if shortest <= toe <= longest or len(tried) == 1:
                swift = toe / (self.options.swiftness * max(float(z[0]), 1e-6))
                least = float(np.clip(swift, *self.options.landing))
                late = float(time) - least
                found.append(Touchdown(float(angle), stiffness, state, (0.0, toe), late))
        return found

    def arriving(self, node: str, state: Array, u: Array, toes: Array) -> Stride:
        """The template's stride from a node on.

        Args:
            node: of the automaton.
            state: (4,) x, y, dx/dt, dy/dt of the CoM [m, m/s].
            u: (NUM_SLOTS,) controls.
            toes: (2,) x of the rear and the front foot [m].
        """
        return self._simulator.run(node, state, u, toes)


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
