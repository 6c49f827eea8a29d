"""Search for the family of walking gaits by speed: continuation, and descent on a stated cost.

The family is two chains of gaits at equally spaced speeds at VLO, each on one branch: slow gaits
with a long double stance, and faster ones with a short one. Where the rear leg just reaches its
rest length within double stance, it lifts off at once or much later: no branch leads across.

A chain begins as a rough line through a few gaits. It is smoothed, and each link is replaced by
the gait nearest to it, again and again, until it is a smooth line on the surface of symmetric
gaits. Then, where rounds are asked for, stretches of it are moved, in stiffness or angle, where
that lowers the sum of the gaits' costs and of the chain's bends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.linalg import LinAlgError, solve_discrete_are

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import WalkingGait, vlo_jacobians, without_push_off
from template_control.slip.gaits.walking_by_speed import NATURAL, Chain, coordinates, nearest_gait
from template_control.slip.maps.section import VLO
from template_control.slip.similarity import REFERENCE

_SAMPLES = 60
_LITTLE = 0.02  # of a singular value
_STATE_COST = np.diag([10.0, 100.0, 10.0])  # of the planner, for l0 = 1 m
_CONTROL_COST = (5.0, 2.0, 2.0, 2.0)
_ERRORS = np.diag([0.05, 0.005, 0.05]) ** 2  # of dx/dt, y, dy/dt that a step may begin with


@dataclass(frozen=True)
class FamilyCost(Checked):
    """Weights of a family's cost; all gaits are those of the reference template.

    Attributes:
        control: of the LQR's mean cost-to-go with four controls, from errors of 0.05 m/s, 5 mm
            and 0.05 m/s.
        authority: over the least singular value of the four controls' Jacobian and 0.02: where
            that value vanishes, one direction of the state is out of their reach.
        torque: of the largest knee torque of a leg without mass, over m g l0.
        growth: of ln of the largest eigenvalue of the passive map, where that is above 1.
        step: of the squared ln of the step length over ``lengths``.
        speeds, lengths: mean speeds [m/s] and step lengths [m] that suit them, for l0 = 1 m:
            long steps need high torques, short ones a fast swing.
        shortest: a step takes at least so long [s], for l0 = 1 m: a swing leg needs the time.
        leg: length of the robot's leg, from the CoM on, over l0: the knee is never straight.
        bend: of the chain's squared second differences, in changes of ln k, alpha and y / l0
            that count alike.
    """

    control: NotNegative = 10.0
    authority: NotNegative = 0.02
    torque: NotNegative = 1.0
    growth: NotNegative = 0.15
    step: NotNegative = 8.0
    speeds: tuple[float, ...] = (0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.45)
    lengths: tuple[float, ...] = (0.28, 0.32, 0.42, 0.49, 0.52, 0.55, 0.57, 0.54)
    shortest: Positive = 0.33
    leg: Positive = 1.06
    bend: NotNegative = 2.0


class Figures(NamedTuple):
    """A gait's figures; those without unit are over m, g and l0.

    Attributes:
        closed: largest absolute eigenvalue of the walk under the LQR's four controls.
        without: the same with the three of the paper.
        passive: largest absolute eigenvalue of the passive map.
        authority: least singular value of the controls' Jacobian.
        torque: largest knee torque of a leg without mass, over m g l0.
        double_stance: share of the step.
        cost: by :func:`gait_figures`.
    """

    closed: float
    without: float
    passive: float
    authority: float
    torque: float
    double_stance: float
    cost: float


def gait_figures(gait: WalkingGait, weights: FamilyCost) -> Figures:
    """Figures and cost of a gait with push-off, on the reference template.

    A GaitError if no control holds it.
    """
    a, b = vlo_jacobians(gait)
    ahead, closed = _controlled(a, b)
    if not np.isfinite(closed):
        raise GaitError(f"no control holds {gait!r}: give another gait")
    passive = float(np.abs(np.linalg.eigvals(a)).max())
    authority = float(np.linalg.svd(b)[1][2])
    torque, double_stance = stance_figures(gait, weights.leg)
    suited = float(np.interp(gait.mean_speed, weights.speeds, weights.lengths))
    cost = (
        weights.control * float(np.trace(ahead @ _ERRORS))
        + weights.authority / (authority + _LITTLE)
        + weights.torque * torque
        + weights.growth * max(np.log(passive), 0.0)
        + weights.step * np.log(gait.step_length / suited) ** 2
    )
    without = _controlled(*vlo_jacobians(without_push_off(gait)))[1]
    return Figures(
        closed=closed,
        without=without,
        passive=passive,
        authority=authority,
        torque=torque,
        double_stance=double_stance,
        cost=float(cost),
    )


def _controlled(a: Array, b: Array) -> tuple[Array, float]:
    """Cost-to-go (3, 3) of the LQR and the largest absolute eigenvalue with it, NaN without one."""
    costs = np.diag(_CONTROL_COST[: b.shape[1]])
    try:
        ahead = np.asarray(solve_discrete_are(a, b, _STATE_COST, costs))
    except (LinAlgError, ValueError):
        return np.full((3, 3), np.nan), np.nan
    gain = np.linalg.solve(costs + b.T @ ahead @ b, b.T @ ahead @ a)
    return ahead, float(np.abs(np.linalg.eigvals(a - b @ gain)).max())


def stance_figures(gait: WalkingGait, leg: float = FamilyCost.leg) -> tuple[float, float]:
    """Largest knee torque over m g l0, and the share of double stance, of a gait with push-off.

    A leg of two equal halves that pushes with F has the torque F times the knee's distance from the
    line of the push. ``leg`` is the robot leg's length, from the CoM on, over l0.
    """
    p = gait.parameters
    stride = simulate_stride(p, STRIDE_START[gait.stride], VLO.state(gait.vlo), gait.controls)
    times = np.linspace(0.0, stride.duration, _SAMPLES)
    x, y = stride.sample(times)[:, :2].T
    row = stride.rows(times)
    torque = 0.0
    for toe, k in ((3, 5), (4, 6)):
        length = np.hypot(x - stride.meta[row, toe], y)
        force = stride.meta[row, k] * (p.rest_length - length)
        knee = 0.5 * np.sqrt(np.clip((leg * p.rest_length) ** 2 - length**2, 0.0, None))
        torque = max(torque, float(np.max(force * knee)))
    double = stride.time_of(Event.REAR_LIFTOFF) - stride.time_of(Event.TOUCHDOWN)
    return torque / (p.mass * p.gravity * p.rest_length), double / stride.duration


# Where the search begins: dx/dt at VLO [m/s], k [kN/m], alpha [deg] and y at VLO [m] of the
# reference template, near the cheapest paths through a scan of 16375 gaits.
_SLOW = (
    (0.13, 35.8, 76.75, 0.9782),
    (0.16, 35.0, 76.6, 0.9777),
    (0.22, 34.0, 76.5, 0.9768),
    (0.26, 31.0, 76.0, 0.9745),
    (0.30, 28.0, 75.65, 0.9725),
    (0.33, 27.6, 75.57, 0.9724),
    (0.375, 27.7, 75.56, 0.9731),
)
_FAST = (
    (0.30, 41.9, 75.4, 0.9793),
    (0.32, 40.9, 75.3, 0.9794),
    (0.38, 38.0, 74.7, 0.9785),
    (0.42, 36.0, 74.0, 0.9775),
    (0.45, 34.2, 73.65, 0.9771),
    (0.48, 31.2, 73.3, 0.9757),
    (0.51, 28.3, 72.9, 0.9735),
    (0.54, 25.6, 72.4, 0.9702),
    (0.57, 23.1, 71.85, 0.9667),
    (0.60, 21.1, 71.35, 0.9628),
    (0.63, 19.6, 71.0, 0.9602),
    (0.66, 18.9, 70.9, 0.9597),
    (0.72, 18.8, 70.44, 0.9621),
    (0.78, 19.2, 70.25, 0.9647),
    (0.90, 20.5, 70.7, 0.9687),
    (1.10, 21.3, 69.1, 0.980),
    (1.25, 26.5, 69.3, 0.992),
    (1.44, 42.0, 72.0, 0.9995),
)
_STRETCH = 6  # half-width of what is moved at a time, in links
_TOO_SHORT = 1e3
_MOVED = 0.4, 0.2  # of a gait in the first and in the last round of the descent, in natural changes
_SMOOTHING = 0.5  # of a round, in squared spacings of the chain
_MOVES = np.array([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)])


@dataclass(frozen=True)
class SearchEffort:
    """Parameters of the search for a chain.

    Attributes:
        spacing: of a chain's speeds at VLO [m/s].
        settling: rounds of smoothing, before the descent and after it.
        rounds: of the descent; each takes a minute or more.
    """

    spacing: float = 0.015
    settling: int = 12
    rounds: int = 0


class Member(NamedTuple):
    """A gait of the chain, on the reference template and with push-off, and its figures."""

    gait: WalkingGait
    figures: Figures


def search_family(
    weights: FamilyCost | None = None,
    effort: SearchEffort | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[Member], ...]:
    """Family of walking gaits by speed: each chain's members, from the slowest to the fastest.

    They are on the reference template. ``progress`` gets a line after each round of the descent. A
    GaitError if a chain leaves the surface of gaits.
    """
    w, o = weights or FamilyCost(), effort or SearchEffort()
    return tuple(_search(np.array(rough), w, o, progress) for rough in (_SLOW, _FAST))


def _search(
    rough: Array, w: FamilyCost, o: SearchEffort, progress: Callable[[str], None] | None
) -> list[Member]:
    speeds, chain = _rough(rough, o.spacing)
    for _ in range(o.settling):
        chain = _smoothed(_on_gaits(speeds, chain), _SMOOTHING)
    for number, move in enumerate(np.linspace(*_MOVED, o.rounds)):
        chain = _descended(speeds, _on_gaits(speeds, chain), float(move), w)
        if progress is not None:
            progress(f"{len(speeds)} gaits from {speeds[0]:.3g} m/s: round {number + 1} is done")
    for _ in range(o.settling):
        chain = _smoothed(_on_gaits(speeds, chain), 0.1 * _SMOOTHING)
    gaits = [nearest_gait(REFERENCE, v, x) for v, x in zip(speeds.tolist(), chain, strict=True)]
    return [Member(gait, gait_figures(gait, w)) for gait in gaits]


def _rough(rough: Array, spacing: float) -> tuple[Array, Array]:
    """Speeds (n,) [m/s] and coordinates (n, 3) of the chain that the search begins with."""
    p = REFERENCE
    weight = p.mass * p.gravity / p.rest_length
    knots = np.column_stack(
        (np.log(1e3 * rough[:, 1] / weight), np.radians(rough[:, 2]), rough[:, 3] / p.rest_length)
    )
    count = 1 + int(np.ceil((rough[-1, 0] - rough[0, 0]) / spacing))
    speeds = np.linspace(rough[0, 0], rough[-1, 0], count)
    return speeds, np.asarray(PchipInterpolator(rough[:, 0], knots)(speeds))


def _on_gaits(speeds: Array, chain: Array) -> Array:
    """The chain with each link replaced by the gait nearest to it, where there is one."""
    found = chain.copy()
    for i, speed in enumerate(speeds.tolist()):
        try:
            found[i] = coordinates(nearest_gait(REFERENCE, speed, chain[i]))
        except GaitError:
            continue  # its neighbours pull it back onto the surface
    return found


def _smoothed(chain: Array, amount: float) -> Array:
    """Whittaker's smoothing: nearest the chain with small second differences."""
    bends = np.diff(np.eye(len(chain)), 2, axis=0)
    return np.asarray(np.linalg.solve(np.eye(len(chain)) + amount * bends.T @ bends, chain))


