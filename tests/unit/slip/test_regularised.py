"""Least squares on a stride, against changes of the controls: properties of what it finds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import MapKind, Outcome, Slot
from template_control.slip.control.least_squares import Search, bounded_step
from template_control.slip.control.stride_solver import (
    LEAST_PULL,
    TARGET_ONLY,
    Prior,
    StrideEnd,
    solve_stride,
    whole,
)
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.gaits.gait import gait_from_energy
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.maps.return_map import ReturnMap, new_workspace
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
GAIT = running_gait(P, 3.0)
STEP = ReturnMap(P, "r")
SLOTS = [int(Slot.TOUCHDOWN_ANGLE), int(Slot.K_SC), int(Slot.K_SD)]
BASE = GAIT.controls[SLOTS]
CHANGE = np.array([0.02, 0.15 * BASE[1], 0.15 * BASE[2]])
TOLERANCE = np.array([0.02, 0.004])
WEIGHTS = np.diag(1.0 / TOLERANCE)
WALK = gait_from_energy(P, 0.98, 820.0)


def prior(lower=0.8, upper=1.25, slots=SLOTS, **other):
    base = GAIT.controls[slots]
    change = CHANGE[[SLOTS.index(slot) for slot in slots]]
    low, high = np.minimum(lower * base, base), np.maximum(upper * base, base)
    if slots[0] == Slot.TOUCHDOWN_ANGLE:
        low[0], high[0] = base[0] - 0.1, min(base[0] + 0.1, np.arcsin(GAIT.apex[1]) - 0.005)
    table = np.array([base, change, low, high])
    return Prior(GAIT.controls, slots, table, Search(**{"rounds": 8, **other}))


def cost(u, aim, its):
    end, outcome = STEP.step(GAIT.apex, u)
    if outcome is not Outcome.SECTION:
        return np.inf
    parts = (end - aim) / TOLERANCE, (u[its.slots] - its.table[0]) / its.table[1]
    return float(np.sum(np.concatenate(parts) ** 2))


def test_the_target_that_the_base_reaches_leaves_it_alone():
    u, end = solve_stride(whole(STEP, GAIT.apex), GAIT.apex, prior(), WEIGHTS)
    np.testing.assert_allclose(u, GAIT.controls, rtol=1e-9)
    np.testing.assert_allclose(end, GAIT.apex, atol=1e-9)


AIMS = {"faster": st.floats(-0.3, 0.3), "higher": st.floats(-0.03, 0.03)}


@given(**AIMS)
@settings(max_examples=40, deadline=None)
def test_it_lowers_the_cost_within_its_bounds(faster, higher):
    aim, its = GAIT.apex + [faster, higher], prior()
    u, end = solve_stride(whole(STEP, GAIT.apex), aim, its, WEIGHTS)
    assert np.all(u[SLOTS] >= its.table[2])
    assert np.all(u[SLOTS] <= its.table[3])
    np.testing.assert_array_equal(u[3:], GAIT.controls[3:])
    np.testing.assert_allclose(STEP.step(GAIT.apex, u)[0], end, atol=1e-12)
    assert cost(u, aim, its) <= cost(GAIT.controls, aim, its) + 1e-12


@given(**AIMS, seed=st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_no_control_near_by_is_cheaper(faster, higher, seed):
    aim, its = GAIT.apex + [faster / 5, higher / 5], prior(rounds=20)
    u, _ = solve_stride(whole(STEP, GAIT.apex), aim, its, WEIGHTS)
    other = u.copy()
    change = its.table[1] * np.random.default_rng(seed).normal(0.0, 0.05, 3)
    other[SLOTS] = np.clip(u[SLOTS] + change, its.table[2], its.table[3])
    # Gauss-Newton stops where the cost is flat to within its rounds.
    assert cost(other, aim, its) > cost(u, aim, its) * (1.0 - 1e-3) - 1e-9


@pytest.mark.parametrize("speed", [2.19, 2.2275, 2.2525, 2.29])
def test_a_brake_is_found_where_whole_steps_fail(speed):
    # Halved steps ended at fifty times the cost: the run came to its walk too fast, and fell.
    aim, start = np.array([speed - 0.35, 0.9784]), np.array([speed, 0.9748])
    base = running_gait(P, 1.85).controls[SLOTS]
    change = np.array([0.03, 0.3 * base[1], 0.3 * base[2]])
    low, high = base * [0.0, 0.4, 0.4], base * [0.0, 2.5, 2.5]
    low[0], high[0] = base[0] - 0.1, min(base[0] + 0.1, np.arcsin(start[1]) - 0.005)
    its = Prior(GAIT.controls.copy(), SLOTS, np.array([base, change, low, high]), Search(10))
    _, end = solve_stride(whole(STEP, start), aim, its, WEIGHTS)
    assert np.all(np.abs(end - aim) < [0.06, 0.002])


def rest_of_a_step(controls, time=0.3):
    """The rest of a walking step, from ``time`` on, and the simulator that ends it."""
    simulator, start = StrideSimulator(P), STRIDE_START["w"]
    stride = simulator.run(start, VLO.state(WALK.vlo), WALK.controls)
    x, y, dx, dy = stride.sample(time)[0, :4]
    at = np.searchsorted(stride.meta[:, 0], time, side="right") - 1
    node, toes = stride.nodes(time)[0], stride.meta[at, 3:5]
    state = np.array([dx, y, dy, x, *toes])
    rest = StrideEnd(
        simulator.kernel(node), int(MapKind.EXACT), state, np.arange(3), new_workspace()
    )
    return rest, simulator.run(node, [x, y, dx, dy], controls, toes)


@pytest.mark.parametrize("time", [0.05, 0.3, 0.38])
def test_the_rest_of_a_stride_ends_as_the_simulator_says(time):
    u = WALK.controls * [1.0, 1.05, 0.9, 1.0, 1.0, 1.0]
    rest, stride = rest_of_a_step(u, time)
    end, outcome = rest(u)
    assert outcome is stride.outcome
    np.testing.assert_allclose(end, VLO.of(stride.state), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("time", [0.05, 0.3])
def test_the_rest_of_a_stride_is_led_back_to_where_it_ended(time):
    u = WALK.controls.copy()
    rest, _ = rest_of_a_step(u, time)
    aim, _ = rest(u)
    slot = [int(Slot.K_SD)]
    base = 0.9 * u[slot]
    table = np.array([base, 10.0 * base, 0.5 * base, 2.0 * base])
    found, end = solve_stride(rest, aim, Prior(u, slot, table, TARGET_ONLY, LEAST_PULL), np.eye(3))
    np.testing.assert_allclose(found, u, rtol=1e-8)
    np.testing.assert_allclose(end, aim, rtol=0.0, atol=1e-9)


def test_a_grid_is_tried_where_the_base_fails_and_none_is_said_where_it_does_too():
    stride, good = whole(STEP, GAIT.apex), GAIT.controls[SLOTS]
    base = good * [0.6, 1.0, 1.0]  # so flat that the leg slips through
    assert stride(np.array([*base, *GAIT.controls[3:]]))[1] is not Outcome.SECTION
    table = np.array([base, CHANGE, good * 0.6, good * [1.0, 1.4, 1.4]])
    u, end = solve_stride(stride, GAIT.apex, Prior(GAIT.controls, SLOTS, table, Search(3)), WEIGHTS)
    assert end is not None
    np.testing.assert_allclose(stride(u)[0], end)
    table = np.array([base, CHANGE, base * 0.98, base * 1.02])
    u, end = solve_stride(stride, GAIT.apex, Prior(GAIT.controls, SLOTS, table, Search(3)), WEIGHTS)
    assert end is None
    np.testing.assert_array_equal(u[SLOTS], base)


def test_it_shortens_a_step_that_goes_where_the_stride_fails():
    # An apex so fast that no single stride gets there: whole steps end in strides that fail.
    aim, its = GAIT.apex + [3.0, 0.0], prior(lower=0.1, upper=10.0, rounds=20)
    u, end = solve_stride(whole(STEP, GAIT.apex), aim, its, WEIGHTS)
    assert end is not None
    assert cost(u, aim, its) < cost(GAIT.controls, aim, its)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_bounded_step_stays_and_no_free_one_is_better(seed):
    rng = np.random.default_rng(seed)
    rows, residual = rng.normal(size=(5, 3)), rng.normal(size=5)
    lower, upper = -rng.uniform(0.0, 1.0, 3), rng.uniform(0.0, 1.0, 3)
    x = rng.uniform(lower, upper)
    there = bounded_step(rows, residual, x, lower, upper, 0.0)
    assert np.all((there >= lower) & (there <= upper))
    size = np.linalg.norm(rows @ (there - x) + residual)
    # Along what is not at a bound no change helps.
    free = (there > lower + 1e-12) & (there < upper - 1e-12)
    gradient = rows.T @ (rows @ (there - x) + residual)
    np.testing.assert_allclose(gradient[free], 0.0, atol=1e-9)
    if free.all():
        least = np.linalg.lstsq(rows, -residual, rcond=None)
        assert size == pytest.approx(np.sqrt(least[1][0]))
