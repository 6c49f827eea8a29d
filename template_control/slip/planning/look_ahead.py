"""Plan of several walking steps near a reference, as a least-squares problem.

Unknowns are the controls u_0 to u_(N-1) and the states z_1 to z_(N-1) at VLO between the steps
(direct multiple shooting). With the reference's states r_i and controls v_i, the aimed gait's state
z*, and the robot's offset d, the plan minimises

    sum |(P(z_i, u_i) + d - z_(i+1)) / defect|^2 + |(z_i - r_i) / tolerance|^2
    + |(u_i - v_i) / control tolerance|^2
    + (rise beyond)^2 + (knee moments beyond)^2 + (swing too short)^2
    + (P(z_(N-1), u_(N-1)) + d - z*)' C (P(z_(N-1), u_(N-1)) + d - z*)

C is the LQR's cost-to-go of the gait aimed at.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.compiled import compiled, inner, inner_by_type
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.slip.control.broyden import LinearMap, carried
from template_control.slip.control.least_squares import (
    Search,
    copy,
    evaluate,
    least_squares,
    slopes,
)
from template_control.slip.control.stride_solver import of_type
from template_control.slip.control.touchdown import ANY_ANGLE, steepest
from template_control.slip.dynamics.kernel import scratch_of
from template_control.slip.maps.return_map import (
    LANDING_TIME,
    LIFTED_TIME,
    REAR_BOTTOM,
    RESULTS,
    MapWorkspace,
    new_workspace,
    recorded_jacobian,
    recorded_stride,
)
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.gait_table import (
    CONTROLS,
    FACTOR,
    SETTLING,
    SLOTS,
    STATE,
    STATE_TOLERANCE,
    STIFFNESS,
    WIDTH,
    gait_row,
)
from template_control.slip.planning.plan_costs import ANGLE_RANGE, PlanCosts, WalkLimits, plan_costs
from template_control.structured import Kept, keep
from template_control.warm_up import Part

BOUNDS = np.array([[ANGLE_RANGE[0], 0.35, 0.35, 0.35], [ANGLE_RANGE[1], 1.5, 1.5, 1.5]])
"""(2, 4) least and greatest alpha relative to the reference's [rad], and stiffnesses over k.

