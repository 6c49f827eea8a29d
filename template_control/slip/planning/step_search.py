"""Compiled look-ahead on the exact VLO return map: what an LQR step is worth, and a better one.

A step is judged two steps ahead: after it comes the best of the (bounded) LQR law's step and a
few that brake or boost hard, and the state then reached is priced with the LQR's cost-to-go.
The search runs on the improved closed-form map, whose error is far below the robot's; what it
finds is priced on the exact one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.compiled import compiled, compiled_into, constant
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome, StrideKind
from template_control.slip.control.least_squares import copy
from template_control.slip.control.touchdown import steepest
from template_control.slip.dynamics.kernel import Scratch, new_scratch
from template_control.slip.dynamics.model import Kernel, stride_kernel
from template_control.slip.maps.return_map import EXACT, RESULTS, one_stride
from template_control.slip.parameters import SlipParameters
from template_control.warm_up import Part

_FAST = constant(MapKind.IMPROVED)
_FLIES = int(Outcome.UNWANTED_FLIGHT)
FALL_PRICE = 1e6
"""Price of a second step that fails; a first step that fails costs twice that."""

# Where two steps end alike, the first weight favours the one nearer the gait half-way, the effort
# the one with the gait's controls: no robot follows a step well whose legs are much softer.
_FIRST_WEIGHT = 0.3  # of the cost-to-go after the first step, over that after the second
EFFORT = 0.1
"""Weight of the LQR's own cost of the first step's controls."""
# Near some gaits the law alone settles next to them, in states in which the map is not linear.
_SETTLED_PRICE = 0.01  # cost-to-go up to which a step with push-off may lead further away
# Most points are in alpha, which decides where the foot lands; kappa_1, which matters least near
# the best, gets two points off the plane of alpha and kappa_2. Alphas end 0.03 rad apart.
_COARSE = np.array([5, 3, 3, 3])  # points in alpha, kappa_1, kappa_2, kappa_p over all bounds
_FINE = (5, 3)  # points in alpha and kappa_2 of each finer grid about the best so far
_FINER_GRIDS = 2
_WIDTHS = (0.16, 0.25)  # half-widths of the first finer grid in alpha [rad] and kappa_2
_NARROWING = 0.4  # half-widths of a finer grid over those of the one before, at most 0.5


class Law(NamedTuple):
    """A bounded linear law u = u_s - K (z - z_s) and what its steps cost.

    There are c controls: 3 in the paper's walking step, 4 in one with push-off.
    """

    target: Array  # (3,) z_s, dx/dt, y, dy/dt
    control: Array  # (c,) u_s: alpha [rad], kappa_1/k0, kappa_2/k0 and, with push-off, kappa_p/k0
    gain: Array  # (c, 3) K
    cost: Array  # (3, 3) cost-to-go about the target
    offset: Array  # (3,) what the robot adds to the template's next VLO state
    lower: Array  # (c,) bounds of u
    upper: Array
    slots: IntArray  # (c,) places of u in a stride's controls
    second_steps: Array  # (n, c) other controls than the law's for the second step
    # A cost below which no other second step is tried, nor any other first one.
    trusted_price: float
    effort: Array  # (c,) price of (u - u_s)^2 in the first step, added to that of both
    highest: float  # a CoM that flies higher than this [m] has left the ground
    earliest: float  # the foot lands so long after VLO at the soonest [s]
    stiffness: float  # k0 [N/m]
    knee_reach: float  # length of the leg at which the knee is straight [m]
    knee_moment: float  # of the leg force about the knee from which on a step costs more [N m]
    knee_price: float  # of a moment that is twice as much
    kernel: Kernel  # the template's walking step


@compiled
def bounded(law: Law, z: Array, u: Array) -> None:
    """Clip ``u`` (c,), alpha [rad] and stiffnesses/k0, to what is admissible at z (3,)."""
    for i in range(u.shape[0]):
        u[i] = min(max(u[i], law.lower[i]), law.upper[i])
    body = law.kernel.rest_length, law.kernel.mass, law.kernel.gravity
    u[0] = min(u[0], steepest(z, body, u[1] * law.stiffness, law.earliest))


@compiled
def linear(law: Law, z: Array, u: Array) -> None:
    """Write the law's controls at z (3,), within their bounds, into ``u`` (c,)."""
    for i in range(u.shape[0]):
        u[i] = law.control[i]
        for j in range(3):
            u[i] -= law.gain[i, j] * (z[j] - law.target[j])
    bounded(law, z, u)


