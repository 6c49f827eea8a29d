"""The cost of a plan of several walking steps, with its derivatives.

Over N steps with controls u_0 to u_(N-1) and states z_1 to z_N at VLO, it is:

    sum |(z_i - z*) / tolerance|^2 + |(u_i - u*) / control tolerance|^2 + (rise beyond)^2
    + (z_N - z*)' P (z_N - z*)

z* and u* are the aimed gait's, shifted so that the robot, with its offset, settles on it; the
sum over states ends at z_(N-1); P is the LQR's cost-to-go of the same costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.embedding.ahead.gait_row import (
    CONTROLS,
    COST,
    SETTLING,
    STATE,
    STIFFNESS,
    gait_row,
)
from template_control.embedding.ahead.prospect import Aim, Plan, Prospect, Workspace
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.slip.maps.return_map import RESULTS, Derivatives, section_jacobian
from template_control.whole_body.elimination import cholesky

Array = NDArray[np.float64]

STATES = 3
"""Of a section at VLO."""

PER_STEP = STATES + 1 + CONTROLS
"""Residuals of a step: states, what rises beyond, controls."""


@compiled
def aimed(p: Prospect, aim: Aim, plan: Plan, target: Array, factor: Array) -> None:
    """The aimed gait, as the robot settles on it.

    Args:
        p: the table of gaits.
        aim: speed and offset.
        plan: its ``row`` is overwritten.
        target: (7,) overwritten with z* and u*.
        factor: (3, 3) overwritten with L, P = L L'.
    """
    row = plan.row
    gait_row(p.table, aim.speed, row)
    for i in range(STATES + CONTROLS):
        target[i] = row[STATE + i]
        for j in range(STATES):
            target[i] += row[SETTLING + STATES * i + j] * aim.offset[j]
    for i in range(STATES):
        for j in range(STATES):
            factor[i, j] = row[COST + STATES * i + j]
    cholesky(factor, STATES)


@compiled
def slots_of(p: Prospect, plan: Plan, i: int, u: Array) -> None:
    """The controls of a step by :class:`Slot`.

    Args:
        p: their slots.
        plan: shares of the aimed gait's k.
        i: which step.
        u: (NUM_SLOTS,) overwritten.
    """
    for j in range(NUM_SLOTS):
        u[j] = 0.0
    for j in range(CONTROLS):
        unit = 1.0 if j == 0 else plan.row[STIFFNESS]
        u[p.slots[j]] = plan.controls[i, j] * unit


@compiled
def residuals(p: Prospect, plan: Plan, target: Array, factor: Array, out: Array) -> float:
    """What a plan misses, in tolerances.

    Args:
        p: the tolerances.
        plan: its states and controls.
        target: (7,) z* and u*.
        factor: (3, 3) lower triangular L with P = L L'.
        out: (8 N,) overwritten: of each step its state, what rises beyond, its controls.

    Returns:
        The cost, their sum of squares.
    """
    steps, cost = plan.controls.shape[0], 0.0
    for i in range(steps):
        row = PER_STEP * i
        for j in range(STATES):
            if i < steps - 1:
                out[row + j] = (plan.states[i + 1, j] - target[j]) / p.tolerance[j]
            else:
                out[row + j] = 0.0
                for k in range(j, STATES):
                    out[row + j] += factor[k, j] * (plan.states[i + 1, k] - target[k])
        beyond = abs(plan.states[i + 1, 2]) - p.rise[0]
        out[row + STATES] = max(beyond, 0.0) / p.rise[1]
        for j in range(CONTROLS):
            miss = plan.controls[i, j] - target[STATES + j]
            out[row + STATES + 1 + j] = miss / p.control_tolerance[j]
    for i in range(PER_STEP * steps):
        cost += out[i] * out[i]
    return cost


@compiled
def slopes(p: Prospect, work: Workspace, plan: Plan, factor: Array, rows: Array) -> None:
    """Derivatives of :func:`residuals` by all controls.

    Args:
        p: the tolerances.
        work: overwritten.
        plan: its states and controls; the template completes its steps.
        factor: as for :func:`residuals`.
        rows: (8 N, 4 N) overwritten.
    """
    steps = plan.controls.shape[0]
    size = CONTROLS * steps
    u, result = np.empty(NUM_SLOTS), np.empty(RESULTS)
    by_control = np.empty((RESULTS, CONTROLS))
    by_both = np.empty((RESULTS, STATES + CONTROLS))
    state, following = np.zeros((STATES, size)), np.zeros((STATES, size))
    for i in range(PER_STEP * steps):
        for j in range(size):
            rows[i, j] = 0.0
    for i in range(steps):
        slots_of(p, plan, i, u)
        if i == 0:
            # The present state is what it is.
            found = Derivatives(result, by_control)
            section_jacobian(
                p.kernel, None, plan.states[i], u, p.columns[STATES:], work.complex, found
            )
        else:
            found = Derivatives(result, by_both)
            section_jacobian(p.kernel, None, plan.states[i], u, p.columns, work.complex, found)
        skip = 0 if i == 0 else STATES
        for a in range(STATES):
            for c in range(CONTROLS * i):
                total = 0.0
                for b in range(STATES):
                    total += by_both[a, b] * state[b, c]
                following[a, c] = total
            for c in range(CONTROLS):
                unit = 1.0 if c == 0 else plan.row[STIFFNESS]
                following[a, CONTROLS * i + c] = found.jacobian[a, skip + c] * unit
        row = PER_STEP * i
        beyond = abs(plan.states[i + 1, 2]) > p.rise[0]
        sign = 1.0 if plan.states[i + 1, 2] > 0.0 else -1.0
        for c in range(CONTROLS * (i + 1)):
            for a in range(STATES):
                state[a, c] = following[a, c]
            for a in range(STATES):
                if i < steps - 1:
                    rows[row + a, c] = state[a, c] / p.tolerance[a]
                else:
                    for k in range(a, STATES):
                        rows[row + a, c] += factor[k, a] * state[k, c]
            if beyond:
                rows[row + STATES, c] = sign * state[2, c] / p.rise[1]
        for c in range(CONTROLS):
            rows[row + STATES + 1 + c, CONTROLS * i + c] = 1.0 / p.control_tolerance[c]
