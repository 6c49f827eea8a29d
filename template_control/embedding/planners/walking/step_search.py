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

from template_control.compiled import callee, compiled
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.dynamics.model import Kernel
from template_control.slip.maps.section_map import RESULTS, one_stride

Array = NDArray[np.float64]

# Numba would compile once more for a literal int or bool.
_FAST = np.int64(MapKind.IMPROVED)
_ON_EXACT, _ON_FAST = np.bool_(True), np.bool_(False)
_FLIES = int(Outcome.UNWANTED_FLIGHT)
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


class Strain(NamedTuple):
    """What a step costs whose leg forces are more than a knee carries.

    Attributes:
        reach: length of the leg at which the knee is straight [m].
        most: moment of the leg force about the knee from which on a step costs more [N m].
        price: of a moment that is twice as much.
    """

    reach: float
    most: float
    price: float


class Law(NamedTuple):
    """A bounded linear law u = u_s - K (z - z_s) and what it needs to be judged.

    There are c controls: 3 in the paper's walking step, 4 in one with push-off.

    Attributes:
        target: (3,) z_s, dx/dt, y, dy/dt.
        control: (c,) u_s: alpha [rad], kappa_1/k0, kappa_2/k0 and, with push-off, kappa_p/k0.
        gain: (c, 3) K.
        cost: (3, 3) cost-to-go about ``target``.
        offset: (3,) what the robot adds to the template's next VLO state.
        lower, upper: (c,) bounds of u.
        slots: (c,) places of u in a stride's controls.
        second_steps: (n, c) other controls than u_s - K (z - z_s) for the second step.
        enough: a cost below which no other second step is tried.
        first_weight: of the cost-to-go after the first step beside that after the second.
        effort: (c,) of (u - u_s)^2 in the first step, beside both.
        highest: a CoM that flies higher than this [m] has left the ground.
        top_margin: alpha stays this far [rad] below asin(y / l0).
        earliest: alpha also stays below asin(y / l0) this long after VLO [s].
        stiffness: k0 [N/m].
        softest: least stiffness/k0 that is chosen for the rest of a slow step.
        strain: what a step costs that strains the knees.
        kernel: the template's walking step.
    """

    target: Array
    control: Array
    gain: Array
    cost: Array
    offset: Array
    lower: Array
    upper: Array
    slots: NDArray[np.int64]
    second_steps: Array
    enough: float
    first_weight: float
    effort: Array
    highest: float
    top_margin: float
    earliest: float
    stiffness: float
    softest: float
    strain: Strain
    kernel: Kernel


class Trust(NamedTuple):
    """When a linear law's own step is taken without a search.

    Attributes:
        price: its price on the exact map is below this.
        settled: cost-to-go up to which it may lead further away from the law's target.
    """

    price: float
    settled: float


