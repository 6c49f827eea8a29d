"""Residuals on a planner's controls."""

import numpy as np
import pytest

import template_control as tc
from template_control.embedding import Context, ResidualPlanner
from template_control.slip import Slot


def test_without_a_residual_a_walk_is_the_planner_s(default_gait, short_walk):
    planner = ResidualPlanner(tc.LqrPlanner(default_gait))
    same = tc.simulate(tc.Experiment("five-link", planner=planner, steps=4))
    np.testing.assert_array_equal(same.com, short_walk.com)
    np.testing.assert_array_equal(same.section_controls, short_walk.section_controls)


@pytest.mark.parametrize("angles", [(-np.inf, np.inf), (-np.inf, np.radians(66.2))])
def test_the_template_ends_where_the_decision_says(default_gait, angles):
    planner = ResidualPlanner(tc.LqrPlanner(default_gait))
    planner.residual[[Slot.TOUCHDOWN_ANGLE, Slot.K_SD]] = 0.02, -500.0
    context = Context(default_gait.state, angles=angles)
    plain, decision = planner.planner.decide(context), planner.decide(context)
    added = decision.controls - plain.controls
    assert added[Slot.K_SD] == pytest.approx(-500.0)
    assert decision.controls[Slot.TOUCHDOWN_ANGLE] == pytest.approx(
        min(plain.controls[Slot.TOUCHDOWN_ANGLE] + 0.02, angles[1])
    )
    end, _ = tc.ReturnMap(default_gait.parameters, default_gait.stride).step(
        default_gait.state, decision.controls
    )
    np.testing.assert_allclose(decision.predicted, end + planner.offset, atol=1e-12)
    assert np.abs(decision.predicted - plain.predicted).max() > 1e-3


@pytest.mark.slow(seconds=1)
def test_a_residual_is_not_learnt_as_the_robot_s_offset(default_gait):
    offsets = []
    for residual in (0.0, 0.015):
        planner = ResidualPlanner(tc.LqrPlanner(default_gait))
        planner.residual[Slot.TOUCHDOWN_ANGLE] = residual
        record = tc.simulate(tc.Experiment("five-link", planner=planner, steps=8))
        assert not record.fell
        offsets.append(planner.offset.copy())
    # A constant of 0.015 rad moves the next VLO by 0.03 m/s: it would be an offset as large.
    assert np.abs(offsets[1] - offsets[0]).max() < 0.01


def test_a_stride_that_the_template_cannot_do_is_the_planner_s_own(default_gait):
    planner = ResidualPlanner(tc.LqrPlanner(default_gait))
    planner.residual[Slot.TOUCHDOWN_ANGLE] = 0.4
    context = Context(default_gait.state)
    decision, plain = planner.decide(context), planner.planner.decide(context)
    np.testing.assert_array_equal(decision.controls, plain.controls)
