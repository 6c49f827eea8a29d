"""Compiled look-ahead on the exact VLO return map: what an LQR step is worth, and a better one.

A step is judged two steps ahead: after it comes the best of the (bounded) LQR law's step and a
few that brake or boost hard, and the state then reached is priced with the LQR's cost-to-go.
The search runs on the improved closed-form map, whose error is far below the robot's; what it
finds is priced on the exact one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.embedding.planners.walking.step_law import (
    Law,
    bounded,
    copy,
    cost_to_go,
    linear,
    step,
    strain,
)
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.maps.return_map import RESULTS

Array = NDArray[np.float64]

_ON_EXACT, _ON_FAST = np.bool_(True), np.bool_(False)  # Numba would compile once more for a literal
FALL_PRICE = 1e6
"""Price of a second step that fails; a first step that fails costs twice that."""


class Grid(NamedTuple):
    """The controls that :func:`search` tries.

    Attributes:
        coarse: (c,) numbers of points in each control of the first grid, over all bounds.
        fine: numbers of points in alpha and kappa_2 of the later grids, about the best found.
        rounds: number of later grids.
        width_alpha, width_kappa: half-widths of the first of these [rad, of k0].
        narrowing: half-widths of each grid over those of the one before.
    """

    coarse: NDArray[np.int64]
    fine: tuple[int, int]
    rounds: int
    width_alpha: float
    width_kappa: float
    narrowing: float


class Trust(NamedTuple):
    """When a linear law's own step is taken without a search.

    Attributes:
        price: its price on the exact map is below this.
        settled: cost-to-go up to which it may lead further away from the law's target.
    """

    price: float
    settled: float


@compiled
def price(
    law: Law, exact: bool, s: Scratch, z: Array, u: Array, limit: float, first: Array
) -> float:
    """Cost of taking ``u`` at ``z``.

    Args:
        law: says what a state costs.
        exact: see :func:`step`.
        s: overwritten.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) alpha [rad], stiffnesses/k0.
        limit: a cost known to be too much; the second step is not looked at beyond it.
        first: (3,) overwritten with the state after one step.
    """
    result, u2 = np.empty(RESULTS), np.empty(u.shape[0])
    if step(law, exact, s, z, u, result) != 0:
        return 2.0 * FALL_PRICE
    copy(result, first)
    here = cost_to_go(law.target, law.cost, first)
    share = law.first_weight * here + strain(law, z, u, result)
    for i in range(u.shape[0]):
        share += law.effort[i] * (u[i] - law.control[i]) ** 2
    if share >= limit:
        return share
    best = FALL_PRICE + here
    for i in range(-1, law.second_steps.shape[0]):
        if i < 0:
            linear(law, first, u2)
        else:
            # The law's own step is good enough near the gait.
            if best < law.enough:
                break
            copy(law.second_steps[i], u2)
            bounded(law, first, u2)
        if step(law, exact, s, first, u2, result) == 0:
            cost = cost_to_go(law.target, law.cost, result) + strain(law, first, u2, result)
            best = min(best, cost + share)
    return best


@compiled
def _coarse(grid: Grid, law: Law, i: int, u: Array) -> None:
    """Point ``i`` of the grid over all bounds into ``u`` (c,); the last control varies first."""
    for j in range(u.shape[0] - 1, -1, -1):
        count = grid.coarse[j]
        u[j] = (i % count + 0.5) / count
        u[j] = law.lower[j] + u[j] * (law.upper[j] - law.lower[j])
        i //= count


@compiled
def _fine(grid: Grid, centre: Array, widths: tuple[float, float], i: int, u: Array) -> None:
    """Point ``i`` of a grid about ``centre`` (c,) into ``u`` (c,).

    A plane of points in alpha and kappa_2, then two in kappa_1, and two in kappa_p.
    """
    n0, n2 = grid.fine
    copy(centre, u)
    if i < n0 * n2:
        u[0] += (i // n2 / (0.5 * (n0 - 1)) - 1.0) * widths[0]
        u[2] += (i % n2 / (0.5 * (n2 - 1)) - 1.0) * widths[1]
    else:
        beside = i - n0 * n2
        u[1 + beside // 2 * 2] += (2 * (beside % 2) - 1) * widths[1]


@compiled
def search(law: Law, grid: Grid, s: Scratch, z: Array, best: Array, first: Array) -> float:
    """Improve ``best`` (c,) in place: a coarse grid over all bounds, then finer ones about it.

    Far from the gait the good steps (hard braking, say, with a stiff leg before the virtual
    bottom and a soft one after) are not near what the linear law says.

    Args:
        law: what judges.
        grid: what to try.
        s: overwritten.
        z: (3,) VLO state.
        best: start of the search, and its result.
        first: (3,) overwritten with the state after the step.

    Returns:
        The price of ``best``.
    """
    controls = best.shape[0]
    u, end, centre = np.empty(controls), np.empty(3), np.empty(controls)
    cheapest = price(law, _ON_EXACT, s, z, best, np.inf, first)
    coarse, fine = 1, grid.fine[0] * grid.fine[1] + 2 * (controls - 2)
    for j in range(controls):
        coarse *= grid.coarse[j]
    widths = grid.width_alpha, grid.width_kappa
    for level in range(1 + grid.rounds):
        count = coarse if level == 0 else fine
        for i in range(count):
            if level == 0:
                _coarse(grid, law, i, u)
            else:
                _fine(grid, centre, widths, i, u)
            bounded(law, z, u)
            if price(law, _ON_FAST, s, z, u, cheapest, end) >= cheapest:
                continue
            cost = price(law, _ON_EXACT, s, z, u, cheapest, end)
            if cost < cheapest:
                cheapest = cost
                copy(u, best)
                copy(end, first)
        copy(best, centre)
        if level > 0:
            widths = grid.narrowing * widths[0], grid.narrowing * widths[1]
    return cheapest


@compiled
def choose(
    law: Law, grid: Grid, trust: Trust, s: Scratch, z: Array, u: Array, first: Array
) -> tuple[float, bool]:
    """The law's controls, or better ones where they cost too much.

    One function for both: compiled code of the maps is long, and each function that Python
    calls has one of its own.

    Args:
        law: says u, and what judges it.
        grid: what to try else.
        trust: when the law's own step is taken.
        s: overwritten.
        z: (3,) VLO state.
        u: (c,) overwritten with the controls: alpha [rad], stiffnesses/k0.
        first: (3,) overwritten with the state after the step.

    Returns:
        The price of ``u``; whether it is the law's.
    """
    linear(law, z, u)
    cost = price(law, _ON_EXACT, s, z, u, np.inf, first)
    trusted = cost < trust.price
    left = cost_to_go(law.target, law.cost, first)
    if trusted and left <= max(cost_to_go(law.target, law.cost, z), trust.settled):
        return cost, True
    other, end = np.empty(u.shape[0]), np.empty(3)
    copy(u, other)
    found = search(law, grid, s, z, other, end)
    if trusted and (cost <= found or left <= cost_to_go(law.target, law.cost, end)):
        # What is found must come nearer, and not only be cheaper in the end.
        return cost, True
    copy(other, u)
    copy(end, first)
    return found, False
