"""When a joint's acceleration needs bounds, against the rule written out with numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from template_control.robot.terms import joint_reserve
from template_control.whole_body.problem import bounds_needed
from template_control.whole_body.solver import QpOptions, WholeBodyQp

RANGES = np.array([[-2.0, 1.5], [0.0, 2.5]])
LIMITS = np.array([10.0, 20.0])
JOINTS = np.vstack((LIMITS, *RANGES.T))
TUNING = QpOptions(speed_share=0.8, speed_horizon=0.02, stop_share=0.4, stop_horizon=0.05)

turning = st.floats(-30.0, 30.0, allow_subnormal=False)
angles = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)
rates = st.tuples(turning, turning).map(np.array)


@given(angles, rates)
def test_a_joint_nears_a_stop_as_the_rule_says(place, speed):
    low, high = TUNING.speed_share * (RANGES.T - place)
    way = TUNING.stop_horizon * speed
    expected = bool(np.any((way <= low) | (way >= high)))
    configuration = np.concatenate(([7.0, -7.0], place))  # a base stands before the joints
    fastest, soonest = joint_reserve(configuration, speed, JOINTS)
    assert fastest == np.abs(speed / LIMITS).max()
    # The rule multiplies where the function divides: they round differently.
    border = TUNING.stop_horizon / TUNING.speed_share
    if not np.all((place > RANGES[:, 0]) & (place < RANGES[:, 1])):
        assert soonest == 0.0, "a joint at its stop is always looked at"
    elif soonest != pytest.approx(border, rel=1e-12):
        assert (soonest < border) == expected


@pytest.mark.parametrize(
    ("place", "speed", "soonest"),
    [
        ((0.5, 1.0), (0.0, 0.0), np.inf),
        ((0.5, 1.0), (2.0, 0.0), 0.5),
        ((0.5, 1.0), (2.0, -4.0), 0.25),
        ((1.5, 1.0), (-1.0, 0.0), 0.0),
        ((0.0, -0.1), (0.0, 5.0), 0.0),
    ],
)
def test_the_soonest_stop(place, speed, soonest):
    found = joint_reserve(np.array(place), np.array(speed), JOINTS)[1]
    assert found == pytest.approx(soonest)


@pytest.mark.parametrize(
    ("knee", "fastest", "needed"),
    [(-1.0, 0.3, False), (-1.0, 0.5, False), (-20.0, 0.5, True), (-20.0, 0.3, False)],
)
def test_stops_are_looked_at_when_joints_are_fast(robot, knee, fastest, needed):
    q, v = robot.neutral(), np.zeros(robot.nv)
    q[[4, 6]] = 0.5
    v[4] = knee
    robot.update(q, v)
    assert robot.soonest_stop == pytest.approx(0.5 / -knee)
    qp = WholeBodyQp(robot, TUNING)
    robot.fastest = fastest
    assert bounds_needed(qp.data[0], robot.data[0]) is needed
    robot.fastest = 0.9
    assert bounds_needed(qp.data[0], robot.data[0]), "near the limit of speed"