@compiled
def step(law: Law, kind: int, s: Scratch, z: Array, u: Array, result: Array) -> int:
    """Take one walking step from ``z`` (3,), and add the robot's offset to where it ends.

    ``kind`` is the map's, as of :func:`.one_stride`. ``u`` (c,) is alpha [rad],
    stiffnesses/k0; ``result`` (RESULTS,) means nothing where the returned Outcome's value is not
    SECTION.
    """
    # The template's leg would pull at the ground, which no robot's does.
    if z[1] + max(z[2], 0.0) ** 2 / (2.0 * law.kernel.gravity) > law.highest:
        return _FLIES
    controls = np.zeros(NUM_SLOTS)
    for i in range(u.shape[0]):
        controls[law.slots[i]] = u[i] if i == 0 else u[i] * law.stiffness
    outcome = one_stride(law.kernel, kind, z, controls, s, result)
    for i in range(3):
        result[i] += law.offset[i]
    return outcome


@compiled
def knee_load(law: Law, z: Array, u: Array, result: Array) -> float:
    """Price of the knee load, where the legs are shortest.

    A leg of length l bends a knee half-way up it, which is then sqrt(reach^2 - l^2) / 2 from its
    line. A robot that is fast may strain its knees: legs that brake as they can slow it down all
    the same. One that is slow sinks. The arguments are those of :func:`step`, and its result.
    """
    total, l0 = 0.0, law.kernel.rest_length
    if z[0] >= law.target[0]:
        return total
    for leg in range(2):
        length = result[4 + leg]
        # The rear leg has kappa_1 until the front one lands, and then kappa_p.
        k = max(u[1], u[u.shape[0] - 1]) if leg == 0 and u.shape[0] > 3 else u[1]
        arm = 0.5 * np.sqrt(max(law.knee_reach**2 - length**2, 0.0))
        excess = k * law.stiffness * (l0 - length) * arm / law.knee_moment - 1.0
        if excess > 0.0:
            total += law.knee_price * excess**2
    return total


@compiled
def cost_to_go(target: Array, cost: Array, z: Array) -> float:
    """(z - z_s)^T P (z - z_s) with ``target`` z_s (3,) and ``cost`` P (3, 3).

    It takes no :class:`Law`, which has 32 parts: a callee would take longer to compile.
    """
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += (z[i] - target[i]) * cost[i, j] * (z[j] - target[j])
    return total


@compiled
def price(law: Law, kind: int, s: Scratch, z: Array, u: Array, limit: float, first: Array) -> float:
    """Cost of taking ``u`` at ``z``; arguments as for :func:`step`.

    ``limit`` is a cost known to be too much: the second step is not looked at beyond it. ``first``
    (3,) is overwritten with the state after one step.
    """
    result, u2 = np.empty(RESULTS), np.empty(u.shape[0])
    if step(law, kind, s, z, u, result) != 0:
        return 2.0 * FALL_PRICE
    copy(result, first)
    here = cost_to_go(law.target, law.cost, first)
    share = _FIRST_WEIGHT * here + knee_load(law, z, u, result)
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
            if best < law.trusted_price:
                break
            copy(law.second_steps[i], u2)
            bounded(law, first, u2)
        if step(law, kind, s, first, u2, result) == 0:
            cost = cost_to_go(law.target, law.cost, result) + knee_load(law, first, u2, result)
            best = min(best, cost + share)
    return best


@compiled
def _coarse(law: Law, i: int, u: Array) -> None:
    """Point ``i`` of the grid over all bounds into ``u`` (c,); the last control varies first."""
    for j in range(u.shape[0] - 1, -1, -1):
        count = _COARSE[j]
        u[j] = (i % count + 0.5) / count
        u[j] = law.lower[j] + u[j] * (law.upper[j] - law.lower[j])
        i //= count


