"""Strides close to one that is solved: the same controls, without derivatives of their own."""

from dataclasses import replace

import numpy as np
import pytest

from template_control.embedding.planners.planner import ANY_ANGLE, Context
from template_control.embedding.planners.running import RunningPlanner
from template_control.slip.control.stride_solver import (
    FromSection,
    NearbyStrides,
    Prior,
    solve_stride,
)
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
TOLERANCE = np.array([0.02, 0.004])
NEAR, FAR = np.array([0.004, 0.0008]), np.array([0.03, 0.0])


class Counted(ReturnMap):
    """Counts how often its derivatives are taken."""

    taken = 0

    def derivatives(self, *arguments):
        self.taken += 1
        return super().derivatives(*arguments)


@pytest.fixture(scope="module")
def gait():
    return running_gait(P, 3.0)


@pytest.fixture
def step():
    return Counted(P, "r")


def prior_of(gait, z, angles=ANY_ANGLE):
    planner = RunningPlanner(gait)
    table = planner.bounds(z, gait, angles)
    return Prior(gait.controls, [0, 1, 2], table, planner.options.rounds)


def exactly(stride, aim, prior):
    """The solution to rounding."""
    search = prior.search._replace(close=1e-7)
    return solve_stride(stride, aim, replace(prior, rounds=30, search=search), TOLERANCE)[0]


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_near_stride_needs_no_derivatives(gait, step, held, sign):
    nearby, aim = NearbyStrides(TOLERANCE, 0.5), gait.apex + [0.018, -0.001]
    angle = float(gait.controls[0]) + 0.002
    taken = []
    for z in (gait.apex, gait.apex + 0.1 * NEAR, gait.apex + sign * NEAR):
        prior = prior_of(gait, z, (angle, angle) if held else ANY_ANGLE)
        before = step.taken
        u, end = nearby.solve(FromSection(step, z, prior.slots), aim, prior)
        taken.append(step.taken - before)
        np.testing.assert_allclose(end, step.step(z, u)[0], rtol=0.0, atol=1e-4)
        best = exactly(FromSection(step, z, prior.slots), aim, prior)
        off = abs(u - best)[prior.slots] / prior.change
        assert off.max() < 0.02
    assert taken[0] > 1, "the first stride is solved on its own"
    assert taken[1:] == [1, 0], "the second asks for its derivatives, and the third for none"


@pytest.mark.parametrize(("near", "away"), [(0.5, FAR), (0.0, 0.1 * NEAR)])
def test_other_strides_are_solved_on_their_own(gait, step, near, away):
    nearby = NearbyStrides(TOLERANCE, near)
    for z in (gait.apex, gait.apex + away):
        prior = prior_of(gait, z)
        stride = FromSection(step, z, prior.slots)
        u, end = nearby.solve(stride, gait.apex, prior)
        alone, its_end = solve_stride(stride, gait.apex, prior, TOLERANCE)
        np.testing.assert_array_equal(u, alone)
        np.testing.assert_array_equal(end, its_end)


def test_a_planner_that_is_reset_decides_as_a_new_one(gait):
    planner, z = RunningPlanner(gait), gait.apex + NEAR
    first = RunningPlanner(gait)
    first.reset()
    for state in (gait.apex, gait.apex + 0.5 * NEAR):
        planner.decide(Context(state))
    planner.reset()
    np.testing.assert_array_equal(
        planner.decide(Context(z)).controls, first.decide(Context(z)).controls
    )
