"""Walking gaits by speed: the library's dimensionless family, and that of the paper's steps."""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from importlib.resources import files
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Angle
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Outcome, Slot, StrideKind
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.gait import (
    SPEEDS,
    GaitsBySpeed,
    WalkingGait,
    find_gait_at,
    gait_at,
    roots,
    with_push_off,
)
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

_HEIGHT, _RISE = 1, 2  # places in a VLO state
NATURAL = np.array([0.1, 0.02, 0.005])
"""Changes of ln k, alpha [rad] and y / l0 that count alike: what "nearest" means."""

_STEPS = 40
_REACH = 0.5  # of a natural change: a longer step may end on another branch
_DONE = 1e-13  # of a natural change
_SINGULAR = 1e-6  # one of both misses may say nothing that the other does not
_RETURNED = 1e-9  # of the units of the state


def nearest_gait(parameters: SlipParameters, vlo_speed: float, guess: Array) -> WalkingGait:
    """The gait with a speed at VLO [m/s] that is nearest a guess, in steps with push-off.

    At the next VLO of a symmetric gait dy/dt is zero and the height the same. Of all changes of the
    guess (3,), :func:`coordinates`, that make it so, the least is taken. So it does not mind where
    gaits of one stiffness and angle turn back, or where other strides cross them.
    """
    p, step = parameters, ReturnMap(parameters)
    unit, weight = p.speed_unit, p.mass * p.gravity / p.rest_length
    x = np.array(guess, dtype=float)
    for _ in range(_STEPS):
        z, u = _stride(x, vlo_speed, weight, p.rest_length)
        end = step.linearise(z, u)
        if end.outcome is not Outcome.SECTION:
            break
        by_controls = end.control_jacobian[[_RISE, _HEIGHT]]
        by_stiffness = u[Slot.K_SC] * by_controls[:, [Slot.K_SC, Slot.K_SD]].sum(axis=1)
        by_height = end.state_jacobian[[_RISE, _HEIGHT], _HEIGHT] * p.rest_length
        by_height[1] -= p.rest_length
        slope = np.column_stack((by_stiffness, by_controls[:, Slot.TOUCHDOWN_ANGLE], by_height))
        units = np.array([unit, p.rest_length])
        misses = np.array([end.state[_RISE], end.state[_HEIGHT] - z[_HEIGHT]]) / units
        scaled = slope / units[:, None] * NATURAL
        if not np.all(np.isfinite(scaled)):
            break
        change = -np.linalg.lstsq(scaled, misses, rcond=_SINGULAR)[0]
        size = float(np.max(np.abs(change)))
        x += NATURAL * change * min(1.0, _REACH / max(size, _DONE))
        if size < _DONE:
            break
    z, u = _stride(x, vlo_speed, weight, p.rest_length)
    stride = simulate_stride(p, STRIDE_START[StrideKind.WALK], VLO.state(z), u)
    missed = np.abs(VLO.of(stride.state) - z) / [unit, p.rest_length, unit]
    if not stride.completed or np.max(missed) > _RETURNED:
        raise GaitError(
            f"no symmetric gait with {vlo_speed:g} m/s at VLO near"
            f" {np.degrees(guess[1]):.4g} deg at touchdown: give another guess"
        )
    own = replace(p, leg_stiffness=float(u[Slot.K_SC]))
    gait = WalkingGait("walk", own, z, u, float(stride.state[0]), stride.duration)
    return with_push_off(gait)


def coordinates(gait: WalkingGait) -> Array:
    """(3,) ln of k l0 / (m g), alpha [rad] and y / l0 of a gait."""
    p = gait.parameters
    weight = p.mass * p.gravity / p.rest_length
    angle = float(gait.controls[Slot.TOUCHDOWN_ANGLE])
    return np.array([np.log(p.leg_stiffness / weight), angle, gait.vlo[1] / p.rest_length])


def _stride(x: Array, vlo_speed: float, weight: float, length: float) -> tuple[Array, Array]:
    """State and controls at coordinates ``x``; ``weight`` is m g / l0 [N/m]."""
    k = float(np.exp(x[0])) * weight
    return np.array([vlo_speed, x[2] * length, 0.0]), controls(float(x[1]), k, k)


_XTOL = 1e-10  # of speeds
_ROUNDING = 1e-6  # of a centimetre per second