def _descended(speeds: Array, chain: Array, move: float, weights: FamilyCost) -> Array:
    """The chain with stretches moved where that lowers the sum of costs and bends."""
    costs = np.array([_cost(v, x, weights) for v, x in zip(speeds.tolist(), chain, strict=True)])
    places = np.arange(len(chain))
    for centre in places[:: _STRETCH // 2]:
        bump = np.maximum(1.0 - (places - centre) ** 2 / _STRETCH**2, 0.0) ** 2
        stretch = np.flatnonzero(bump)
        for change in move * _MOVES * NATURAL:
            tried = chain.copy()
            tried[stretch] += bump[stretch, None] * change
            tried[stretch] = _on_gaits(speeds[stretch], tried[stretch])
            new = costs.copy()
            new[stretch] = [_cost(speeds[i], tried[i], weights) for i in stretch]
            gain = np.sum(costs - new) + weights.bend * (_bends(chain) - _bends(tried))
            if gain > 0.0:
                chain, costs = tried, new
                break
    return chain


def _cost(speed: float, x: Array, weights: FamilyCost) -> float:
    """Of the gait nearest ``x``; infinite where there is none or its step is too short."""
    try:
        gait = nearest_gait(REFERENCE, speed, x)
        figures = gait_figures(gait, weights)
    except GaitError:
        return np.inf
    return figures.cost if gait.step_duration >= weights.shortest else _TOO_SHORT


def _bends(chain: Array) -> float:
    """Sum of the squared second differences, in natural changes."""
    return float(np.sum((np.diff(chain, 2, axis=0) / NATURAL) ** 2))


def chain_of(members: list[Member]) -> Chain:
    """The members of a chain without dimension."""
    p, gaits = REFERENCE, [member.gait for member in members]
    unit = p.speed_unit
    stiffness, angle, height = np.array([coordinates(gait) for gait in gaits]).T
    return Chain(
        vlo_speed=np.array([gait.vlo[0] for gait in gaits]) / unit,
        stiffness=np.exp(stiffness),
        touchdown_angle=angle,
        height=height,
        mean_speed=np.array([gait.mean_speed for gait in gaits]) / unit,
    )


def family_data(chains: tuple[list[Member], ...], weights: FamilyCost) -> dict[str, Any]:
    """The family as its file holds it, with the weights of the cost that it was made with."""
    return {
        "made by": "template-control gaits --family",
        "units": "l0, sqrt(l0 / g), m g; angles in rad",
        "cost": asdict(weights),
        "chains": [
            {f.name: getattr(chain, f.name).tolist() for f in fields(chain)}
            for chain in map(chain_of, chains)
        ],
    }
