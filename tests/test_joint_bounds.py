"""When a joint's acceleration needs bounds, against the rule written out with numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from template_control.whole_body.joint_bounds import JointBounds, JointTuning, before_stops

RANGES = np.array([[-2.0, 1.5], [0.0, 2.5]])
TUNING = JointTuning(speed_share=0.8, speed_horizon=0.02, stop_share=0.4, stop_horizon=0.05)

angles = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)
rates = st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)).map(np.array)


@given(angles, rates)
def test_a_joint_nears_a_stop_as_the_rule_says(place, speed):
    low, high = TUNING.speed_share * (RANGES.T - place)
    way = TUNING.stop_horizon * speed
    expected = bool(np.any((way <= low) | (way >= high)))
    assert before_stops(place, speed, RANGES, TUNING.speed_share, TUNING.stop_horizon) == expected


@pytest.mark.parametrize(
    ("knee", "fastest", "needed"),
    [(-1.0, 0.3, False), (-1.0, 0.5, False), (-20.0, 0.5, True), (-20.0, 0.3, False)],
)
def test_stops_are_looked_at_when_joints_are_fast(robot, knee, fastest, needed):
    robot.joint_angle[:] = 0.0, 0.5, 0.0, 0.5
    robot.joint_velocity[:] = 0.0, knee, 0.0, 0.0
    robot.fastest = fastest
    assert JointBounds(robot, TUNING).needed() is needed
    robot.fastest = 0.9
    assert JointBounds(robot, TUNING).needed(), "near the limit of speed"
