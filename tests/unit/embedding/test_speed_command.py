"""Which speed is wanted when: profiles, functions and live commands, as a route."""

import numpy as np
import pytest

import template_control as tc
from template_control.errors import ScenarioError
from template_control.slip.gaits.walking_by_speed import walking_by_speed
from template_control.slip.maps.section import VLO
from template_control.slip.scenario.route import SpeedProfile
from template_control.slip.scenario.speed_route import SpeedRoute

P = tc.SlipParameters()


def test_a_profile_is_straight_between_its_times_and_level_beyond():
    profile = SpeedProfile((1.0, 3.0), (0.4, 1.0))
    assert [profile(t) for t in (0.0, 1.0, 2.0, 3.0, 9.0)] == pytest.approx(
        [0.4, 0.4, 0.7, 1.0, 1.0]
    )


@pytest.mark.parametrize(
    ("times", "speeds", "told"),
    [
        ((), (), "0 times"),
        ((0.0, 1.0), (0.5,), "2 times and 1 speeds"),
        ((0.0, 0.0), (0.5, 0.6), "rising times"),
        ((0.0,), (-0.5,), "from 0 to 20"),
    ],
)
def test_a_profile_that_is_none_is_refused(times, speeds, told):
    with pytest.raises(ScenarioError, match=told):
        SpeedProfile(times, speeds)


def test_a_speed_holds_until_it_is_changed():
    speeds = [0.5]
    route = SpeedRoute(P, lambda time: speeds[-1])
    assert route.endless
    assert route.next(VLO, route.start, 0.0).wanted_speed == 0.5
    speeds.append(0.9)
    assert route.ahead(VLO, route.start, 0.8).wanted_speed == 0.9


def test_a_route_aims_at_the_speed_that_is_wanted_when_the_step_is_over():
    route = SpeedRoute(P, lambda time: 0.5 + 0.1 * time, duration=3.0)
    route.next(VLO, route.start, 0.0)
    goal = route.next(VLO, route.start, 0.8)
    assert goal.wanted_speed == pytest.approx(0.5 + 0.1 * 1.6)
    gait = walking_by_speed().gait_for(P, goal.wanted_speed)
    np.testing.assert_allclose(goal.target, gait.vlo, atol=2e-4)
    assert route.next(VLO, route.start, 3.1) is None


@pytest.mark.parametrize("speed", [0.1, 2.0])
def test_a_route_tells_what_is_beyond_the_family(speed):
    route = SpeedRoute(P, lambda _: speed)
    low, high = walking_by_speed().range(P)
    nearest = min(max(speed, low), high)
    end, _ = walking_by_speed().vlo_for(P, nearest)
    beyond = speed - nearest
    assert abs(beyond) > 0.1
    assert route.next(VLO, route.start, 0.0).target[0] - end == pytest.approx(beyond, abs=0.01)


def test_a_function_that_says_no_speed_is_refused():
    with pytest.raises(ScenarioError, match="wanted speed at 0 s"):
        SpeedRoute(P, lambda _: float("nan"))
