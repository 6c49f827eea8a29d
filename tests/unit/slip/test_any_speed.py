"""Every speed within the range that is told has a gait, and the range is always the same."""

import re

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.errors import GaitError
from template_control.robot.library import ROBOTS
from template_control.slip.gaits.walking_by_speed import speed_range, walking_by_speed, walking_gait

P = tc.SlipParameters()


def told(parameters, speed):
    with pytest.raises(GaitError) as caught:
        tc.gait_for_speed(parameters, speed)
    low, high = re.search(r"from ([\d.]+) to ([\d.]+) m/s", str(caught.value)).groups()
    return float(low), float(high)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_mean_speed_in_the_told_range_has_a_gait(name):
    template = tc.template_for(tc.load_robot(name))
    low, high = walking_by_speed().range(template)
    assert {told(template, speed) for speed in (0.3 * low, high + 0.01)} == {(low, high)}
    speeds = np.linspace(low, high, 7)
    gaits = [tc.gait_for_speed(template, speed) for speed in speeds]
    np.testing.assert_allclose([gait.mean_speed for gait in gaits], speeds, atol=1e-8)


@pytest.mark.parametrize("speed", [0.99, 1.03, 1.04, 1.05, 1.06, 1.07])
def test_speeds_that_had_no_gait_have_one(speed):
    angle = np.radians(67.0)
    gait = tc.gait_for_speed(P, speed, touchdown_angle=angle)
    assert gait.mean_speed == pytest.approx(speed, abs=1e-8)
    near = [tc.gait_for_speed(P, other, touchdown_angle=angle) for other in (0.98, 1.08)]
    assert near[0].vlo[0] < gait.vlo[0] < near[1].vlo[0]
    assert near[0].vlo[1] < gait.vlo[1] < near[1].vlo[1]


def test_a_gait_is_found_where_another_return_to_level_flight_is_next_to_it():
    # Both roots of dy/dt lay between two heights of the search: it saw no change of sign.
    unit = np.sqrt(P.gravity * P.rest_length)
    gait = walking_gait(P, 0.26 * unit)
    step, _ = tc.ReturnMap(P).step(gait.vlo, gait.controls)
    np.testing.assert_allclose(step, gait.vlo, atol=1e-9)


@pytest.mark.slow(seconds=1)
def test_the_family_by_speed_at_vlo_has_no_hole():
    gaits = [walking_gait(P, speed) for speed in np.linspace(*speed_range(P), 201)]
    assert np.all(np.diff([gait.mean_speed for gait in gaits]) > 0.0)


def test_a_leg_that_is_too_soft_for_an_angle_is_told():
    soft = tc.SlipParameters(leg_stiffness=2000.0)
    with pytest.raises(GaitError, match="give another angle, or none"):
        tc.gait_for_speed(soft, 1.1, touchdown_angle=np.radians(66.0))
    # Without an angle the gait has a stiffness of its own.
    assert tc.gait_for_speed(soft, 1.1).parameters.leg_stiffness > 15e3


def test_the_command_tells_the_same_range(capsys, tmp_path):
    lines = set()
    for speed in ("0.1", "2"):
        assert main(["walk", "--speed", speed, "--output", str(tmp_path)]) == 2
        lines.add(capsys.readouterr().err.split(": ")[-1])
    assert lines == {"give one from 0.30 to 1.45 m/s\n"}


@pytest.mark.slow(seconds=6)
@pytest.mark.parametrize(("name", "speed"), [("five-link", 1.05), ("rabbit", 0.85), ("bolt", 0.59)])
def test_the_robot_walks_at_speeds_that_had_no_gait(name, speed):
    robot = tc.load_robot(name)
    planner = tc.LqrPlanner(tc.gait_for_speed(tc.template_for(robot), speed))
    record = tc.simulate(tc.Experiment(robot, planner=planner, steps=15, record_every=5))
    assert (record.steps, record.fell) == (15, False)
