"""Walking gaits: period-one fixed points of the VLO return map, symmetric in time.

On a slope, what the climb takes, the legs give in double stance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise
from typing import Annotated, Generic, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Positive, Shape, Triple, Vector
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import (
    NUM_SLOTS,
    Outcome,
    Phase,
    Slot,
    StrideKind,
    WalkingStride,
)
from template_control.slip.control.lqr import least_change
from template_control.slip.dynamics.stride import Stride, controls, simulate_stride
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO, section_of
from template_control.slip.parameters import SlipParameters, Slope

WALKING_SLOTS: dict[str, tuple[Slot, ...]] = {
    StrideKind.WALK: (Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD),
    StrideKind.WALK_PUSH_OFF: (Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD, Slot.K_PUSH),
}
"""Controls of each kind of walking step: alpha, kappa_1, kappa_2 and, with push-off, kappa_p."""

SPEEDS = np.linspace(0.2, 0.45, 26)
"""Speeds at VLO where gaits of one stiffness are looked for, over sqrt(g l0)."""
_ANGLES = np.arange(60.0, 77.5, 0.5).tolist()  # [deg] the same
_SCAN = 120
_CLIMBS, _RISES = 1, 2  # of a VLO state: y, dy/dt


@dataclass(frozen=True)
class Gait(Checked):
    """A stride that returns to its state: what planners settle on, whatever its kind.

    Attributes:
        name: for tables and records.
        parameters: the template.
        state: (n,) at its section: dx/dt, y and, at VLO, dy/dt [m/s, m, m/s].
        controls: (NUM_SLOTS,) touchdown angle [rad] and stiffnesses [N/m] by Slot.
        step_length: distance covered [m].
        step_duration: of the stride [s].
        stride: its kind, a key of an automaton's ``starts``.
    """

    name: str
    parameters: SlipParameters
    state: Vector
    controls: Annotated[Array, Shape((NUM_SLOTS,))]
    step_length: float
    step_duration: Positive
    stride: str

    @property
    def mean_speed(self) -> float:
        """Step length over step duration [m/s]."""
        return self.step_length / self.step_duration


@dataclass(frozen=True)
class WalkingGait(Gait):
    """A passive symmetric walking gait.

    Attributes:
        state: (3,) dx/dt, y, dy/dt at VLO; dy/dt is 0 [m/s, m, m/s].
        stride: kind of its steps, from VLO to VLO: "w" as in the paper, "wp" with push-off.
    """

    state: Triple
    stride: WalkingStride = StrideKind.WALK

    def __repr__(self) -> str:
        angle = np.degrees(self.controls[Slot.TOUCHDOWN_ANGLE])
        return (
            f"<WalkingGait {self.name}: {self.mean_speed:.3f} m/s, touchdown angle {angle:.2f} deg,"
            f" at VLO {self.vlo[0]:.3f} m/s and {self.vlo[1]:.4f} m>"
        )

    @property
    def vlo(self) -> Array:
        """(3,) :attr:`state`."""
        return self.state

    @property
    def energy(self) -> float:
        """Mechanical energy at VLO, the stance spring's included [J]."""
        return float(VLO.energy(self.parameters, self.vlo))


def with_push_off(gait: WalkingGait) -> WalkingGait:
    """The same gait in steps whose rear leg has a stiffness of its own in double stance.

    In a passive gait that is k0, as every other leg's: the motion is the same.
    """
    return _pushing(gait, StrideKind.WALK_PUSH_OFF, gait.controls[Slot.K_SC])


def without_push_off(gait: WalkingGait) -> WalkingGait:
    """The same gait in the steps of the paper; itself, if it is in these."""
    pushes = gait.stride == StrideKind.WALK_PUSH_OFF
    return _pushing(gait, StrideKind.WALK, 0.0) if pushes else gait


def _pushing(gait: WalkingGait, stride: WalkingStride, stiffness: float) -> WalkingGait:
    u = gait.controls.copy()
    u[Slot.K_PUSH] = stiffness
    return replace(gait, controls=u, stride=stride)