@callee
def _copy(source: Array, target: Array) -> None:
    """A slice would take Numba seconds to compile: it prepares what to say of wrong shapes."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@callee
def bounded(law: Law, z: Array, u: Array) -> None:
    """Clip controls in place to what is admissible at a VLO state.

    The height a short time after VLO comes from its Taylor series to the second order.

    Args:
        law: its bounds, its ``top_margin`` and its ``earliest`` count.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) alpha [rad], stiffnesses/k0; overwritten.
    """
    for i in range(u.shape[0]):
        u[i] = min(max(u[i], law.lower[i]), law.upper[i])
    length, t = law.kernel.rest_length, law.earliest
    u[0] = min(u[0], np.arcsin(min(z[1] / length, 1.0)) - law.top_margin)
    if t > 0.0:
        lift = u[1] * law.stiffness / law.kernel.mass * (length - z[1]) - law.kernel.gravity
        later = z[1] + t * (z[2] + 0.5 * t * lift)
        u[0] = min(u[0], np.arcsin(min(max(later / length, 0.0), 1.0)))


@callee
def linear(law: Law, z: Array, u: Array) -> None:
    """Write the law's controls, within their bounds, into ``u``.

    Args:
        law: u = u_s - K (z - z_s), and the bounds.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) overwritten with alpha [rad], stiffnesses/k0.
    """
    for i in range(u.shape[0]):
        u[i] = law.control[i]
        for j in range(3):
            u[i] -= law.gain[i, j] * (z[j] - law.target[j])
    bounded(law, z, u)


@callee
def step(law: Law, exact: bool, s: Scratch, z: Array, u: Array, result: Array) -> int:
    """Take one walking step of the template, and add the robot's offset to where it ends.

    Args:
        law: the template's step and the offset.
        exact: try it on the exact map; else on the improved closed form.
        s: overwritten.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) alpha [rad], stiffnesses/k0.
        result: (RESULTS,) overwritten: the next VLO state first; see :func:`~.one_stride`.

    Returns:
        The Outcome's value; ``result`` means nothing where that is not SECTION.
    """
    # The template's leg would pull at the ground, which no robot's does.
    if z[1] + max(z[2], 0.0) ** 2 / (2.0 * law.kernel.gravity) > law.highest:
        return _FLIES
    controls = np.zeros(NUM_SLOTS)
    for i in range(u.shape[0]):
        controls[law.slots[i]] = u[i] if i == 0 else u[i] * law.stiffness
    if exact:
        outcome = one_stride(law.kernel, None, z, controls, s, result)
    else:
        outcome = one_stride(law.kernel, _FAST, z, controls, s, result)
    for i in range(3):
        result[i] += law.offset[i]
    return outcome


@callee
def strain(law: Law, z: Array, u: Array, result: Array) -> float:
    """What the knees make a step cost, where the legs are shortest.

    A leg of length l bends a knee half-way up it, which is then sqrt(reach^2 - l^2) / 2 beside it.
    A robot that is fast may strain its knees: legs that brake as they can slow it down all the
    same. One that is slow sinks.

    Args:
        law: its ``strain``, ``stiffness`` and ``target`` count.
        z: (3,) VLO state that the step begins in.
        u: (c,) alpha [rad], stiffnesses/k0.
        result: (RESULTS,) of the step.
    """
    total, l0 = 0.0, law.kernel.rest_length
    if z[0] >= law.target[0]:
        return total
    for leg in range(2):
        length = result[4 + leg]
        # The rear leg has kappa_1 until the front one lands, and then kappa_p.
        k = max(u[1], u[u.shape[0] - 1]) if leg == 0 and u.shape[0] > 3 else u[1]
        arm = 0.5 * np.sqrt(max(law.strain.reach**2 - length**2, 0.0))
        excess = k * law.stiffness * (l0 - length) * arm / law.strain.most - 1.0
        if excess > 0.0:
            total += law.strain.price * excess**2
    return total


@callee
def _cost_to_go(target: Array, cost: Array, z: Array) -> float:
    """Of the whole :class:`Law` a callee would take longer to compile: it has 32 parts."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += (z[i] - target[i]) * cost[i, j] * (z[j] - target[j])
    return total


@callee
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
    _copy(result, first)
    here = _cost_to_go(law.target, law.cost, first)
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
            _copy(law.second_steps[i], u2)
            bounded(law, first, u2)
        if step(law, exact, s, first, u2, result) == 0:
            cost = _cost_to_go(law.target, law.cost, result) + strain(law, first, u2, result)
            best = min(best, cost + share)
    return best


@callee
def _coarse(grid: Grid, law: Law, i: int, u: Array) -> None:
    """Point ``i`` of the grid over all bounds into ``u`` (c,); the last control varies first."""
    for j in range(u.shape[0] - 1, -1, -1):
        count = grid.coarse[j]
        u[j] = (i % count + 0.5) / count
        u[j] = law.lower[j] + u[j] * (law.upper[j] - law.lower[j])
        i //= count


@callee
def _fine(grid: Grid, centre: Array, widths: tuple[float, float], i: int, u: Array) -> None:
    """Point ``i`` of a grid about ``centre`` (c,) into ``u`` (c,).

    A plane of points in alpha and kappa_2, then two in kappa_1, and two in kappa_p.
    """
    n0, n2 = grid.fine
    _copy(centre, u)
    if i < n0 * n2:
        u[0] += (i // n2 / (0.5 * (n0 - 1)) - 1.0) * widths[0]
        u[2] += (i % n2 / (0.5 * (n2 - 1)) - 1.0) * widths[1]
    else:
        beside = i - n0 * n2
        u[1 + beside // 2 * 2] += (2 * (beside % 2) - 1) * widths[1]


@callee
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
                _copy(u, best)
                _copy(end, first)
        _copy(best, centre)
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
    left = _cost_to_go(law.target, law.cost, first)
    if trusted and left <= max(_cost_to_go(law.target, law.cost, z), trust.settled):
        return cost, True
    other, end = np.empty(u.shape[0]), np.empty(3)
    _copy(u, other)
    found = search(law, grid, s, z, other, end)
    if trusted and (cost <= found or left <= _cost_to_go(law.target, law.cost, end)):
        # What is found must come nearer, and not only be cheaper in the end.
        return cost, True
    _copy(other, u)
    _copy(end, first)
    return found, False
