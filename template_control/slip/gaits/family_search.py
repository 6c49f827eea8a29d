"""Search for the family of walking gaits by speed: continuation along stated lines.

The family is two chains of gaits at equally spaced speeds at VLO, each on one branch: slow gaits
with a long double stance, and faster ones with a short one. Where the rear leg just reaches its
rest length within double stance, it lifts off at once or much later: no branch leads across.

A chain begins as a rough line through a few gaits. It is smoothed, and each link is replaced by
the gait nearest to it, again and again, until it is a smooth line on the surface of symmetric
gaits.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.linalg import LinAlgError

from template_control.arrays import Array
from template_control.errors import GaitError
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.control.lqr import lqr
from template_control.slip.gaits.gait import (
    WalkingGait,
    gait_stride,
    vlo_jacobians,
    without_push_off,
)
from template_control.slip.gaits.walking_by_speed import Chain, coordinates, nearest_gait
from template_control.slip.similarity import REFERENCE

_SAMPLES = 60
_LEG = 1.06  # length of the robot's leg, from the CoM on, over l0: the knee is never straight
_STATE_COST = np.diag([10.0, 100.0, 10.0])  # of the planner, for l0 = 1 m
_CONTROL_COST = (5.0, 2.0, 2.0, 2.0)


class Figures(NamedTuple):
    """A gait's figures."""

    closed: float  # largest absolute eigenvalue of the walk under the LQR's four controls
    without: float  # the same with the three of the paper
    passive: float  # largest absolute eigenvalue of the passive map
    # Least singular value of the controls' Jacobian: where it vanishes, one direction of the state
    # is out of their reach.
    authority: float
    double_stance: float  # share of the step


def gait_figures(gait: WalkingGait) -> Figures:
    """Figures of a gait with push-off; a GaitError if no control holds it."""
    a, b = vlo_jacobians(gait)
    closed = _controlled(a, b)
    if not np.isfinite(closed):
        raise GaitError(f"no control holds {gait!r}: give another gait")
    return Figures(
        closed=closed,
        without=_controlled(*vlo_jacobians(without_push_off(gait))),
        passive=float(np.abs(np.linalg.eigvals(a)).max()),
        authority=float(np.linalg.svd(b)[1][2]),
        double_stance=stance_figures(gait)[1],
    )


def _controlled(a: Array, b: Array) -> float:
    """Largest absolute eigenvalue with the LQR, NaN where there is none."""
    costs = np.diag(_CONTROL_COST[: b.shape[1]])
    try:
        _, gain = lqr(a, b, _STATE_COST, costs)
    except (LinAlgError, ValueError):
        return np.nan
    return float(np.abs(np.linalg.eigvals(a - b @ gain)).max())


def stance_figures(gait: WalkingGait) -> tuple[float, float]:
    """Largest knee torque over m g l0, and the share of double stance, of a gait with push-off.

    A leg of two equal halves that pushes with F has the torque F times the knee's distance from the
    line of the push.
    """
    p = gait.parameters
    stride = gait_stride(gait)
    times = np.linspace(0.0, stride.duration, _SAMPLES)
    x, y = stride.sample(times)[:, :2].T
    row = stride.rows(times)
    torque = 0.0
    for toe, k in ((3, 5), (4, 6)):
        length = np.hypot(x - stride.meta[row, toe], y)
        force = stride.meta[row, k] * (p.rest_length - length)
        knee = 0.5 * np.sqrt(np.clip((_LEG * p.rest_length) ** 2 - length**2, 0.0, None))
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
_SPACING = 0.015  # of a chain's speeds at VLO [m/s]
_SETTLING = 12  # rounds of each smoothing
_SMOOTHING = 0.5, 0.05  # of a round of the first and the second one, in squared spacings


class Member(NamedTuple):
    """A gait of the chain, on the reference template and with push-off, and its figures."""

    gait: WalkingGait
    figures: Figures


def search_family(spacing: float = _SPACING, settling: int = _SETTLING) -> tuple[list[Member], ...]:
    """Family of walking gaits by speed: each chain's members, from the slowest to the fastest."""
    return tuple(_search(np.array(rough), spacing, settling) for rough in (_SLOW, _FAST))


def _search(rough: Array, spacing: float, settling: int) -> list[Member]:
    speeds, chain = _rough(rough, spacing)
    for amount in _SMOOTHING:
        for _ in range(settling):
            chain = _smoothed(_on_gaits(speeds, chain), amount)
    gaits = [nearest_gait(REFERENCE, v, x) for v, x in zip(speeds.tolist(), chain, strict=True)]
    return [Member(gait, gait_figures(gait)) for gait in gaits]


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


def family_data(chains: tuple[list[Member], ...]) -> dict[str, Any]:
    """The family as its file holds it."""
    return {
        "made by": "template-control gaits --family",
        "units": "l0, sqrt(l0 / g), m g; angles in rad",
        "chains": [
            {f.name: getattr(chain, f.name).tolist() for f in fields(chain)}
            for chain in map(chain_of, chains)
        ],
    }
