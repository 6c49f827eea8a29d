"""One command of the speed: a robot stands, walks, runs and stands again."""

from dataclasses import replace

import numpy as np
import pytest
from places import EXAMPLES

import template_control as tc
from template_control.run import VelocityProfile
from template_control.run.summary import step_widths


@pytest.mark.slow(seconds=4)
def test_five_link_stands_walks_runs_and_stands_again():
    record = tc.simulate(tc.Experiment.load(EXAMPLES / "zero_run_zero.toml"))
    assert not record.fell
    speed, time = record.section_state[:, 0], record.section_time
    np.testing.assert_allclose(speed[time < 1.5], 0.0, atol=0.01)
    assert speed[(time > 5.0) & (time < 12.0)].max() == pytest.approx(2.2, rel=0.02)
    np.testing.assert_allclose(speed[-1], 0.0, atol=0.01)
    assert record.summary.qp_failures == 0


@pytest.mark.slow(seconds=4)
def test_a_floating_base_walks_runs_and_walks_again():
    """It turns as it breaks into the run, and is then 2 mm next to the section decided at.

    On its way back it hops backward, which turns nothing.
    """
    motion = VelocityProfile(
        ((0.0, 1.2, 0.043, 0.311), (4.0, -0.24, 0.0, 0.0), (10.0, 0.6, 0.0, 0.0)),
        duration=15.0,
        foreseen=False,
        gaits=("walk", "run"),
    )
    record = tc.simulate(tc.Experiment(tc.load_floating_robot("bolt"), motion))
    assert not record.fell
    assert record.section_state[:, 0].max() == pytest.approx(1.2, rel=0.03)
    hopping = (record.section_time > 8.5) & (record.section_time < 10.0)
    np.testing.assert_allclose(record.section_state[hopping, 0], -0.24, atol=0.05)
    assert not record.facing.any()
    last = record.time > record.time[-1] - 1.0
    way = np.ptp(record.space_com[last, :2], axis=0)
    # The speed that is asked for is the mean one; at VLO a walk is slower.
    assert np.hypot(*way) / np.ptp(record.time[last]) == pytest.approx(0.6, rel=0.1)


@pytest.mark.slow(seconds=7)
@pytest.mark.parametrize("stops", [6.5, 6.8])
def test_go2_stands_trots_and_stands_again(stops):
    """It comes to a stand in 4.4 to 5.7 s: how many steps it takes depends on the stop's moment."""
    rows = ((0.0, 0.0), (1.0, 0.5), (2.5, 1.0), (stops, 0.0))
    motion = VelocityProfile(
        tuple((time, speed, 0.0, 0.0) for time, speed in rows),
        duration=stops + 6.0,
        gaits=("stand", "walk", "run"),
    )
    record = tc.simulate(tc.Experiment(tc.load_floating_robot("go2"), motion))
    assert not record.fell
    assert record.section_state[:, 0].max() == pytest.approx(1.0, rel=0.03)
    np.testing.assert_allclose(record.section_state[-1, 0], 0.0, atol=0.01)
    assert record.summary.qp_failures == 0


@pytest.mark.slow(seconds=8)
def test_g1_stands_runs_and_stands_again():
    given = tc.Experiment.load(EXAMPLES / "zero_run_zero.toml")
    record = tc.simulate(replace(given, robot=tc.robot.RobotSpec("g1", free=True)))
    assert record.fall_reason == ""
    speed = record.section_state[:, 0]
    runs = [stride == "r" for stride in record.kinds_of_stride]
    # From the seventh apex on, until it slows down.
    assert speed[runs][6:8] == pytest.approx(1.354, rel=0.02)
    assert abs(speed[-1]) < 0.01
    assert np.abs(record.attitude[:, 2]).max() < 0.6
    assert record.summary.qp_failures == 0


def test_a_robot_on_two_points_does_not_stand():
    motion = VelocityProfile(((0.0, 0.6, 0.0, 0.0),), duration=1.0, gaits=("stand", "walk"))
    with pytest.raises(tc.TemplateControlError, match="leave stand out of its gaits"):
        tc.simulate(tc.Experiment(tc.load_floating_robot("bolt"), motion))


def test_what_a_planar_robot_cannot_do_is_refused():
    motion = VelocityProfile(((0.0, 0.6, 0.1, 0.0),), duration=1.0)
    with pytest.raises(tc.TemplateControlError, match="no velocity to the left"):
        tc.simulate(tc.Experiment(tc.load_robot("five-link"), motion))


