"""Pushes of a walk at other speeds than the default one's."""

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.planners.planner import Context
from template_control.slip.similarity import REFERENCE


@pytest.mark.parametrize("speed", np.arange(0.3, 1.46, 0.1))
def test_the_earliest_touchdown_leaves_the_gaits_alone(speed):
    """A fast gait's foot is down before a slow one's could be."""
    gait = tc.gait_for_speed(REFERENCE, float(speed))
    for rise in (-0.01, 0.0, 0.01):
        assert tc.LqrPlanner(gait).decide(Context(gait.vlo + [0.0, 0.0, rise])).nominal


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(
    # The template's next touchdown came 16 ms after VLO; before the push was over it lay behind;
    # and it was about to take off, where only a run can catch it.
    ("speed", "impulse", "phase"),
    [(0.8, -15.0, 0.5), (0.6, 15.0, 0.2), (1.4, 15.0, 0.4)],
)
def test_a_pushed_robot_puts_its_foot_down_in_time_and_walks_on(speed, impulse, phase):
    robot = tc.load_robot("five-link")
    gait = tc.gait_for_speed(tc.template_for(robot), speed)
    record = tc.simulate(
        tc.Experiment(
            robot,
            planner=tc.LqrPlanner(gait),
            steps=15,
            pushes=(tc.Push(impulse, step=4, phase=phase),),
            record_every=5,
        )
    )
    assert (record.steps, record.fell) == (15, False)
    assert record.section_state[-1, 0] == pytest.approx(gait.vlo[0], rel=0.05)


@pytest.mark.slow(seconds=4)
def test_the_fastest_walk_does_not_sway_more_and_more():
    """With straight legs at VLO large changes of the controls made it fall at step 45."""
    robot = tc.load_robot("five-link")
    gait = tc.robot_gait_for_speed(robot, tc.walking_speeds(robot)[1])
    record = tc.simulate(
        tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=50, record_every=10)
    )
    assert (record.steps, record.fell) == (50, False)
    error = record.section_state[-20:] - gait.vlo
    assert np.all(np.abs(error.mean(axis=0)) < [0.0145, 0.003, 0.02])
    assert np.all(error.std(axis=0) < [0.03, 0.004, 0.04])


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(
    # Steps that bent the knees to their limit; a leg that sank, and a planner that gave up then.
    ("impulse", "phase"),
    [(-50.0, 0.0), (-50.0, 0.2), (-50.0, 0.6), (45.0, 0.3)],
)
def test_the_default_walk_takes_a_hard_push(impulse, phase):
    robot = tc.load_robot("five-link")
    planner = tc.LqrPlanner(tc.default_gait(robot))
    record = tc.simulate(
        tc.Experiment(
            robot,
            planner=planner,
            steps=15,
            pushes=(tc.Push(impulse, step=4, phase=phase),),
            record_every=5,
        )
    )
    assert (record.steps, record.fell) == (15, False)
    assert record.section_state[-1, 0] == pytest.approx(planner.gait.vlo[0], rel=0.03)