@dataclass(frozen=True, eq=False)
class Chain:
    """Gaits at n knots; between them is the gait nearest the monotone (PCHIP) interpolation."""

    vlo_speed: Array  # dx/dt at VLO over sqrt(g l0), rising
    stiffness: Array  # k l0 / (m g)
    touchdown_angle: Array  # alpha [rad]
    height: Array  # y at VLO over l0
    mean_speed: Array  # of the whole step over sqrt(g l0), rising

    @cached_property
    def _curve(self) -> PchipInterpolator:
        columns = (np.log(self.stiffness), self.touchdown_angle, self.height)
        return PchipInterpolator(self.vlo_speed, np.column_stack(columns))

    @cached_property
    def vlo_by_mean_speed(self) -> PchipInterpolator:
        """Speed and height at VLO by the mean speed, all without dimension."""
        return PchipInterpolator(
            self.mean_speed, np.column_stack((self.vlo_speed, self.height)), extrapolate=False
        )

    def gait(self, parameters: SlipParameters, vlo_speed: float) -> WalkingGait:
        """The gait with a speed at VLO [m/s]; beyond the chain that nearest to its end."""
        speed = np.clip(vlo_speed / parameters.speed_unit, self.vlo_speed[0], self.vlo_speed[-1])
        return nearest_gait(parameters, vlo_speed, self._curve(speed))

    def gait_for(self, parameters: SlipParameters, mean_speed: float) -> WalkingGait:
        """The gait with a mean speed [m/s] between those of two knots; see :meth:`gait`."""
        p, unit = parameters, parameters.speed_unit
        wanted = mean_speed / unit
        knot = int(np.clip(np.searchsorted(self.mean_speed, wanted) - 1, 0, len(self.height) - 2))
        ends = self.vlo_speed[knot : knot + 2]

        def surplus(speed: float) -> float:
            return self.gait(p, speed * unit).mean_speed / unit - wanted

        found = next(roots(surplus, ends, xtol=_XTOL), None)
        if found is None:  # at a knot, to rounding
            found = min(ends.tolist(), key=lambda end: abs(surplus(end)))
        return self.gait(p, found * unit)


@dataclass(frozen=True)
class SpeedFamily:
    """A walking gait for every mean speed of a range.

    Attributes:
        chains: from slow to fast; where two overlap, the slower one ends in the middle.
    """

    chains: tuple[Chain, ...]

    @cached_property
    def limits(self) -> Array:
        """(chains + 1,) mean speeds over sqrt(g l0) at which the chains begin and end."""
        return _limits([chain.mean_speed for chain in self.chains])

    def vlo_limits(self, parameters: SlipParameters) -> Array:
        """(chains + 1,) dx/dt at VLO at which the chains of a template begin and end [m/s]."""
        return _limits([chain.vlo_speed * parameters.speed_unit for chain in self.chains])

    def range(self, parameters: SlipParameters) -> tuple[float, float]:
        """Slowest and fastest mean speed of a template [m/s], to a centimetre per second."""
        low, high = 100.0 * parameters.speed_unit * self.limits[[0, -1]]
        return float(np.ceil(low - _ROUNDING)) / 100.0, float(np.floor(high + _ROUNDING)) / 100.0

    def gait_for(self, parameters: SlipParameters, mean_speed: float) -> WalkingGait:
        """The gait with a mean speed.

        Args:
            parameters: the template; its stiffness k0 counts for nothing, the gait has its own.
            mean_speed: step length over step duration [m/s].

        Raises:
            GaitError: naming the range, if the speed is out of it.
        """
        slowest, fastest = self.range(parameters)
        if not slowest <= mean_speed <= fastest:
            raise GaitError(
                f"no walking gait at a mean speed of {mean_speed:g} m/s: give one from"
                f" {slowest:.2f} to {fastest:.2f} m/s"
            )
        return self._chain(parameters, mean_speed).gait_for(parameters, mean_speed)

    def vlo_for(self, parameters: SlipParameters, mean_speed: float) -> tuple[float, float]:
        """As :meth:`gait_for`, but its dx/dt [m/s] and y [m] at VLO, interpolated.

        Beyond the range its end counts.
        """
        chain, unit = self._chain(parameters, mean_speed), parameters.speed_unit
        known, by_speed = chain.mean_speed, chain.vlo_by_mean_speed
        speed, height = by_speed(np.clip(mean_speed / unit, known[0], known[-1])).tolist()
        return speed * unit, height * parameters.rest_length

    def _chain(self, parameters: SlipParameters, mean_speed: float) -> Chain:
        inner = self.limits[1:-1]
        return self.chains[int(np.searchsorted(inner, mean_speed / parameters.speed_unit))]


def _limits(lines: Sequence[Array]) -> Array:
    """(n + 1,) ends of n rising lines; where two overlap, the middle of what both have."""
    middles = [0.5 * (a[-1] + b[0]) for a, b in pairwise(lines)]
    return np.array([lines[0][0], *middles, lines[-1][-1]])


