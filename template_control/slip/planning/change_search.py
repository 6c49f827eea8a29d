"""Search for the changes of speed: for each pair of gaits the fewest steps that the knees bear.

A change is a plan of :mod:`~.planning.look_ahead` that ends in the gait, and whose speed, height
and controls cost next to nothing. It is sought from the gaits between, random steps about them, and
the steps of other changes, until none gets shorter or cheaper.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import permutations, product
from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.control.least_squares import Search
from template_control.slip.control.touchdown import ANY_ANGLE
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.maps.return_map import LIFTED_TIME, ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.planning.gait_table import (
    CONTROL,
    CONTROLS,
    STATE,
    STATE_TOLERANCE,
    STIFFNESS,
    STRIDE,
    gait_table,
    row_at,
)
from template_control.slip.planning.look_ahead import (
    BLOCK,
    STATES,
    PlanProblem,
    begin,
    look_ahead,
    new_problem,
    roughness,
    step_controls,
)
from template_control.slip.planning.plan_costs import SWING, PlanCosts, WalkLimits, plan_costs
from template_control.slip.planning.speed_changes import SpeedChange
from template_control.slip.similarity import REFERENCE

SPEEDS = (0.26, 0.326, 0.41, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.317)
"""dx/dt at VLO of the gaits that are led from and to [m/s]."""
_SLOWEST = 0.3  # speed that a change of the library leads to [m/s]: slower gaits are rough
MOST = 7
"""Steps of a change at most."""
_KNEE = 320.0  # moment that a knee bears [N m]
_RISE = (0.15, 0.01)  # |dy/dt| that costs nothing, and what is beyond it and costs 1 [m/s]
_EARLIEST = 0.1  # touchdown after VLO [s]: the swing leg passes the other one about then
_DEFECT = 0.3  # differences between the steps, over those of a plan
# Differences from the aimed speed, the gaits' height and level that cost 1.
_TOLERANCE = np.array([32.0, 1.0, 6.0])
_HASTE = (1.0, 0.3)  # the same of the speed in a first search, whose steps begin the second [m/s]
_FREE = np.array([3.2, 12.0, 12.0, 12.0])  # changes of alpha [rad] and of the shares that cost 1
_SEARCH = Search(rounds=60, close=1e-4, grid=0, save=1e-4, damping=1e-3)
_TRIES = 30  # random steps that a change is sought from
_SPREAD = np.array([0.04, 0.15, 0.15, 0.15, 0.08, 0.006, 0.05])  # their standard deviation
_STITCHED = 12  # steps of two other changes that one is sought from
_DONE = 0.05  # excess of a change that can be done
_SMOOTH = 1.0  # roughness of its steps at most
_PASSES = 6  # over all pairs at most, from steps of other changes
_LONGER = 2  # steps more than the fewest that are tried
_SOONER = 0.98  # of a change's delay: less is no gain

Found = dict[tuple[float, float], tuple[float, SpeedChange]]
Starts = Callable[[PlanProblem, Array], Iterator[Array]]


def costs() -> PlanCosts:
    """Costs of a change: a plan's, but with steps that join better, and are nearly free."""
    limits = WalkLimits(_KNEE, (SPEEDS[0], SPEEDS[-1]), SWING)
    plan = plan_costs(REFERENCE, limits)
    return plan._replace(
        defect=_DEFECT * plan.defect,
        tolerance=_TOLERANCE,
        control_tolerance=_FREE,
        rise=_RISE,
        earliest=_EARLIEST,
    )


def delay(change: SpeedChange) -> float:
    """Time that a change takes, weighted by the share of it that is left [s]."""
    speed, late = change.states[:, 0], 0.0
    for i, (free, k) in enumerate(zip(change.controls, change.stiffness, strict=True)):
        state, u = VLO.state(change.states[i]), step_controls(free, k)
        stride = simulate_stride(REFERENCE, STRIDE_START[STRIDE], state, u)
        left = speed[-1] - 0.5 * (speed[i] + speed[i + 1])
        late += stride.duration * abs(left)
    return float(late / abs(speed[-1] - speed[0]))


def find_change(
    c: PlanCosts, ends: tuple[float, float], steps: int, starts: Starts
) -> tuple[float, SpeedChange] | None:
    """Delay and steps of the fastest change between two speeds at VLO [m/s] that can be done."""
    table, p = gait_table(REFERENCE), new_problem(c, steps)
    rows = np.array([row_at(table, speed) for speed in np.linspace(*ends, steps + 1)])
    means = 0.5 * (rows[1:] + rows[:-1])
    p.start[:], p.offset[:] = rows[0, STATE : STATE + STATES], 0.0
    r = p.reference
    r.states[:] = rows[1:, STATE : STATE + STATES]
    r.controls[:] = means[:, CONTROL : CONTROL + CONTROLS]
    r.stiffness[:] = means[:, STIFFNESS]
    begins = step_controls(rows[0, CONTROL : CONTROL + CONTROLS], float(rows[0, STIFFNESS]))
    p.lifted[0] = ReturnMap(REFERENCE, STRIDE).evaluate(p.start, begins)[0][LIFTED_TIME]
    r.end[:], r.factor[:] = rows[-1, STATE : STATE + STATES], np.diag(1.0 / c.defect)
    x = np.empty(len(p.lower))
    begin(p, ANY_ANGLE, x)
    r.states[:, 0] = ends[1]  # as fast as can be
    hasty = [
        p._replace(costs=c._replace(tolerance=np.array([haste, *c.tolerance[1:]])))
        for haste in _HASTE
    ]
    best: tuple[float, SpeedChange] | None = None
    for start, hurried in product(starts(p, x.copy()), hasty):
        x[:] = np.clip(start, p.lower, p.upper)
        look_ahead(hurried, _SEARCH, x)
        if look_ahead(p, _SEARCH, x)[1] > _DONE:
            continue
        free = np.append(x, np.zeros(STATES)).reshape(steps, BLOCK)[:, :CONTROLS]
        change = SpeedChange(np.vstack((p.start, p.ends)), free.copy(), r.stiffness.copy())
        late = delay(change)
        if best is not None and late >= best[0]:
            continue
        if max(roughness(p, x, i) for i in range(steps)) <= _SMOOTH:
            best = late, change
    return best


