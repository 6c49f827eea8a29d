"""Five-links run in space on the planar template, and change between walking and running."""

import numpy as np
import pytest
from places import EXAMPLES

import template_control as tc
from template_control.run.options import Push
from template_control.run.specs import GaitSpec
from template_control.slip import load_scenario


def run(name, speed, steps, **options):
    robot = tc.load_floating_robot(name)
    return tc.simulate(
        tc.Experiment(robot, motion=GaitSpec("run", speed=speed), steps=steps, **options)
    )


def settled(record):
    """Samples from the seventh section on."""
    return record.time > record.section_time[6]


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("name", "speed"), [("five-link-3d", 2.0), ("runner-3d", 4.0)])
def test_it_runs_straight_at_its_speed(name, speed):
    record = run(name, speed, 30)
    assert not record.fell, record.fall_reason
    np.testing.assert_allclose(record.section_state[-5:, 0], speed, rtol=0.01)
    yaw = record.attitude[settled(record), 2]
    assert abs(yaw.mean()) < 0.05
    # Each foot lands on its own side, and the run does not drift.
    assert abs(record.space_com[-1, 1]) < 0.2
    assert np.all(np.abs(record.torque) <= record.torque_limit + 1e-9)
    assert record.solved.all()


@pytest.mark.slow(seconds=4)
def test_a_push_from_the_side_is_run_off():
    push = Push(20.0, step=6, phase=0.3, direction=0.5 * np.pi)
    record = run("five-link-3d", 2.5, 18, pushes=(push,))
    assert not record.fell, record.fall_reason
    np.testing.assert_allclose(record.section_state[-3:, 0], 2.5, rtol=0.02)


@pytest.mark.slow(seconds=4)
def test_a_turn_is_leant_into():
    record = run("five-link-3d", 2.0, 26, course=tc.HeadingCommand(turning_rate=0.6))
    assert not record.fell, record.fall_reason
    assert record.heading[-1] > 3.5
    leant = record.attitude[record.section_time[-7] < record.time, 0].mean()
    assert leant == pytest.approx(-np.arctan2(0.6 * 2.0, 9.81), abs=0.04)
    # Feet that land where the heading has turned to need no torque at its limit.
    assert record.summary.saturated_share < 0.01


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(
    ("name", "file", "walk", "run"),
    [
        ("five-link-3d", "walk_run_walk.toml", 1.1, 3.0),
        ("bolt", "bolt_walk_run_walk.toml", 0.6, 1.5),
    ],
)
def test_it_walks_runs_and_walks(name, file, walk, run):
    robot, scenario = tc.load_floating_robot(name), load_scenario(EXAMPLES / file)
    record = tc.simulate(tc.Experiment(robot, motion=scenario))
    assert not record.fell, record.fall_reason
    assert record.arrived
    assert record.section_state[:, 0].max() == pytest.approx(run, abs=0.1)
    np.testing.assert_allclose(record.section_state[-3:, 0], walk, atol=0.05)
