"""One command of the speed: a robot stands, walks, runs and stands again."""

import numpy as np
import pytest
from places import EXAMPLES

import template_control as tc
from template_control.run import VelocityProfile


@pytest.mark.slow(seconds=14)
def test_five_link_stands_walks_runs_and_stands_again():
    record = tc.simulate(tc.Experiment.load(EXAMPLES / "zero_run_zero.toml"))
    assert not record.fell
    speed, time = record.section_state[:, 0], record.section_time
    np.testing.assert_allclose(speed[time < 1.5], 0.0, atol=0.01)
    assert speed[(time > 5.0) & (time < 12.0)].max() == pytest.approx(2.2, rel=0.02)
    np.testing.assert_allclose(speed[-1], 0.0, atol=0.01)
    assert record.summary.qp_failures == 0


@pytest.mark.slow(seconds=8)
def test_a_floating_base_walks_runs_and_walks_again():
    motion = VelocityProfile(
        ((0.0, 0.6, 0.0, 0.0), (1.0, 1.2, 0.0, 0.0), (6.0, 0.6, 0.0, 0.0)),
        duration=10.0,
        gaits=("walk", "run"),
    )
    record = tc.simulate(tc.Experiment(tc.load_floating_robot("bolt"), motion))
    assert not record.fell
    assert record.section_state[:, 0].max() == pytest.approx(1.2, rel=0.03)
    assert record.section_state[-1, 0] == pytest.approx(0.54, rel=0.05)


@pytest.mark.slow(seconds=6)
def test_go2_stands_trots_and_stands_again():
    rows = ((0.0, 0.0), (1.0, 0.5), (2.5, 1.0), (6.5, 0.0))
    motion = VelocityProfile(
        tuple((time, speed, 0.0, 0.0) for time, speed in rows),
        duration=11.5,
        gaits=("stand", "walk", "run"),
    )
    record = tc.simulate(tc.Experiment(tc.load_floating_robot("go2"), motion))
    assert not record.fell
    assert record.section_state[:, 0].max() == pytest.approx(1.0, rel=0.03)
    np.testing.assert_allclose(record.section_state[-1, 0], 0.0, atol=0.01)
    assert record.summary.qp_failures == 0


def test_a_robot_on_two_points_does_not_stand():
    motion = VelocityProfile(((0.0, 0.6, 0.0, 0.0),), duration=1.0, gaits=("stand", "walk"))
    with pytest.raises(tc.TemplateControlError, match="leave stand out of its gaits"):
        tc.simulate(tc.Experiment(tc.load_floating_robot("bolt"), motion))


def test_what_a_planar_robot_cannot_do_is_refused():
    motion = VelocityProfile(((0.0, 0.6, 0.1, 0.0),), duration=1.0)
    with pytest.raises(tc.TemplateControlError, match="no velocity to the left"):
        tc.simulate(tc.Experiment(tc.load_robot("five-link"), motion))