def random_starts(rng: np.random.Generator) -> Starts:
    """The gaits between, and random steps about them."""

    def starts(p: PlanProblem, x: Array) -> Iterator[Array]:
        yield x
        spread = np.resize(_SPREAD, len(x))
        for _ in range(_TRIES):
            yield x + spread * rng.normal(size=len(x))

    return starts


def stitched(found: Found) -> Starts:
    """First steps of one change and last steps of another one, that fit best."""
    known = [change for _, change in found.values()]
    heads = [(change, i) for change in known for i in range(1, len(change.controls) + 1)]
    tails = [(change, i) for change in known for i in range(len(change.controls))]
    begins = np.array([change.states[0] for change, _ in heads])
    joins = np.array([change.states[i] for change, i in heads])
    rests = np.array([change.states[i] for change, i in tails])
    finals = np.array([change.states[-1] for change, _ in tails])

    def starts(p: PlanProblem, x: Array) -> Iterator[Array]:
        steps, tolerance = len(p.ends), STATE_TOLERANCE
        here = np.sum(np.square((begins - p.start) / tolerance), axis=1)
        there = np.sum(np.square((finals - p.reference.end) / tolerance), axis=1)
        lengths = np.array([i for _, i in heads])[:, None]
        lengths = lengths + np.array([len(change.controls) - i for change, i in tails])
        rows, columns = np.nonzero(lengths == steps)
        apart = np.sum(np.square((joins[rows] - rests[columns]) / tolerance), axis=1)
        for k in np.argsort(here[rows] + apart + there[columns])[:_STITCHED]:
            (head, i), (tail, j) = heads[rows[k]], tails[columns[k]]
            block = np.zeros((steps, BLOCK))
            block[:, :CONTROLS] = np.vstack((head.controls[:i], tail.controls[j:]))
            stiffness = np.concatenate((head.stiffness[:i], tail.stiffness[j:]))
            block[:, 1:CONTROLS] *= (stiffness / p.reference.stiffness)[:, None]
            block[:-1, CONTROLS:] = np.vstack((head.states[1 : i + 1], tail.states[j + 1 :]))[:-1]
            yield block.ravel()[: len(x)]

    return starts


def search_changes(
    speeds: tuple[float, ...] | None = None,
    seed: int = 0,
    done: Callable[[float], None] = lambda share: None,
) -> Found:
    """Delay [s] and steps of the changes between speeds at VLO [m/s] of the reference template.

    ``speeds`` are :data:`SPEEDS` if not given; ``done`` is called with the share that is done.
    """
    c, rng, found = costs(), np.random.default_rng(seed), Found()
    pairs = list(permutations(speeds or SPEEDS, 2))

    def improve(ends: tuple[float, float], steps: int, starts: Starts) -> bool:
        change = find_change(c, ends, steps, starts)
        better = change is not None and change[0] < _SOONER * found.get(ends, (np.inf,))[0]
        if change is not None and better:
            found[ends] = change
        return better

    for i, ends in enumerate(pairs):
        done(0.5 * i / len(pairs))
        fewest = MOST
        for steps in range(1, MOST + 1):
            improve(ends, steps, random_starts(rng))
            fewest = min(fewest, steps) if ends in found else MOST
            if steps == fewest + _LONGER:
                break
    for turn in range(_PASSES):
        better = 0
        for i, ends in enumerate(pairs):
            done(0.5 + 0.5 * (turn + i / len(pairs)) / _PASSES)
            longest = MOST if ends not in found else len(found[ends][1].controls) + 1
            for steps in range(max(1, longest - 2), min(longest, MOST) + 1):
                better += improve(ends, steps, stitched(found))
        if not better:
            break
    return found


def change_data(found: Found) -> dict[str, Any]:
    """The changes without dimension, for a JSON file; without those to the slowest gaits."""
    p = REFERENCE
    unit, weight = p.speed_unit, p.mass * p.gravity / p.rest_length
    state = np.array([unit, p.rest_length, unit])
    return {
        "changes": [
            {
                "states": np.round(change.states / state, 6).tolist(),
                "controls": np.round(change.controls, 5).tolist(),
                "stiffness": np.round(change.stiffness / weight, 5).tolist(),
            }
            for (_, speed), (_, change) in found.items()
            if speed >= _SLOWEST
        ]
    }
