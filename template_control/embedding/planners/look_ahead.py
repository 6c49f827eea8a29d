"""The cost of a plan of several walking steps, with its derivatives.

Over N steps with controls u_0 to u_(N-1) and states z_1 to z_N at VLO, it is:

    sum |(z_i - z*) / tolerance|^2 + |(u_i - u*) / control tolerance|^2 + (rise beyond)^2
    + (knee moments beyond)^2 + (z_N - z*)' P (z_N - z*)

z* and u* are the aimed gait's, shifted so that the robot, with its offset, settles on it; the
sum over states ends at z_(N-1); P is the LQR's cost-to-go of the same costs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.cholesky import cholesky
from template_control.compiled import compiled
from template_control.embedding.planners.gait_table import (
    CONTROL,
    CONTROL_TOLERANCE,
    CONTROLS,
    COST,
    GAIN,
    SETTLING,
    SLOTS,
    STATE,
    STIFFNESS,
    WIDTH,
    GaitTable,
    gait_row,
)
from template_control.embedding.planners.lqr import ANGLE_RANGE, STIFFNESS_RANGE
from template_control.embedding.planners.step_search import steepest
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.slip.control.least_squares import bounded_step
from template_control.slip.dynamics.model import Kernel
from template_control.slip.maps.return_map import (
    EXACT,
    REAR_BOTTOM,
    RESULTS,
    Derivatives,
    MapWorkspace,
    one_stride,
    section_jacobian,
)

BOUNDS = np.array(
    [[angle, *[share] * 3] for angle, share in zip(ANGLE_RANGE, STIFFNESS_RANGE, strict=True)]
)
"""(2, 4) least and greatest alpha relative to the gait's [rad], and stiffnesses over k."""
_DONE = 0.02  # of the cost: a Gauss-Newton step that lowers it by less is the last
_SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)  # of a Gauss-Newton step, until one lowers the cost
_LESS = 0.5  # of the LQR's feedback, where the template cannot do it


class PlanProblem(NamedTuple):
    """Model and costs of every plan."""

    kernel: Kernel  # the step
    table: GaitTable
    tolerance: Array  # (3,) differences of the states that cost 1
    ease: float  # control tolerances over those of the gaits' table
    rise: tuple[float, float]  # |dy/dt| that costs nothing, and what is beyond and costs 1 [m/s]
    knee_reach: float  # length of the leg at which the knee is straight [m]
    knee_moment: float  # of the leg force about the knee that costs nothing [N m]
    earliest: float  # the foot lands so long after VLO at the soonest [s]
    rounds: int  # Gauss-Newton steps at most
    columns: IntArray  # (7,) of the map's derivatives, states and controls


class PlanTarget(NamedTuple):
    """Speed, offset and angles that a plan is made for."""

    speed: float  # dx/dt at VLO of the aimed gait [m/s]
    offset: Array  # (3,) what the robot adds to each step of the template
    angles: tuple[float, float]  # least and greatest touchdown angle of the first step [rad]


STATES = 3
"""Of a section at VLO."""
_KNEES = 3


class Plan(NamedTuple):
    """Plan of N steps."""

    states: Array  # (N + 1, 3) at VLO, the present one first
    controls: Array  # (N, 4) alpha and shares of the aimed gait's k
    # (N, 3) of the rear and the front leg at the virtual bottom, and of the rear leg at touchdown
    # [m]
    lengths: Array
    row: Array  # of the aimed gait, see gait_table
    target: Array  # (7,) z*, u*: that gait, as the robot settles on it
    factor: Array  # (3, 3) L with P = L L'


def new_plan(steps: int) -> Plan:
    """Room for a plan."""
    states, free = np.empty((steps + 1, STATES)), np.empty((steps, CONTROLS))
    lengths, row = np.empty((steps, _KNEES)), np.empty(WIDTH)
    target, factor = np.empty(STATES + CONTROLS), np.empty((STATES, STATES))
    return Plan(states, free, lengths, row, target, factor)


_LIMITS = STATES + CONTROLS
PER_STEP = STATES + CONTROLS + 1 + _KNEES
"""Residuals of a step: states, controls, what rises beyond, what the knees bear beyond: of the rear
and of the front leg at the virtual bottom, and of the rear leg just after touchdown."""
_KNEE_TOLERANCE = 0.05  # share of the knee moment beyond that costs 1


@compiled
def _aimed(p: PlanProblem, aim: PlanTarget, plan: Plan) -> None:
    """Write the gait that a plan aims at, and what belongs to it."""
    row, target, factor = plan.row, plan.target, plan.factor
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
def slots_of(plan: Plan, i: int, u: Array) -> None:
    """Write the controls of step ``i`` by :class:`Slot` into ``u`` (NUM_SLOTS,)."""
    for j in range(NUM_SLOTS):
        u[j] = 0.0
    for j in range(CONTROLS):
        unit = 1.0 if j == 0 else plan.row[STIFFNESS]
        u[SLOTS[j]] = plan.controls[i, j] * unit