What a softer leg does to the knees is a limit of its own here; with 0.5 speeds change later.
"""
STATES = 3
"""Of a section at VLO."""
BLOCK = CONTROLS + STATES
"""Unknowns of a step: its controls, and the state after it."""
_KNEES = 5
_STATE, _CONTROL = STATES, 2 * STATES
_RISE = _CONTROL + CONTROLS
_KNEE = _RISE + 1
_SHORT = _KNEE + _KNEES
PER_STEP = _SHORT + 1
"""Residuals of a step: the defect, or the last end; states, controls, what rises beyond, what
the knees bear beyond (the rear and the front leg at the virtual bottom, the rear leg just after
touchdown, the stance leg at the VLO before and after), and what the swing is too short."""
_KNEE_TOLERANCE = 0.05  # share of the knee moment beyond that costs 1
SMALL = np.array([0.03, 0.003, 0.04])
"""Changes of a state over which a step is to be nearly linear, for the reference."""
_LENGTH = 0.004  # of a leg's reach, by which a knee's moment changes by about as much as costs 1
SEARCH = Search(rounds=8, close=0.03, grid=0, gridded=CONTROLS, save=0.02, damping=1e-3)
"""Gauss-Newton steps of a plan; a grid is one of its first step."""


class Reference(NamedTuple):
    """N steps that a plan stays near, and the gait that it leads to."""

    states: Array  # (N, 3) at the VLO after each step
    controls: Array  # (N, 4) alpha and shares of the step's stiffness
    stiffness: Array  # (N,) [N/m]
    end: Array  # (3,) the gait's state
    factor: Array  # (3, 3) L with C = L L'


class PlanProblem(NamedTuple):
    """Question for a plan of N steps, a problem of :mod:`~.control.least_squares`."""

    costs: PlanCosts
    start: Array  # (3,) the present state
    offset: Array  # (3,) what the robot adds to each step of the template
    reference: Reference
    ends: Array  # (N, 3) of the steps, overwritten
    lengths: Array  # (N, 5) of legs, where knees count [m], overwritten
    lifted: Array  # (N + 1,) time from a liftoff to the VLO before each step and after the last [s]
    short: Array  # (N,) time by which each swing is too short [s], overwritten
    linearised: IntArray  # (1,) how often, counted up
    change: Array
    lower: Array
    upper: Array
    place: Array  # (N, 7) state and controls of each step as it was run last
    result: Array  # (N, RESULTS) where that led
    known: IntArray  # (N,) whether the next three hold derivatives of the step
    jacobian: Array  # (N, RESULTS, 7) about the place before
    before: Array  # (N, 7) that place
    led: Array  # (N, RESULTS) where it led
    unit: Array  # (7,) changes of state and controls that count as 1
    close: Array  # (RESULTS,) errors of the results that count as 1
    u: Array  # (NUM_SLOTS,) of the step at hand
    row: Array  # (WIDTH,) of the table
    work: MapWorkspace


def new_problem(costs: PlanCosts, steps: int) -> PlanProblem:
    """Room for plans of so many steps."""
    size, controls = BLOCK * steps - STATES, np.empty((steps, CONTROLS))
    states, square = np.empty((steps, STATES)), np.empty((STATES, STATES))
    change = np.tile([*costs.control_tolerance, *costs.tolerance], steps)[:size]
    length = _LENGTH * costs.knee_reach
    return PlanProblem(
        costs=costs,
        start=np.empty(STATES),
        offset=np.empty(STATES),
        reference=Reference(states, controls, np.empty(steps), np.empty(STATES), square),
        ends=np.empty((steps, STATES)),
        lengths=np.empty((steps, _KNEES)),
        lifted=np.full(steps + 1, np.inf),
        short=np.empty(steps),
        linearised=np.zeros(1, np.int64),
        change=change,
        lower=np.full(size, -np.inf),
        upper=np.full(size, np.inf),
        place=np.empty((steps, BLOCK)),
        result=np.empty((steps, RESULTS)),
        known=np.empty(steps, np.int64),
        jacobian=np.empty((steps, RESULTS, BLOCK)),
        before=np.empty((steps, BLOCK)),
        led=np.empty((steps, RESULTS)),
        unit=np.concatenate((costs.tolerance, costs.control_tolerance)),
        close=np.array([*costs.defect, np.inf, *3 * [length], *2 * [costs.short]]),
        u=np.zeros(NUM_SLOTS),
        row=np.empty(WIDTH),
        work=new_workspace(steps),
    )


def step_controls(free: Array, stiffness: float) -> Array:
    """(NUM_SLOTS,) controls of a step; ``free`` (4,) holds shares of a stiffness [N/m]."""
    u = np.zeros(NUM_SLOTS)
    u[SLOTS] = free * [1.0, *[stiffness] * (CONTROLS - 1)]
    return u


@compiled
def _load(p: PlanProblem, x: Array, i: int) -> None:
    """Write state and controls of step ``i`` where its stride reads them."""
    first, k = BLOCK * i, p.reference.stiffness[i]
    for j in range(STATES):
        p.place[i, j] = p.start[j] if i == 0 else x[first - STATES + j]
    for j in range(CONTROLS):
        p.place[i, STATES + j] = x[first + j]
        p.u[SLOTS[j]] = x[first + j] * (1.0 if j == 0 else k)


@inner
def _step(p: PlanProblem, i: int) -> int:
    """Run step ``i``, loaded last; returns the Outcome's value."""
    scratch = scratch_of(p.work.scratch, i)
    return recorded_stride(p.costs.kernel, p.place[i, :STATES], p.u, scratch, p.result[i])


@inner
def _linearise(p: PlanProblem, i: int) -> None:
    """Write the derivatives of step ``i``, loaded and run last, into ``p.jacobian``."""
    work, jacobian = MapWorkspace(scratch_of(p.work.scratch, i), p.work.tangents), p.jacobian[i]
    recorded_jacobian(p.costs.kernel, p.u, p.costs.columns, work, jacobian)
    for r in range(RESULTS):
        for j in range(STATES + 1, BLOCK):
            jacobian[r, j] *= p.reference.stiffness[i]
    copy(p.place[i], p.before[i])
    copy(p.result[i], p.led[i])
    p.known[i] = 1


