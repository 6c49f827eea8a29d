"""A step that ends sooner, where its foothold would be out of reach to the left or right."""

from math import radians

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.free.lateral import (
    STEEPER,
    LateralForecast,
    early_touchdown,
    lateral_forecast,
)
from template_control.embedding.planners.planner import Decision
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Slot
from template_control.slip.lateral.placing import LateralAim, Placement

ANGLE = 1.2


def decision(angle, feasible=True):
    controls = np.zeros(NUM_SLOTS)
    controls[Slot.TOUCHDOWN_ANGLE] = angle
    return Decision(controls, np.zeros(3), feasible, feasible, True)


def chosen(outlooks, feasible=(True, True, True)):
    """The touchdown angle over the first one, where steeper steps look so; whether nominal."""
    first = decision(ANGLE)
    seen = {ANGLE: outlooks[0]}
    seen |= {ANGLE + more: out for more, out in zip(STEEPER, outlooks[1:], strict=True)}
    done = dict(zip((ANGLE + more for more in STEEPER), feasible, strict=True))
    best = early_touchdown(
        first,
        lambda least: decision(least, done[least]),
        lambda d: LateralForecast(*seen[float(d.controls[Slot.TOUCHDOWN_ANGLE])]),
    )
    return round(float(best.controls[Slot.TOUCHDOWN_ANGLE]) - ANGLE, 6), best.nominal


def test_a_foothold_in_reach_is_left_alone():
    assert chosen([(0.02, 5.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)]) == (0.0, True)


def test_a_step_whose_path_comes_to_no_section_gives_way_to_one_that_does():
    unknown = float("nan"), float("nan")
    assert chosen([unknown, unknown, (0.0, 2.0), (0.0, 1.0)]) == (0.06, False)
    assert chosen(4 * [unknown]) == (0.0, True)


def test_the_step_that_leaves_the_least_error_is_taken():
    assert chosen([(0.1, 5.0), (0.1, 3.0), (0.0, 2.0), (0.0, 2.5)]) == (0.04, False)
    assert chosen([(0.1, 5.0), (0.1, 4.5), (0.1, 4.2), (0.1, 4.1)]) == (0.0, True)


def test_steps_that_the_template_cannot_make_are_not_taken():
    outlooks = [(0.1, 5.0), (0.1, 3.0), (0.0, 1.0), (0.0, 0.0)]
    assert chosen(outlooks, feasible=(True, False, True)) == (0.02, False)


def test_an_outlook_is_what_the_bounds_leave():
    aim = LateralAim(
        state=np.array([0.1, 0.2]),
        step=0.2,
        cost=np.diag([3.0, 5.0]),
        step_cost=1.0,
        offset=np.zeros(2),
        steps=np.array([0.1, 0.6]),
        reach=0.4,
    )
    found = Placement(0.6, 0.75, 0.1, 0.3, np.array([0.5, 0.2]), np.array([-0.2, -0.5]))
    seen = lateral_forecast(found, aim)
    assert seen.beyond == pytest.approx(0.15)
    left = found.expected + found.slope * 0.6 - (0.6, 0.0) - aim.state
    assert seen.price == pytest.approx(3.0 * left[0] ** 2 + 5.0 * left[1] ** 2)


@pytest.mark.slow(seconds=4)
def test_a_push_towards_the_foot_that_lands_is_taken():
    """10 N s at 80 kg to the right, as the right foot lands: the left one would have to cross."""
    robot = tc.load_floating_robot("five-link-3d")
    planner = tc.LqrPlanner(tc.robot_gait_for_speed(robot, 1.0), tc.embedding.FREE_PLANNER)
    push = tc.Push(10.0, 4, 0.3, direction=radians(-90.0))
    record = tc.simulate(tc.Experiment(robot, planner=planner, steps=10, pushes=(push,)))
    assert not record.fell, record.fall_reason
    figures = record.summary
    assert figures.qp_failures == 0
    for angle in figures.joint_angle.values():
        assert angle.lower < angle.least < angle.most < angle.upper
    assert abs(np.diff(record.section_time)[-1] - np.diff(record.section_time)[2]) < 0.05