@compiled
def residuals(p: PlanProblem, plan: Plan, out: Array) -> float:
    """Write the errors of a plan, in tolerances, into ``out`` (11 N,); return the cost."""
    target, factor = plan.target, plan.factor
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
        for j in range(CONTROLS):
            miss = plan.controls[i, j] - target[STATES + j]
            out[row + STATES + j] = miss / (p.ease * CONTROL_TOLERANCE[j])
        beyond = abs(plan.states[i + 1, 2]) - p.rise[0]
        out[row + _LIMITS] = max(beyond, 0.0) / p.rise[1]
        for leg in range(_KNEES):
            moment = knee_moment(p, plan, i, leg)[0]
            beyond = (moment / p.knee_moment - 1.0) / _KNEE_TOLERANCE
            out[row + _LIMITS + 1 + leg] = max(beyond, 0.0)
    for i in range(PER_STEP * steps):
        cost += out[i] * out[i]
    return cost


@compiled
def excess(out: Array) -> float:
    """Share of the limits and of the last state in the cost of ``out``, from :func:`residuals`.

    It says that a plan cannot be done, or leads nowhere.
    """
    total, steps = 0.0, out.shape[0] // PER_STEP
    for i in range(steps):
        for j in range(_LIMITS, PER_STEP):
            total += out[PER_STEP * i + j] ** 2
    for j in range(STATES):
        total += out[PER_STEP * (steps - 1) + j] ** 2
    return total


@compiled
def knee_moment(p: PlanProblem, plan: Plan, i: int, leg: int) -> tuple[float, float, int]:
    """Moment of a leg's force about its knee, which is half-way up the leg.

    M = kappa (l0 - l) sqrt(reach^2 - l^2) / 2, with the larger of the stiffnesses that the leg has
    before and after. ``leg`` is one of the plan's ``lengths``. Returns M [N m], its derivative by
    the length [N], and which control the stiffness is.
    """
    u, length = plan.controls[i], plan.lengths[i, leg]
    stiff = 3 if leg != 1 else (1 if u[1] >= u[2] else 2)
    force = u[stiff] * plan.row[STIFFNESS] * (p.kernel.rest_length - length)
    arm = 0.5 * np.sqrt(max(p.knee_reach**2 - length**2, 1e-6 * p.knee_reach**2))
    by_length = -u[stiff] * plan.row[STIFFNESS] * arm - 0.25 * force * length / arm
    return force * arm, by_length, stiff


@compiled
def _chain(
    jacobian: Array, first: int, skip: int, plan: Plan, i: int, state: Array, out: Array
) -> None:
    """Derivatives of three results of step ``i`` by the controls of all steps up to it.

    ``jacobian`` is the step's, by its state, of ``skip`` columns (0: it is what it is), and its
    controls; the results' places begin at ``first``; ``state`` (3, c) are the derivatives of the
    step's own state; ``out`` (3, c) is overwritten.
    """
    for a in range(3):
        for c in range(CONTROLS * i):
            total = 0.0
            for b in range(skip):
                total += jacobian[first + a, b] * state[b, c]
            out[a, c] = total
        for c in range(CONTROLS):
            unit = 1.0 if c == 0 else plan.row[STIFFNESS]
            out[a, CONTROLS * i + c] = jacobian[first + a, skip + c] * unit


@compiled
def slopes(p: PlanProblem, work: MapWorkspace, plan: Plan, rows: Array) -> None:
    """Write the derivatives of :func:`residuals` by all controls into ``rows`` (11 N, 4 N)."""
    steps, factor = plan.controls.shape[0], plan.factor
    size = CONTROLS * steps
    u, result = np.empty(NUM_SLOTS), np.empty(RESULTS)
    by_control = np.empty((RESULTS, CONTROLS))
    by_both = np.empty((RESULTS, STATES + CONTROLS))
    state, following = np.zeros((STATES, size)), np.zeros((STATES, size))
    lengths = np.zeros((_KNEES, size))
    for i in range(PER_STEP * steps):
        for j in range(size):
            rows[i, j] = 0.0
    for i in range(steps):
        slots_of(plan, i, u)
        # The present state is what it is.
        skip, columns, jacobian = STATES, p.columns, by_both
        if i == 0:
            skip, columns, jacobian = 0, p.columns[STATES:], by_control
        found = Derivatives(result, jacobian)
        section_jacobian(p.kernel, EXACT, plan.states[i], u, columns, work, found)
        _chain(found.jacobian, 0, skip, plan, i, state, following)
        _chain(found.jacobian, REAR_BOTTOM, skip, plan, i, state, lengths)
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
                rows[row + _LIMITS, c] = sign * state[2, c] / p.rise[1]
        for c in range(CONTROLS):
            rows[row + STATES + c, CONTROLS * i + c] = 1.0 / (p.ease * CONTROL_TOLERANCE[c])
        for leg in range(_KNEES):
            moment, by_length, stiff = knee_moment(p, plan, i, leg)
            if moment <= p.knee_moment:
                continue
            unit = _KNEE_TOLERANCE * p.knee_moment
            for c in range(CONTROLS * (i + 1)):
                rows[row + _LIMITS + 1 + leg, c] = by_length * lengths[leg, c] / unit
            stiffer = moment / plan.controls[i, stiff]
            rows[row + _LIMITS + 1 + leg, CONTROLS * i + stiff] += stiffer / unit