@compiled
def knee_moment(p: PlanProblem, x: Array, i: int, leg: int) -> tuple[float, float, int]:
    """Moment of a leg's force about its knee, which is half-way up the leg.

    M = kappa (l0 - l) sqrt(reach^2 - l^2) / 2, with the larger of the stiffnesses that the leg has
    before and after. ``leg`` is one of the problem's ``lengths``. Returns M [N m], its derivative
    by the length [N], and which control the stiffness is.
    """
    first, length, k = BLOCK * i, p.lengths[i, leg], p.reference.stiffness[i]
    before, stiff = (3, 1, 1, 1, 2)[leg], (3, 2, 3, 1, 2)[leg]
    if x[first + before] > x[first + stiff]:
        stiff = before
    kappa, reach = x[first + stiff] * k, p.costs.knee_reach
    force = kappa * (p.costs.kernel.rest_length - length)
    arm = 0.5 * np.sqrt(max(reach**2 - length**2, 1e-6 * reach**2))
    return force * arm, -kappa * arm - 0.25 * force * length / arm, stiff


@inner_by_type(evaluate)
def _plan_evaluate(problem: Any, x: Any, residual: Any) -> Any:
    """:func:`~.least_squares.evaluate` of a :class:`PlanProblem`."""

    def at(problem: Any, x: Any, residual: Any) -> Any:
        p, c, reference = problem, problem.costs, problem.reference
        steps, total = p.ends.shape[0], 0.0
        for i in range(steps):
            first, row, last = BLOCK * i, PER_STEP * i, i == steps - 1
            _load(p, x, i)
            if _step(p, i) != 0:
                return np.inf
            for j in range(STATES):
                p.ends[i, j] = p.result[i, j] + p.offset[j]
            for j in range(3):
                p.lengths[i, j] = p.result[i, REAR_BOTTOM + j]
            p.lengths[i, 3], p.lengths[i, 4] = p.place[i, 1], p.ends[i, 1]
            for j in range(STATES):
                residual[row + j] = residual[row + _STATE + j] = 0.0
                if last:
                    for k in range(j, STATES):
                        residual[row + j] += reference.factor[k, j] * (
                            p.ends[i, k] - reference.end[k]
                        )
                else:
                    z = x[first + CONTROLS + j]
                    residual[row + j] = (p.ends[i, j] - z) / c.defect[j]
                    residual[row + _STATE + j] = (z - reference.states[i, j]) / c.tolerance[j]
            for j in range(CONTROLS):
                miss = x[first + j] - reference.controls[i, j]
                residual[row + _CONTROL + j] = miss / c.control_tolerance[j]
            beyond = abs(p.ends[i, 2]) - c.rise[0]
            residual[row + _RISE] = max(beyond, 0.0) / c.rise[1]
            for leg in range(_KNEES):
                beyond = knee_moment(p, x, i, leg)[0] / c.knee_moment - 1.0
                residual[row + _KNEE + leg] = max(beyond, 0.0) / _KNEE_TOLERANCE
            least = max(c.swing - p.lifted[i], c.earliest)
            p.short[i] = least - p.result[i, LANDING_TIME]
            p.lifted[i + 1] = p.result[i, LIFTED_TIME]
            residual[row + _SHORT] = max(p.short[i], 0.0) / c.short
        for r in range(PER_STEP * steps):
            total += residual[r] * residual[r]
        return total

    return at if of_type(problem, PlanProblem) else None


