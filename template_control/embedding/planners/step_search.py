"""Compiled look-ahead on the exact VLO return map: what an LQR step is worth, and a better one.

A step is judged two steps ahead: after it comes the best of the (bounded) LQR law's step and a
few that brake or boost hard, and the state then reached is priced with the LQR's cost-to-go.
The search runs on the improved closed-form map, whose error is far below the robot's; what it
finds is priced on the exact one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from template_control.slip.automaton.tables import Tables
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.dynamics.kernel import Model, Scratch
from template_control.slip.maps.section_map import RESULTS, section_map

Array = NDArray[np.float64]

# Numba would compile the maps once more for each literal int.
_EXACT, _FAST = np.int64(MapKind.EXACT), np.int64(MapKind.IMPROVED)
FALL_PRICE = 1e6
"""Price of a second step that fails; a first step that fails costs twice that."""


class Law(NamedTuple):
    """A bounded linear law u = u_s - K (z - z_s) and what it needs to be judged.

    Attributes:
        target: (3,) z_s, dx/dt, y, dy/dt.
        control: (3,) u_s: alpha [rad], kappa_1/k0, kappa_2/k0.
        gain: (3, 3) K.
        cost: (3, 3) cost-to-go about ``target``.
        offset: (3,) what the robot adds to the template's next VLO state.
        lower, upper: (3,) bounds of u.
        second_steps: (n, 3) other controls than u_s - K (z - z_s) for the second step.
        enough: a cost below which no other second step is tried.
        top_margin: alpha stays this far [rad] below asin(y / l0).
        stiffness: k0 [N/m].
        model: the template.
    """

    target: Array
    control: Array
    gain: Array
    cost: Array
    offset: Array
    lower: Array
    upper: Array
    second_steps: Array
    enough: float
    top_margin: float
    stiffness: float
    model: Model


@njit(cache=True)
def bounded(law: Law, z: Array, u: Array) -> None:
    """Clip controls ``u`` (3,) in place to what is admissible at VLO state ``z`` (3,)."""
    for i in range(3):
        u[i] = min(max(u[i], law.lower[i]), law.upper[i])
    top = np.arcsin(min(z[1] / law.model.rest_length, 1.0)) - law.top_margin
    u[0] = min(u[0], top)


@njit(cache=True)
def linear(law: Law, z: Array, u: Array) -> None:
    """The law's bounded controls at ``z`` into ``u``."""
    for i in range(3):
        u[i] = law.control[i]
        for j in range(3):
            u[i] -= law.gain[i, j] * (z[j] - law.target[j])
    bounded(law, z, u)


@njit(cache=True)
def step(
    tables: Tables, node: int, kind: int, law: Law, s: Scratch, z: Array, u: Array, z_next: Array
) -> int:
    """One step from ``z`` with controls ``u``, the robot's offset included; the Outcome."""
    controls = np.zeros(5)
    controls[0] = u[0]
    controls[1], controls[2] = u[1] * law.stiffness, u[2] * law.stiffness
    result = np.empty(RESULTS)
    outcome = section_map(tables, law.model, kind, node, z, controls, s, result)
    for i in range(3):
        z_next[i] = result[i] + law.offset[i]
    return outcome


@njit(cache=True)
def _cost_to_go(law: Law, z: Array) -> float:
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += (z[i] - law.target[i]) * law.cost[i, j] * (z[j] - law.target[j])
    return total


@njit(cache=True)
def price(
    tables: Tables,
    node: int,
    kind: int,
    law: Law,
    s: Scratch,
    z: Array,
    u: Array,
    limit: float,
    first: Array,
) -> float:
    """Cost of taking ``u`` at ``z``; the state after one step into ``first`` (3,).

    Args:
        kind: the MapKind.
        limit: a cost known to be too much; the second step is not looked at beyond it.
    """
    second = np.empty(3)
    u2 = np.empty(3)
    if step(tables, node, kind, law, s, z, u, first) != 0:
        return 2.0 * FALL_PRICE
    here = _cost_to_go(law, first)
    if 0.3 * here >= limit:
        return 0.3 * here
    linear(law, first, u2)
    best = FALL_PRICE + here
    if step(tables, node, kind, law, s, first, u2, second) == 0:
        best = _cost_to_go(law, second) + 0.3 * here
    for i in range(law.second_steps.shape[0]):
        # The law's own step is good enough near the gait.
        if best < law.enough:
            break
        u2[:] = law.second_steps[i]
        bounded(law, first, u2)
        if step(tables, node, kind, law, s, first, u2, second) == 0:
            best = min(best, _cost_to_go(law, second) + 0.3 * here)
    return best


@njit(cache=True)
def _try(
    tables: Tables,
    node: int,
    law: Law,
    s: Scratch,
    z: Array,
    u: Array,
    cheapest: float,
    best: Array,
    first: Array,
    end: Array,
) -> float:
    """Price ``u`` once within bounds; if it is cheaper, it is the new best."""
    bounded(law, z, u)
    cost = price(tables, node, _FAST, law, s, z, u, cheapest, end)
    if cost >= cheapest:
        return cheapest
    best[:] = u
    first[:] = end
    return cost


@njit(cache=True)
def search(
    tables: Tables,
    node: int,
    law: Law,
    s: Scratch,
    z: Array,
    spread: Array,
    best: Array,
    first: Array,
) -> float:
    """Improve ``best`` (3,) in place: a coarse grid over all bounds, then finer ones about it.

    Far from the gait the good steps (hard braking, say, with a stiff leg before the virtual
    bottom and a soft one after) are not near what the linear law says.

    Args:
        spread: (2,) half-widths of the first fine grid in alpha [rad] and kappa/k0.
        best: start of the search, and its result.
        first: (3,) overwritten with the state after the step.

    Returns:
        The price of ``best``.
    """
    u, end = np.empty(3), np.empty(3)
    cheapest = price(tables, node, _FAST, law, s, z, best, np.inf, first)
    for i in range(45):
        u[0] = (i // 9 + 0.5) / 5.0
        u[1] = (i // 3 % 3 + 0.5) / 3.0
        u[2] = (i % 3 + 0.5) / 3.0
        for j in range(3):
            u[j] = law.lower[j] + u[j] * (law.upper[j] - law.lower[j])
        cheapest = _try(tables, node, law, s, z, u, cheapest, best, first, end)
    width_alpha, width_kappa = spread[0], spread[1]
    for _ in range(2):
        c0, c1, c2 = best[0], best[1], best[2]
        for i in range(17):
            # 5 x 3 points in alpha and kappa_2 about the centre, and two in kappa_1.
            u[0], u[1], u[2] = c0, c1, c2
            if i < 15:
                u[0] += 0.5 * (i // 3 - 2) * width_alpha
                u[2] += (i % 3 - 1) * width_kappa
            else:
                u[1] += (2 * i - 31) * width_kappa
            cheapest = _try(tables, node, law, s, z, u, cheapest, best, first, end)
        width_alpha *= 0.4
        width_kappa *= 0.4
    return price(tables, node, _EXACT, law, s, z, best, np.inf, first)