@compiled
def _fine(centre: Array, widths: tuple[float, float], i: int, u: Array) -> None:
    """Point ``i`` of a grid about ``centre`` (c,) into ``u`` (c,).

    A plane of points in alpha and kappa_2, then two in kappa_1, and two in kappa_p.
    """
    n0, n2 = _FINE
    copy(centre, u)
    if i < n0 * n2:
        u[0] += (i // n2 / (0.5 * (n0 - 1)) - 1.0) * widths[0]
        u[2] += (i % n2 / (0.5 * (n2 - 1)) - 1.0) * widths[1]
    else:
        place = i - n0 * n2
        u[1 + place // 2 * 2] += (2 * (place % 2) - 1) * widths[1]


@compiled_into
def search(law: Law, s: Scratch, z: Array, best: Array, first: Array) -> float:
    """Improve ``best`` (c,) in place: a coarse grid over all bounds, then finer ones about it.

    Far from the gait the good steps (hard braking, say, with a stiff leg before the virtual bottom
    and a soft one after) are not near the linear law's. Returns the price of ``best``; ``first``
    (3,) is the state after it.
    """
    controls = best.shape[0]
    u, end, centre = np.empty(controls), np.empty(3), np.empty(controls)
    cheapest = price(law, EXACT, s, z, best, np.inf, first)
    coarse, fine = 1, _FINE[0] * _FINE[1] + 2 * (controls - 2)
    for j in range(controls):
        coarse *= _COARSE[j]
    widths = _WIDTHS
    for level in range(1 + _FINER_GRIDS):
        count = coarse if level == 0 else fine
        for i in range(count):
            if level == 0:
                _coarse(law, i, u)
            else:
                _fine(centre, widths, i, u)
            bounded(law, z, u)
            if price(law, _FAST, s, z, u, cheapest, end) >= cheapest:
                continue
            cost = price(law, EXACT, s, z, u, cheapest, end)
            if cost < cheapest:
                cheapest = cost
                copy(u, best)
                copy(end, first)
        copy(best, centre)
        if level > 0:
            widths = _NARROWING * widths[0], _NARROWING * widths[1]
    return cheapest


@compiled
def choose(law: Law, s: Scratch, z: Array, u: Array, first: Array) -> tuple[float, bool]:
    """The law's controls, or better ones where they cost too much, into ``u`` (c,).

    One function for both: compiled code of the maps is long, and each function that Python calls
    has one of its own. Returns the price of ``u``, and whether it is the law's; ``first`` (3,) is
    overwritten with the state after the step.
    """
    linear(law, z, u)
    cost = price(law, EXACT, s, z, u, np.inf, first)
    trusted = cost < law.trusted_price
    left = cost_to_go(law.target, law.cost, first)
    settled = _SETTLED_PRICE if u.shape[0] > 3 else np.inf
    if trusted and left <= max(cost_to_go(law.target, law.cost, z), settled):
        return cost, True
    other, end = np.empty(u.shape[0]), np.empty(3)
    copy(u, other)
    found = search(law, s, z, other, end)
    if trusted and (cost <= found or left <= cost_to_go(law.target, law.cost, end)):
        # What is found must come nearer, and not only be cheaper in the end.
        return cost, True
    copy(other, u)
    copy(end, first)
    return found, False


def chosen_step() -> None:
    """The look-ahead, called to compile it: the law, what a step is worth, and the search."""
    three, template = np.ones(3), SlipParameters()
    law = Law(
        target=three,
        control=three,
        gain=np.zeros((3, 3)),
        cost=np.eye(3),
        offset=three,
        lower=three,
        upper=three,
        slots=np.arange(3),
        second_steps=np.ones((1, 3)),
        trusted_price=0.0,
        effort=three,
        highest=1.0,
        earliest=0.0,
        stiffness=template.leg_stiffness,
        knee_reach=1.1,
        knee_moment=350.0,
        knee_price=1.0,
        kernel=stride_kernel(template, StrideKind.WALK),
    )
    choose(law, new_scratch(), three, np.ones(3), np.empty(3))


SEARCH = (Part(chosen_step, 4.3),)
"""Compiled functions of the look-ahead, in addition to those of strides."""
