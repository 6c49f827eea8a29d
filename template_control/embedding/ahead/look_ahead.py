"""Several walking steps planned at once: bounded Gauss-Newton steps on the exact VLO map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.embedding.ahead.gait_row import CONTROL, CONTROLS, GAIN
from template_control.embedding.ahead.plan_cost import (
    PER_STEP,
    STATES,
    aimed,
    residuals,
    slopes,
    slots_of,
)
from template_control.embedding.ahead.prospect import Aim, Plan, Prospect, Workspace
from template_control.embedding.planners.gauss_newton import bounded_step
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.slip.maps.return_map import RESULTS, one_stride

Array = NDArray[np.float64]

_HALVINGS = 4  # of a Gauss-Newton step that does not lower the cost
_LESS = 0.5  # of the LQR's feedback, where the template cannot do it


@compiled
def _step(p: Prospect, work: Workspace, aim: Aim, plan: Plan, i: int) -> bool:
    """Write the state after step ``i``; False where the template does not complete it."""
    u, result = np.empty(NUM_SLOTS), np.empty(RESULTS)
    slots_of(p, plan, i, u)
    if one_stride(p.kernel, None, plan.states[i], u, work.real, result) != 0:
        return False
    for j in range(STATES):
        plan.states[i + 1, j] = result[j] + aim.offset[j]
    return True


@compiled
def _roll(p: Prospect, work: Workspace, aim: Aim, plan: Plan) -> bool:
    """Write the plan's states; False where the template does not complete a step."""
    done = True
    for i in range(plan.controls.shape[0]):
        done = done and _step(p, work, aim, plan, i)
    return done


@compiled
def _bounds(p: Prospect, aim: Aim, plan: Plan, i: int, lower: Array, upper: Array) -> None:
    """Bounds of the controls of step ``i`` into their places in (4 N,) arrays."""
    first = CONTROLS * i
    for j in range(CONTROLS):
        middle = plan.row[CONTROL] if j == 0 else 0.0
        lower[first + j] = middle + p.bounds[0, j]
        upper[first + j] = middle + p.bounds[1, j]
    if i == 0:
        lower[0] = min(max(lower[0], aim.angles[0]), upper[0])
        upper[0] = max(min(upper[0], aim.angles[1]), lower[0])
    top = np.arcsin(min(plan.states[i, 1] / p.kernel.rest_length, 1.0)) - p.top_margin
    upper[first] = min(upper[first], top)
    lower[first] = min(lower[first], upper[first])


@compiled
def _guess(
    p: Prospect, work: Workspace, aim: Aim, plan: Plan, target: Array, feedback: float
) -> bool:
    """A plan to begin with: ``feedback`` of the LQR's on top of the aimed gait's controls.

    Returns:
        False where the template does not complete a step.
    """
    size = CONTROLS * plan.controls.shape[0]
    lower, upper = np.empty(size), np.empty(size)
    for i in range(plan.controls.shape[0]):
        _bounds(p, aim, plan, i, lower, upper)
        for j in range(CONTROLS):
            wish = target[STATES + j]
            for k in range(STATES):
                gain = plan.row[GAIN + STATES * j + k]
                wish -= feedback * gain * (plan.states[i, k] - target[k])
            place = CONTROLS * i + j
            plan.controls[i, j] = min(max(wish, lower[place]), upper[place])
        if not _step(p, work, aim, plan, i):
            return False
    return True


@compiled
def look_ahead(p: Prospect, work: Workspace, z: Array, aim: Aim, plan: Plan) -> float:
    """Plan N steps from a VLO.

    Args:
        p: what holds for every plan.
        work: overwritten.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        aim: where the plan is to lead.
        plan: overwritten.

    Returns:
        The plan's cost; inf where the template completes no steps to begin with.
    """
    steps = plan.controls.shape[0]
    size = CONTROLS * steps
    target, factor = np.empty(STATES + CONTROLS), np.empty((STATES, STATES))
    aimed(p, aim, plan, target, factor)
    for j in range(STATES):
        plan.states[0, j] = z[j]
    feedback = 1.0
    while not _guess(p, work, aim, plan, target, feedback):
        if feedback == 0.0:
            return np.inf
        feedback = max(feedback - _LESS, 0.0)
    lower, upper = np.empty(size), np.empty(size)
    rows, residual = np.empty((PER_STEP * steps, size)), np.empty(PER_STEP * steps)
    start, x = np.empty(size), np.empty(size)
    cost = residuals(p, plan, target, factor, residual)
    for _ in range(p.rounds):
        slopes(p, work, plan, factor, rows)
        for i in range(steps):
            _bounds(p, aim, plan, i, lower, upper)
        for i in range(size):
            start[i] = plan.controls[i // CONTROLS, i % CONTROLS]
            x[i] = min(max(start[i], lower[i]), upper[i])
        for r in range(residual.shape[0]):
            for i in range(size):
                residual[r] += rows[r, i] * (x[i] - start[i])
        there = bounded_step(rows, residual, x, lower, upper)
        share, lowered = 1.0, np.inf
        for _ in range(_HALVINGS):
            for i in range(size):
                value = start[i] + share * (there[i] - start[i])
                plan.controls[i // CONTROLS, i % CONTROLS] = value
            if _roll(p, work, aim, plan):
                lowered = residuals(p, plan, target, factor, residual)
                if lowered < cost:
                    break
            share *= 0.5
        if not lowered < cost:
            for i in range(size):
                plan.controls[i // CONTROLS, i % CONTROLS] = start[i]
            _roll(p, work, aim, plan)
            break
        small = cost - lowered < p.done * max(lowered, 1.0)
        cost = lowered
        if small:
            break
    return cost