@cache
def walking_by_speed() -> SpeedFamily:
    """The library's family, as ``template-control gaits --family`` made it."""
    data = json.loads(files(__package__).joinpath("walking.json").read_text(encoding="utf-8"))
    chains = ({name: np.array(v) for name, v in chain.items()} for chain in data["chains"])
    return SpeedFamily(tuple(Chain(**chain) for chain in chains))


_SPEEDS = (0.195, 0.225, 0.29, 0.35, 0.395)  # at VLO, over sqrt(g l0)
_ANGLES = (70.0, 69.5, 68.0, 66.0, 66.0)  # [deg]


def speed_range(parameters: SlipParameters) -> tuple[float, float]:
    """Slowest and fastest dx/dt at VLO of the family [m/s]."""
    unit = parameters.speed_unit
    return float(_SPEEDS[0] * unit), float(_SPEEDS[-1] * unit)


@checked
def walking_gait(parameters: SlipParameters, vlo_speed: float) -> WalkingGait:
    """The family's gait with this speed at VLO.

    The touchdown angle falls with the speed, along a line inside the region of angles and
    speeds at VLO in which symmetric gaits of the default stiffness exist.

    Args:
        parameters: the template, with k0 l0 / (m g) of the reference template.
        vlo_speed: dx/dt at VLO [m/s].

    Raises:
        GaitError: naming the range, if the speed is out of it.
    """
    low, high = speed_range(parameters)
    if not low <= vlo_speed <= high:
        raise GaitError(
            f"no walking gait has {vlo_speed:g} m/s at VLO: give a speed from {low:.3g} to"
            f" {high:.3g} m/s"
        )
    unit = parameters.speed_unit
    angle = np.radians(np.interp(vlo_speed / unit, _SPEEDS, _ANGLES))
    return gait_at(parameters, float(angle), vlo_speed)


def gaits_by_speed(parameters: SlipParameters) -> GaitsBySpeed:
    """The gaits of the library's family by their speed at VLO, with push-off.

    Where two chains have a gait of a speed, it is the slower chain's up to the middle.

    Args:
        parameters: the template; its stiffness k0 counts for nothing, each gait has its own.
    """
    family = walking_by_speed()
    slowest, *between, fastest = family.vlo_limits(parameters).tolist()

    def gait(speed: float) -> WalkingGait:
        return family.chains[bisect_left(between, speed)].gait(parameters, speed)

    return GaitsBySpeed(gait, (slowest, fastest))


def paper_walks(parameters: SlipParameters) -> GaitsBySpeed:
    """The gaits of :func:`walking_gait`."""
    return GaitsBySpeed(partial(walking_gait, parameters), speed_range(parameters))


def other_walks(gait: WalkingGait) -> GaitsBySpeed:
    """Walks that a gait may give way to: with push-off those of the library's family."""
    family = paper_walks if gait.stride == StrideKind.WALK else gaits_by_speed
    return family(gait.parameters)


@checked
def gait_for_speed(
    parameters: SlipParameters, mean_speed: float, touchdown_angle: Angle | None = None
) -> WalkingGait:
    """The symmetric gait with a given mean forward speed.

    Without an angle it is that of the library's family by speed, in steps with push-off: its
    stiffness varies with the speed, and is that of its own ``parameters``. With an angle both legs
    keep the template's stiffness k0, and the steps are the paper's.

    Args:
        parameters: the template.
        mean_speed: step length over step duration [m/s].
        touchdown_angle: alpha, from the ground to the leg [rad]; None: the family's.

    Raises:
        GaitError: naming the range, if there is none, or the speed is not positive.
    """
    p = parameters
    if not (np.isfinite(mean_speed) and mean_speed > 0.0):
        raise GaitError(f"speed is {mean_speed!r} m/s: give a positive number")
    if touchdown_angle is None:
        return walking_by_speed().gait_for(p, mean_speed)
    angle = touchdown_angle

    @cache
    def mean(vlo_speed: float) -> float:
        """Mean speed of the gait with a speed at VLO; NaN if there is none."""
        gait = find_gait_at(p, angle, vlo_speed)
        return np.nan if gait is None else gait.mean_speed

    speeds = p.speed_unit * SPEEDS
    found = next(roots(lambda speed: mean(speed) - mean_speed, speeds, xtol=_XTOL), None)
    if found is not None:
        return gait_at(p, angle, found)
    hint = "give another angle, or none"
    known = [value for speed in speeds.tolist() if np.isfinite(value := mean(speed))]
    if known:
        low, high = np.ceil(100.0 * known[0]) / 100.0, np.floor(100.0 * known[-1]) / 100.0
        if not low <= mean_speed <= high:
            hint = f"give one from {low:.2f} to {high:.2f} m/s"
    at = f" and {np.degrees(angle):g} deg at touchdown"
    raise GaitError(f"no walking gait at a mean speed of {mean_speed:g} m/s{at}: {hint}")