def _kind(gait: Gait) -> str:
    return gait.stride if gait.stride in WALKING_SLOTS else StrideKind.WALK


def control_units(gait: Gait) -> tuple[list[int], Array]:
    """Slots (c,) of a walking step's controls, and their units (c,): 1 rad, k0 for stiffnesses."""
    slots = [int(slot) for slot in WALKING_SLOTS[_kind(gait)]]
    return slots, np.array([1.0, *[gait.parameters.leg_stiffness] * (len(slots) - 1)])


def vlo_jacobians(gait: Gait) -> tuple[Array, Array]:
    """Jacobians of the exact VLO map at a gait: A (3, 3) in z, B (3, c) in control units."""
    linear = ReturnMap(gait.parameters, _kind(gait)).linearise(gait.state, gait.controls)
    slots, units = control_units(gait)
    return linear.state_jacobian, linear.control_jacobian[:, slots] * units


def uncontrolled(gait: Gait) -> Array:
    """(3,) n with n B = 0 for the control Jacobian B of :func:`vlo_jacobians`, n[0] = 1.

    n (z - P(z, u)) is a step's drift, as a forward speed [m/s].
    """
    direction = np.linalg.svd(vlo_jacobians(gait)[1])[0][:, -1]
    return np.asarray(direction / direction[0])


def _gait(parameters: SlipParameters, z: Array, u: Array, name: str = "walk") -> WalkingGait:
    stride = simulate_stride(parameters, STRIDE_START[StrideKind.WALK], VLO.state(z), u)
    return WalkingGait(name, parameters, z, u, float(stride.state[0]), stride.duration)


def roots(function: Callable[[float], float], grid: Array, **tolerances: float) -> Iterator[float]:
    """Zeros of a function on a grid, in its order: one between neighbours of different signs.

    None where the function is NaN at one of the two, or somewhere between. ``tolerances`` are those
    of :func:`scipy.optimize.brentq`.
    """
    values = map(function, grid.tolist())
    for ends, (first, last) in zip(pairwise(grid.tolist()), pairwise(values), strict=True):
        if first * last <= 0.0:
            try:
                zero = brentq(function, *sorted(ends), **tolerances)
            except ValueError:
                continue
            yield float(zero)


def _symmetric_roots(
    parameters: SlipParameters,
    make: Callable[[float], tuple[Array, Array]],
    values: Array,
) -> list[tuple[Array, Array]]:
    """All (z, u) = make(value) on the grid ``values`` that return to themselves.

    dy/dt at the next VLO is zero for a symmetric gait, and for strides that only return to a level
    flight. Where one of these is next to the gait, both roots may lie between two values of the
    grid, and there is no change of sign. The height then decides: it returns for the gait only.
    """
    step = ReturnMap(parameters)

    @cache
    def change(value: float) -> Array:
        """Of z in a step; NaN where there is no next VLO."""
        z, u = make(value)
        z_next, outcome = step.step(z, u)
        return z_next - z if outcome is Outcome.SECTION else np.full_like(z, np.nan)

    def miss(which: int, value: float) -> float:
        return float(change(value)[which])

    for which in (_RISES, _CLIMBS):
        zeros = roots(partial(miss, which), values, xtol=1e-14, rtol=1e-14)
        # A vertical speed that returns to zero need not be the symmetric step.
        found = [make(value) for value in zeros if np.max(np.abs(change(value))) < 1e-6]
        if found:
            return found
    return []


@checked
def gait_at(parameters: SlipParameters, touchdown_angle: float, vlo_speed: float) -> WalkingGait:
    """The symmetric gait with a given touchdown angle and speed at VLO.

    Args:
        parameters: the template; both legs have its stiffness k0.
        touchdown_angle: alpha, from the ground to the leg [rad].
        vlo_speed: dx/dt at VLO [m/s].

    Raises:
        GaitError: if there is none.
    """
    gait = find_gait_at(parameters, touchdown_angle, vlo_speed)
    if gait is None:
        raise GaitError(
            f"no walking gait with touchdown angle {np.degrees(touchdown_angle):.2f} deg"
            f" and {vlo_speed:g} m/s at VLO: {_nearest(parameters, touchdown_angle, vlo_speed)}"
        )
    return gait