@inner_by_type(slopes)
def _plan_slopes(problem: Any, x: Any, rows: Any) -> Any:
    """:func:`~.least_squares.slopes` of a :class:`PlanProblem`."""

    def at(problem: Any, x: Any, rows: Any) -> Any:
        p, c, reference, steps = problem, problem.costs, problem.reference, problem.ends.shape[0]
        p.linearised[0] += 1
        for r in range(rows.shape[0]):
            for j in range(rows.shape[1]):
                rows[r, j] = 0.0
        for i in range(steps):
            first, row, last = BLOCK * i, PER_STEP * i, i == steps - 1
            _load(p, x, i)
            jacobian, linear = p.jacobian[i], LinearMap(p.jacobian[i], p.before[i], p.led[i])
            if not (p.known[i] and carried(linear, p.place[i], p.result[i], p.unit, p.close)):
                _linearise(p, i)
            rising = 1.0 if p.ends[i, 2] > 0.0 else -1.0
            # The present state is what it is.
            for column in range(STATES if i == 0 else 0, BLOCK):
                place = first - STATES + column
                for j in range(STATES):
                    if last:
                        for k in range(j, STATES):
                            rows[row + j, place] += reference.factor[k, j] * jacobian[k, column]
                    else:
                        rows[row + j, place] = jacobian[j, column] / c.defect[j]
                if abs(p.ends[i, 2]) > c.rise[0]:
                    rows[row + _RISE, place] = rising * jacobian[2, column] / c.rise[1]
                for leg in range(_KNEES):
                    moment, by_length, stiff = knee_moment(p, x, i, leg)
                    if moment <= c.knee_moment:
                        continue
                    if leg < 3:
                        slope = by_length * jacobian[REAR_BOTTOM + leg, column]
                    elif leg == 3:
                        slope = by_length if column == 1 else 0.0
                    else:
                        slope = by_length * jacobian[1, column]
                    if column == STATES + stiff:
                        slope += moment / x[first + stiff]
                    rows[row + _KNEE + leg, place] = slope / (_KNEE_TOLERANCE * c.knee_moment)
                if p.short[i] > 0.0:
                    rows[row + _SHORT, place] = -jacobian[LANDING_TIME, column] / c.short
                # Where the whole swing is too short, it may also begin sooner.
                whole = c.swing - p.lifted[i + 1] > c.earliest
                if not last and whole and p.short[i + 1] > 0.0:
                    slope = -jacobian[LIFTED_TIME, column] / c.short
                    rows[row + PER_STEP + _SHORT, place] = slope
            for j in range(CONTROLS):
                rows[row + _CONTROL + j, first + j] = 1.0 / c.control_tolerance[j]
            if not last:
                for j in range(STATES):
                    place = first + CONTROLS + j
                    rows[row + j, place] = -1.0 / c.defect[j]
                    rows[row + _STATE + j, place] = 1.0 / c.tolerance[j]

    return at if of_type(problem, PlanProblem) else None


@compiled
def begin(p: PlanProblem, angles: tuple[float, float], x: Array) -> None:
    """Write the bounds of all controls, and the reference's steps within them into ``x``.

    ``angles`` are the least and the greatest touchdown angle of the first step [rad].
    """
    c, reference, steps = p.costs, p.reference, p.ends.shape[0]
    body = c.kernel.rest_length, c.kernel.mass, c.kernel.gravity
    for i in range(steps):
        first, k = BLOCK * i, reference.stiffness[i]
        for j in range(CONTROLS):
            middle = reference.controls[i, 0] if j == 0 else 0.0
            p.lower[first + j] = middle + BOUNDS[0, j]
            p.upper[first + j] = middle + BOUNDS[1, j]
        if i == 0:
            p.lower[0] = min(max(p.lower[0], angles[0]), p.upper[0])
            p.upper[0] = max(min(p.upper[0], angles[1]), p.lower[0])
        z = p.start if i == 0 else reference.states[i - 1]
        p.upper[first] = min(p.upper[first], steepest(z, body, k, 0.0))
        p.lower[first] = min(p.lower[first], p.upper[first])
        for j in range(CONTROLS):
            wish = reference.controls[i, j]
            x[first + j] = min(max(wish, p.lower[first + j]), p.upper[first + j])
        for j in range(STATES if i < steps - 1 else 0):
            x[first + CONTROLS + j] = reference.states[i, j]


