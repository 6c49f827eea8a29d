"""Least squares on a stride, against changes of the controls: properties of what it finds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.control.stride_solver import (
    FromHere,
    FromSection,
    Prior,
    bounded_step,
    solve_stride,
)
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
GAIT = running_gait(P, 3.0)
STEP = ReturnMap(P, "r")
SLOTS = [int(Slot.TOUCHDOWN_ANGLE), int(Slot.K_SC), int(Slot.K_SD)]
BASE = GAIT.controls[SLOTS]
CHANGE = np.array([0.02, 0.15 * BASE[1], 0.15 * BASE[2]])
TOLERANCE = np.array([0.02, 0.004])


def prior(lower=0.8, upper=1.25, slots=SLOTS, **other):
    base = GAIT.controls[slots]
    change = CHANGE[[SLOTS.index(slot) for slot in slots]]
    low, high = np.minimum(lower * base, base), np.maximum(upper * base, base)
    if slots[0] == Slot.TOUCHDOWN_ANGLE:
        low[0], high[0] = base[0] - 0.1, min(base[0] + 0.1, np.arcsin(GAIT.apex[1]) - 0.005)
    values = {"rounds": 8, **other}
    table = np.array([base, change, low, high])
    return Prior(GAIT.controls.copy(), list(slots), table, **values)


def cost(u, aim, its):
    end, outcome = STEP.step(GAIT.apex, u)
    if outcome is not Outcome.SECTION:
        return np.inf
    parts = (end - aim) / TOLERANCE, (u[its.slots] - its.base) / its.change
    return float(np.sum(np.concatenate(parts) ** 2))


def test_the_target_that_the_base_reaches_leaves_it_alone():
    u, end = solve_stride(FromSection(STEP, GAIT.apex, SLOTS), GAIT.apex, prior(), TOLERANCE)
    np.testing.assert_allclose(u, GAIT.controls, rtol=1e-9)
    np.testing.assert_allclose(end, GAIT.apex, atol=1e-9)


AIMS = {"faster": st.floats(-0.3, 0.3), "higher": st.floats(-0.03, 0.03)}


@given(**AIMS)
@settings(max_examples=40, deadline=None)
def test_it_lowers_the_cost_within_its_bounds(faster, higher):
    aim, its = GAIT.apex + [faster, higher], prior()
    u, end = solve_stride(FromSection(STEP, GAIT.apex, SLOTS), aim, its, TOLERANCE)
    assert np.all(u[SLOTS] >= its.lower)
    assert np.all(u[SLOTS] <= its.upper)
    np.testing.assert_array_equal(u[3:], GAIT.controls[3:])
    np.testing.assert_allclose(STEP.step(GAIT.apex, u)[0], end, atol=1e-12)
    assert cost(u, aim, its) <= cost(GAIT.controls, aim, its) + 1e-12


@given(**AIMS, seed=st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_no_control_near_by_is_cheaper(faster, higher, seed):
    aim, its = GAIT.apex + [faster / 5, higher / 5], prior(rounds=20)
    u, _ = solve_stride(FromSection(STEP, GAIT.apex, SLOTS), aim, its, TOLERANCE)
    other = u.copy()
    change = its.change * np.random.default_rng(seed).normal(0.0, 0.05, 3)
    other[SLOTS] = np.clip(u[SLOTS] + change, its.lower, its.upper)
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
    its = Prior(GAIT.controls.copy(), SLOTS, np.array([base, change, low, high]), 10)
    _, end = solve_stride(FromSection(STEP, start, SLOTS), aim, its, TOLERANCE)
    assert np.all(np.abs(end - aim) < [0.06, 0.002])


def test_differences_agree_with_exact_derivatives():
    def ahead(u):
        return STEP.step(GAIT.apex, u)

    exact = STEP.linearise(GAIT.apex, GAIT.controls)
    size = GAIT.controls[SLOTS]
    for stride in (FromSection(STEP, GAIT.apex, SLOTS), FromHere(ahead, SLOTS)):
        end, jacobian, outcome = stride.slopes(GAIT.controls)
        assert outcome is Outcome.SECTION
        np.testing.assert_allclose(end, exact.state, atol=1e-12)
        np.testing.assert_allclose(
            jacobian * size, exact.control_jacobian[:, SLOTS] * size, atol=1e-4
        )
        np.testing.assert_array_equal(stride.at(GAIT.controls)[0], end)


def test_an_end_that_a_difference_spoils_is_told():
    def brittle(u):
        return GAIT.apex, Outcome.SECTION if u[1] == GAIT.controls[1] else Outcome.FALL

    _, jacobian, outcome = FromHere(brittle, SLOTS).slopes(GAIT.controls)
    assert outcome is Outcome.FALL
    assert not jacobian.any()


def test_a_grid_is_tried_where_the_base_fails_and_none_is_said_where_it_does_too():
    good = GAIT.controls[SLOTS]

    def ahead(u):
        near = np.all(np.abs(u[SLOTS] / good - 1.0) < 0.15)
        return (GAIT.apex, Outcome.SECTION) if near else (np.zeros(2), Outcome.FALL)

    base = good * [1.0, 1.4, 1.4]
    wide = Prior(GAIT.controls, SLOTS, np.array([base, CHANGE, good * 0.6, good * 1.4]), 3)
    u, end = solve_stride(FromHere(ahead, SLOTS), GAIT.apex, wide, TOLERANCE)
    assert end is not None
    assert ahead(u)[1] is Outcome.SECTION
    table = np.array([base, CHANGE, base * 0.98, base * 1.02])
    narrow = Prior(GAIT.controls, SLOTS, table, 3)
    u, end = solve_stride(FromHere(ahead, SLOTS), GAIT.apex, narrow, TOLERANCE)
    assert end is None
    np.testing.assert_array_equal(u[SLOTS], base)


def test_it_shortens_a_step_that_goes_where_the_stride_fails():
    def ahead(u):
        value = u[Slot.K_SC] / GAIT.controls[Slot.K_SC]
        return np.array([value]), Outcome.SECTION if value < 1.2 else Outcome.FALL

    its = prior(slots=[int(Slot.K_SC)], lower=0.5, upper=2.0, rounds=8)
    u, end = solve_stride(FromHere(ahead, its.slots), np.array([1.8]), its, np.array([0.01]))
    assert 1.15 < end[0] < 1.2
    assert u[Slot.K_SC] == pytest.approx(end[0] * GAIT.controls[Slot.K_SC])


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