def find_gait_at(
    parameters: SlipParameters, touchdown_angle: float, vlo_speed: float
) -> WalkingGait | None:
    """Gait of :func:`gait_at`, or None if there is none."""
    k0, l0 = parameters.leg_stiffness, parameters.rest_length
    u = controls(touchdown_angle, k0, k0)
    heights = np.linspace(l0 * np.sin(touchdown_angle) + 1e-5 * l0, l0 * (1 - 1e-5), _SCAN)
    roots = _symmetric_roots(parameters, lambda y: (np.array([vlo_speed, y, 0.0]), u), heights)
    return _gait(parameters, *roots[0]) if roots else None


def _nearest(parameters: SlipParameters, touchdown_angle: float, vlo_speed: float) -> str:
    """Advice where :func:`gait_at` finds no gait, itself tried.

    Angles and speeds that have gaits fill no rectangle, so no two windows describe them.
    """
    wanted = np.degrees(touchdown_angle)
    for angle in sorted(_ANGLES, key=lambda angle: abs(angle - wanted)):
        if find_gait_at(parameters, np.radians(angle), vlo_speed):
            return f"at this speed the nearest angle is {angle:g} deg"
    speeds = (float(f"{parameters.speed_unit * speed:.3g}") for speed in SPEEDS.tolist())
    for speed in sorted(speeds, key=lambda speed: abs(speed - vlo_speed)):
        if find_gait_at(parameters, touchdown_angle, speed):
            return f"at this angle the nearest speed is {speed:g} m/s"
    return "give another angle and another speed"


@checked
def gait_from_energy(parameters: SlipParameters, height: float, energy: float) -> WalkingGait:
    """The symmetric gait with a given VLO height and energy, as in Section IV-D.

    Args:
        parameters: the template; both legs have its stiffness k0.
        height: y at VLO [m].
        energy: mechanical energy at VLO, the stance spring's included [J].

    Raises:
        GaitError: if there is none.
    """
    p = parameters
    speed = float(VLO.speed(p, height, energy))
    top = np.arcsin(min(height / p.rest_length, 1.0))
    if not speed > 0.0:
        raise GaitError(f"energy {energy:g} J leaves no speed at a VLO height of {height:g} m")
    z = np.array([speed, height, 0.0])
    k0 = p.leg_stiffness
    roots = _symmetric_roots(
        parameters, lambda a: (z, controls(a, k0, k0)), np.linspace(0.9, top - 1e-4, _SCAN)
    )
    if not roots:
        raise GaitError(f"no walking gait with VLO height {height:g} m and energy {energy:g} J")
    return _gait(parameters, *roots[-1], name="paper")


_ROUNDS = 12
_DONE = 1e-9
_DIFFERENCE = 1e-4  # of g, to differentiate by the assist
# Weights of squared changes: y over l0, dy/dt over sqrt(g l0), the angle [rad], stiffnesses over
# k0. The assist may be what it must.
_HEIGHT, _RISE, _ANGLE, _STIFFNESS, _ASSIST = 4e4, 1e4, 1e3, 1e2, 1e-4