@compiled
def _step(p: PlanProblem, work: MapWorkspace, aim: PlanTarget, plan: Plan, i: int) -> bool:
    """Write the state after step ``i``; False where the template does not complete it."""
    u, result = np.empty(NUM_SLOTS), np.empty(RESULTS)
    slots_of(plan, i, u)
    if one_stride(p.kernel, EXACT, plan.states[i], u, work.scratch, result) != 0:
        return False
    for j in range(STATES):
        plan.states[i + 1, j] = result[j] + aim.offset[j]
    for j in range(_KNEES):
        plan.lengths[i, j] = result[REAR_BOTTOM + j]
    return True


@compiled
def _roll(p: PlanProblem, work: MapWorkspace, aim: PlanTarget, plan: Plan) -> bool:
    """Write the plan's states; False where the template does not complete a step."""
    done = True
    for i in range(plan.controls.shape[0]):
        done = done and _step(p, work, aim, plan, i)
    return done


@compiled
def _bounds(
    p: PlanProblem, aim: PlanTarget, plan: Plan, i: int, lower: Array, upper: Array
) -> None:
    """Bounds of the controls of step ``i`` into their places in (4 N,) arrays."""
    first = CONTROLS * i
    for j in range(CONTROLS):
        middle = plan.row[CONTROL] if j == 0 else 0.0
        lower[first + j] = middle + BOUNDS[0, j]
        upper[first + j] = middle + BOUNDS[1, j]
    if i == 0:
        lower[0] = min(max(lower[0], aim.angles[0]), upper[0])
        upper[0] = max(min(upper[0], aim.angles[1]), lower[0])
    body = p.kernel.rest_length, p.kernel.mass, p.kernel.gravity
    top = steepest(plan.states[i], body, plan.row[STIFFNESS], p.earliest)
    upper[first] = min(upper[first], top)
    lower[first] = min(lower[first], upper[first])


@compiled
def _guess(
    p: PlanProblem, work: MapWorkspace, aim: PlanTarget, plan: Plan, feedback: float
) -> bool:
    """A plan to begin with: ``feedback`` of the LQR's on top of the aimed gait's controls.

    False where the template does not complete a step.
    """
    target, size = plan.target, CONTROLS * plan.controls.shape[0]
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
def look_ahead(
    p: PlanProblem, work: MapWorkspace, z: Array, aim: PlanTarget, plan: Plan
) -> tuple[float, float]:
    """Plan N steps from a VLO state ``z`` (3,) [m/s, m, m/s]; ``plan`` is overwritten.

    Returns the plan's cost and its :func:`excess`, inf where the template completes no steps to
    begin with.
    """
    steps = plan.controls.shape[0]
    size = CONTROLS * steps
    _aimed(p, aim, plan)
    for j in range(STATES):
        plan.states[0, j] = z[j]
    feedback = 1.0
    while not _guess(p, work, aim, plan, feedback):
        if feedback == 0.0:
            return np.inf, np.inf
        feedback = max(feedback - _LESS, 0.0)
    lower, upper = np.empty(size), np.empty(size)
    rows, residual = np.empty((PER_STEP * steps, size)), np.empty(PER_STEP * steps)
    start, x = np.empty(size), np.empty(size)
    free = plan.controls.reshape(size)
    cost = residuals(p, plan, residual)
    for _ in range(p.rounds):
        slopes(p, work, plan, rows)
        for i in range(steps):
            _bounds(p, aim, plan, i, lower, upper)
        for i in range(size):
            start[i] = free[i]
            x[i] = min(max(start[i], lower[i]), upper[i])
        for r in range(residual.shape[0]):
            for i in range(size):
                residual[r] += rows[r, i] * (x[i] - start[i])
        there = bounded_step(rows, residual, x, lower, upper, 0.0)
        lowered = np.inf
        for share in _SHARES:
            for i in range(size):
                free[i] = start[i] + share * (there[i] - start[i])
            if _roll(p, work, aim, plan):
                lowered = residuals(p, plan, residual)
                if lowered < cost:
                    break
        saved, cost = cost - lowered, min(cost, lowered)
        if saved < _DONE * max(cost, 1.0):
            break
    return cost, excess(residual)