@pytest.mark.slow(seconds=7)
def test_go2_goes_aside_and_turns_and_comes_back_backward():
    rows = ((0.0, 0.5, 0.2, 0.5), (3.5, -0.4, 0.0, 0.0))
    motion = VelocityProfile(rows, duration=10.0, foreseen=False, gaits=("stand", "walk"))
    record = tc.simulate(tc.Experiment(tc.load_floating_robot("go2"), motion))
    assert isinstance(record, tc.run.FloatingRecord)
    assert not record.fell
    velocity = np.gradient(record.space_com[:, :2], record.time, axis=0)
    turn = record.heading[:, None]
    ahead, left = np.hsplit(velocity, 2)
    forward = np.cos(turn) * ahead + np.sin(turn) * left
    aside = np.cos(turn) * left - np.sin(turn) * ahead
    going, back = (record.time > 2.0) & (record.time < 3.4), record.time > 8.0
    assert aside[going].mean() == pytest.approx(0.2, abs=0.04)
    assert forward[back].mean() == pytest.approx(-0.4, abs=0.02)
    assert aside[back].mean() == pytest.approx(0.0, abs=0.01)
    assert record.heading[-1] > 0.6
    # The trunk turns by 0.12 rad a step at most, whatever is commanded.
    turned = record.section_velocity[1:-1, 2] * np.diff(record.section_time)[1:]
    assert 0.1 < turned[record.section_time[1:-1] < 3.5].max() < 0.13
    # The pairs of feet step behind each other, whichever way the trunk faces.
    assert np.abs(step_widths(record)).max() < 0.06
    assert record.section_velocity[-2] == pytest.approx((-0.4, 0.0, 0.0), abs=0.01)
    assert np.abs(record.attitude[:, :2]).max() < 0.05
    assert record.summary.qp_failures == 0


@pytest.mark.slow(seconds=6)
def test_five_link_walks_backward_and_forward_from_and_to_a_stand():
    record = tc.simulate(tc.Experiment.load(EXAMPLES / "zero_back_zero.toml"))
    assert not record.fell
    time, speed = record.time, record.com_velocity[:, 0]
    # Until the VLO at which it stops.
    assert speed[(time > 2.5) & (time < 4.2)].mean() == pytest.approx(-0.4, abs=0.02)
    assert speed[(time > 9.0) & (time < 10.2)].mean() == pytest.approx(0.6, abs=0.05)
    assert abs(speed[-1]) < 0.01
    # At a section dx/dt is along the way that the robot goes; template and feet are the world's.
    assert record.section_state[:, 0].min() > -0.01
    np.testing.assert_allclose(record.template_com, record.com, atol=0.03)
    assert record.summary.qp_failures == 0


@pytest.mark.slow(seconds=6)
def test_g1_walks_backward_and_to_the_left_from_and_to_a_stand():
    rows = ((0.0, 0.0, 0.0, 0.0), (0.2, -0.5, 0.05, 0.0), (6.0, 0.0, 0.0, 0.0))
    motion = VelocityProfile(rows, duration=8.0, foreseen=False, gaits=("stand", "walk"))
    record = tc.simulate(tc.Experiment(tc.load_floating_robot("g1"), motion))
    assert isinstance(record, tc.run.FloatingRecord)
    assert not record.fell
    # Over four steps on the gait: the CoM sways from foot to foot.
    begun = record.section_time[[3, 7]]
    ahead, left = np.diff(record.space_com[np.searchsorted(record.time, begun), :2], axis=0)[0]
    assert ahead / np.diff(begun)[0] == pytest.approx(-0.5, abs=0.05)
    assert left / np.diff(begun)[0] == pytest.approx(0.05, abs=0.02)
    assert record.section_course[3:7, 3] == pytest.approx(np.pi)
    assert abs(record.section_state[-1, 0]) < 0.01
    assert np.abs(record.attitude).max() < 0.15
    assert record.summary.qp_failures == 0


def test_a_biped_on_points_does_not_go_backward():
    motion = VelocityProfile(((0.0, -0.5, 0.0, 0.0),), duration=1.0)
    with pytest.raises(tc.TemplateControlError, match="does not go backward"):
        tc.simulate(tc.Experiment(tc.load_floating_robot("bolt"), motion))