@checked
def on_slope(gait: WalkingGait, slope: Slope) -> WalkingGait:
    """The gait with the same speed at VLO on a slope, and as near to a gait as there is.

    The template's axes are turned with the ground. In single stance gravity's part along the ground
    acts; in double stance the assist (:class:`~template_control.slip.parameters.SlipParameters`)
    gives back what that takes in a step. So the motion stays nearly that on level ground. Of
    all fixed points the one with the least change of state and controls is taken.

    Args:
        gait: on level ground.
        slope: angle of the ground, uphill positive [rad].

    Raises:
        GaitError: if there is none.
    """
    p = gait.parameters
    if slope == p.slope:
        return gait
    slots, units = control_units(gait)
    state = _HEIGHT / p.rest_length**2, _RISE / p.speed_unit**2
    free = _ANGLE, *[_STIFFNESS] * (len(slots) - 1), _ASSIST / p.gravity**2
    weights = np.array([*state, *free])
    wanted = np.concatenate((gait.vlo[1:], gait.controls[slots] / units, [p.assist]))
    change = _DIFFERENCE * p.gravity

    def unpacked(x: Array) -> tuple[Array, Array, SlipParameters]:
        """VLO state, controls by Slot and template of the unknowns."""
        u = gait.controls.copy()
        u[slots] = x[2:-1] * units
        return np.array([gait.vlo[0], *x[:2]]), u, replace(p, slope=slope, assist=float(x[-1]))

    x = wanted.copy()
    for _ in range(_ROUNDS):
        z, u, own = unpacked(x)
        here = ReturnMap(own, gait.stride).linearise(z, u)
        pushed = replace(own, assist=own.assist + change)
        there, outcome = ReturnMap(pushed, gait.stride).step(z, u)
        if not here.outcome == outcome == Outcome.SECTION:
            break
        by_state = (here.state_jacobian - np.eye(3))[:, 1:]
        by_controls = here.control_jacobian[:, slots] * units
        by_assist = (there - here.state)[:, None] / change
        slopes = np.hstack((by_state, by_controls, by_assist))
        step = least_change(weights, slopes, weights * (wanted - x), z - here.state)
        x += step
        if np.max(np.abs(step)) < _DONE:
            z, u, own = unpacked(x)
            found = replace(gait, parameters=own, state=z, controls=u)
            end = gait_stride(found)
            return replace(found, step_length=float(end.state[0]), step_duration=end.duration)
    raise GaitError(
        f"no walking gait with {gait.vlo[0]:.3g} m/s at VLO on a slope of"
        f" {np.degrees(slope):.3g} deg: take a gentler slope"
    )


def gait_stride(gait: Gait, automaton: Automaton = AUTOMATON) -> Stride:
    """The stride of a gait, from its section on; ``automaton`` is that of its kind."""
    start = automaton.start(gait.stride).name
    state = section_of(automaton.sections(start)[0]).state(gait.state)
    return simulate_stride(gait.parameters, start, state, gait.controls, automaton=automaton)


def flight_share(gait: Gait, automaton: Automaton = AUTOMATON) -> float:
    """Share of a gait's stride in which no foot is on the ground."""
    stride = gait_stride(gait, automaton)
    flies = [node.phase is Phase.F for node in automaton.nodes]
    return float(sum(row[1] for row in stride.meta if flies[int(row[2])]) / stride.duration)


G = TypeVar("G", bound=Gait)
_SAME = 1e-9  # of sqrt(g l0): speeds that are one


class GaitsBySpeed(NamedTuple):
    """Gaits by their speed at the section, and the slowest and the fastest speed [m/s]."""

    gait: Callable[[float], Gait]
    speeds: tuple[float, float]

    def nearest(self, speed: float) -> Gait:
        """The gait whose speed is nearest to another one [m/s]."""
        slowest, fastest = self.speeds
        return self.gait(min(max(speed, slowest), fastest))


class GaitFamily(Generic[G]):
    """The gaits that a planner's targets stand for: its own, and others with their speeds.

    ``others`` has those, of its own class, that a gait may give way to.
    """

    def __init__(self, gait: G, others: Callable[[G], GaitsBySpeed]) -> None:
        self._known, self._others = [gait], others

    def reset(self) -> G:
        """Forget all gaits but the planner's own, which is returned."""
        del self._known[1:]
        return self._known[0]

    def towards(self, present: G, target: ArrayLike | None) -> tuple[G, bool]:
        """The gait with the speed of a target (n,), or the nearest; and whether it has that speed.

        The ``present`` one is kept where it has it, or where there is no target.
        """
        if target is None:
            return present, True
        same, wanted = _SAME * present.parameters.speed_unit, float(np.asarray(target)[0])
        for gait in (present, *self._known):
            if abs(gait.state[0] - wanted) <= same:
                return gait, True
        gait = cast(G, self._others(present).nearest(wanted))
        self._known.append(gait)
        return gait, bool(abs(gait.state[0] - wanted) <= same)