@compiled
def look_ahead(problem: PlanProblem, search: Search, x: Array) -> tuple[float, float]:
    """Plan N steps from ``x`` (7 N - 3,) on, each step's controls and the state after it.

    Returns the plan's cost, and the share of it that says that the plan cannot be done, or leads
    nowhere: of the defects, the limits and the last state. Both are inf where the template does not
    complete the steps that the search begins with.
    """
    residual, excess = np.empty(PER_STEP * problem.ends.shape[0]), 0.0
    problem.known[:] = 0
    cost = least_squares(problem, search, residual, x)
    if cost == np.inf:
        return np.inf, np.inf
    for r in range(residual.shape[0]):
        if not _STATE <= r % PER_STEP < _RISE:
            excess += residual[r] * residual[r]
    return cost, excess


@compiled
def roughness(p: PlanProblem, x: Array, i: int) -> float:
    """Largest error of a step's linear map over small changes of its state, in tolerances.

    Where a leg nearly lifts off, or lands, a little earlier than it does, other states lead
    elsewhere: there the error is large, or inf where the template completes no step.
    """
    c, worst, ends = p.costs, 0.0, np.empty((STATES, 2, STATES))
    _load(p, x, i)
    for k in range(STATES):
        at = p.place[i, k]
        for side in range(2):
            p.place[i, k] = at + (1.0 - 2.0 * side) * (SMALL[k] * c.unit[k])
            outcome = _step(p, i)
            p.place[i, k] = at
            if outcome != 0:
                return np.inf
            for j in range(STATES):
                ends[k, side, j] = p.result[i, j]
    _step(p, i)
    _linearise(p, i)
    for k in range(STATES):
        for side in range(2):
            change = (1.0 - 2.0 * side) * (SMALL[k] * c.unit[k])
            for j in range(STATES):
                miss = ends[k, side, j] - p.result[i, j] - p.jacobian[i, j, k] * change
                worst = max(worst, abs(miss) / (STATE_TOLERANCE[j] * c.unit[j]))
    return worst


@compiled
def lead_to(p: PlanProblem, speed: float, near: bool) -> None:
    """Let the plan lead to the gait with a speed at VLO [m/s], shifted for the robot's offset.

    All its steps stay ``near`` that gait, or near the reference so far.
    """
    row, reference = p.row, p.reference
    gait_row(p.costs.table, speed, row)
    for j in range(BLOCK):
        wish = row[STATE + j]
        for i in range(STATES):
            wish += row[SETTLING + STATES * j + i] * p.offset[i]
        if j < STATES:
            reference.end[j] = wish
            for i in range(STATES):
                reference.factor[j, i] = row[FACTOR + STATES * j + i]
        for i in range(p.ends.shape[0] if near else 0):
            reference.stiffness[i] = row[STIFFNESS]
            if j < STATES:
                reference.states[i, j] = wish
            else:
                reference.controls[i, j - STATES] = wish


@compiled
def make_plan(
    kept: Kept,
    goal: tuple[float, bool],
    angles: tuple[float, float],
    search: Search,
    judged: tuple[float, float],
    x: Array,
) -> tuple[float, float, float]:
    """:func:`lead_to` a goal, :func:`begin`, :func:`look_ahead` and the first step's roughness.

    ``kept`` is the :class:`PlanProblem`, ``goal`` speed and ``near``. Returns the cost, the excess
    and the roughness, which is 0 where excess or cost are more than ``judged``.
    """
    p, error = kept.value, 0.0
    lead_to(p, *goal)
    begin(p, angles, x)
    cost, excess = look_ahead(p, search, x)
    if excess <= judged[0] and cost <= judged[1]:
        error = roughness(p, x, 0)
    return cost, excess, error


def plan_ahead() -> None:
    """The compiled plan, so that a helper process can compile it."""
    costs = plan_costs(SlipParameters(), WalkLimits(np.inf, (0.0, 1.0), 0.0))
    problem = new_problem(costs, 1)
    make_plan(keep(problem), (1.0, True), ANY_ANGLE, SEARCH, (-1.0, 0.0), np.ones(CONTROLS))


AHEAD = (Part(plan_ahead, 10.0),)
"""Compiled functions of a plan, in addition to a walk's."""
