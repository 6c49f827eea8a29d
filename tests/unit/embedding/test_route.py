"""Routes: a scenario's strides and targets from the times of its sections alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.maps.section import APEX, VLO, section_of
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import Scenario, Segment, example_one
from template_control.slip.scenario.scenario_route import ScenarioRoute

P = SlipParameters()
WALK = np.array([1.1, 0.98, 0.0])
APEX_STATE = np.array([3.0, 0.98])
FIRST = 1.6 * np.sqrt(P.rest_length / P.gravity)


def scenario(*segments):
    return Scenario(segments=segments)


def told(goal):
    return goal.stride, goal.wanted_speed, goal.segment


def test_a_run_of_example_one_was_asked_for_by_its_route():
    """The times and states of the record's sections alone give its strides and targets."""
    record = simulate_scenario(example_one())
    route = ScenarioRoute(example_one())
    np.testing.assert_array_equal(route.start, record.section_state[0])
    section = route.section
    for i, stride in enumerate(record.strides):
        z = record.section_state[i][: section.dimension]
        goal = route.next(section, z, record.section_time[i])
        assert goal.stride == stride
        assert goal.wanted_speed == pytest.approx(record.wanted_speed[i], rel=1e-12)
        np.testing.assert_allclose(goal.target, record.target[i][: len(goal.target)], rtol=1e-12)
        section = section_of(AUTOMATON.sections(STRIDE_START[stride])[1])
    last = record.section_state[-1], record.section_time[-1]
    assert route.next(section, *last) is None
    assert route.next(section, *last) is None


def test_ahead_asks_and_next_goes():
    route = ScenarioRoute(scenario(Segment("walk", 1.1, steps=1), Segment("run", 2.0, steps=1)))
    for _ in range(2):
        assert told(route.ahead(VLO, WALK, 0.0)) == ("w", 1.1, 0)
    assert told(route.next(VLO, WALK, 0.0)) == ("w", 1.1, 0)
    for _ in range(2):
        assert told(route.ahead(VLO, WALK, 0.5)) == ("wr", 2.0, 1)
    assert told(route.next(VLO, WALK, 0.5)) == ("wr", 2.0, 1)
    assert told(route.next(APEX, APEX_STATE, 1.2)) == ("r", 2.0, 1)
    assert route.ahead(APEX, APEX_STATE, 1.6) is None
    assert route.next(APEX, APEX_STATE, 1.6) is None
    route.reset()
    assert told(route.next(VLO, WALK, 0.0)) == ("w", 1.1, 0)


def test_the_profile_is_asked_for_when_the_stride_will_end():
    route = ScenarioRoute(scenario(Segment("walk", 1.0, acceleration=0.1, duration=9.0)))
    assert route.next(VLO, WALK, 0.0).wanted_speed == pytest.approx(1.0 + 0.1 * FIRST)
    assert route.next(VLO, WALK, 0.4).wanted_speed == pytest.approx(1.0 + 0.1 * (0.4 + 0.4))
    assert route.next(VLO, WALK, 1.0).wanted_speed == pytest.approx(1.0 + 0.1 * (1.0 + 0.6))


def test_a_stride_told_to_have_taken_longer_lasts_as_long_as_told():
    route = ScenarioRoute(scenario(Segment("walk", 1.0, acceleration=0.1, duration=9.0)))
    route.next(VLO, WALK, 0.0)
    route.took(0.5)
    assert route.next(VLO, WALK, 0.4).wanted_speed == pytest.approx(1.0 + 0.1 * (0.4 + 0.5))
    assert route.next(VLO, WALK, 1.0).wanted_speed == pytest.approx(1.0 + 0.1 * (1.0 + 0.6))


def test_a_segment_begins_where_its_transition_ends():
    route = ScenarioRoute(
        scenario(
            Segment("walk", 1.1, steps=1),
            Segment("run", 2.0, acceleration=1.0, until_speed=3.0),
            Segment("walk", 1.1, steps=1),
        )
    )
    route.next(VLO, WALK, 0.0)
    assert told(route.next(VLO, WALK, 0.5)) == ("wr", 2.0, 1)
    assert route.next(APEX, APEX_STATE, 1.5).wanted_speed == pytest.approx(2.0 + FIRST)
    # Its profile has come to 3 m/s a second after the transition, wherever the template is.
    assert told(route.next(APEX, APEX_STATE, 2.5)) == ("rw", 1.1, 2)


def test_slowing_down_ends_when_the_template_has_slowed_down_too():
    route = ScenarioRoute(
        scenario(Segment("walk", 1.2, acceleration=-0.1, until_speed=1.1), Segment("walk", steps=1))
    )
    fast, slow = np.array([1.15, 0.98, 0.0]), np.array([1.05, 0.98, 0.0])
    route.next(VLO, fast, 0.0)
    assert route.ahead(VLO, slow, 0.5).segment == 0
    assert route.next(VLO, fast, 1.5).segment == 0
    assert told(route.next(VLO, slow, 2.0)) == ("w", 1.2 - 0.1 * 2.0, 1)


@given(st.floats(0.0, 1e3))
def test_a_run_may_begin_at_any_time(begin):
    segments = (Segment("walk", 1.0, acceleration=0.1, duration=0.6), Segment("walk", steps=1))
    at_zero, later = (ScenarioRoute(scenario(*segments)) for _ in range(2))
    for now in (0.0, 0.5, 1.0, 1.5):
        one, other = at_zero.next(VLO, WALK, now), later.next(VLO, WALK, begin + now)
        assert (one is None) == (other is None)
        if one is not None:
            assert one.segment == other.segment
            assert one.wanted_speed == pytest.approx(other.wanted_speed, abs=1e-9)


def test_a_steady_route_never_changes():
    route = SteadyRoute(P, "w", WALK, start=[1.0, 0.97, 0.1])
    assert route.section is VLO
    np.testing.assert_array_equal(route.start, [1.0, 0.97, 0.1])
    for goal in (route.ahead(VLO, WALK, 0.0), route.next(VLO, WALK, 0.0), route.next(VLO, WALK, 9)):
        assert told(goal) == ("w", 1.1, 0)
        np.testing.assert_array_equal(goal.target, WALK)
    running = SteadyRoute(P, "r", APEX_STATE)
    assert running.section is APEX
    np.testing.assert_array_equal(running.start, APEX_STATE)


@pytest.mark.parametrize(
    ("stride", "target", "message"),
    [
        ("trot", WALK, "no stride 'trot': give one of w, r"),
        ("wr", APEX_STATE, "'wr' leads from VLO to APEX and cannot follow itself"),
        ("w", APEX_STATE, "target has shape .* give 3 numbers"),
        ("r", [np.nan, 1.0], "give finite numbers"),
    ],
)
def test_a_steady_route_that_cannot_be_is_refused(stride, target, message):
    with pytest.raises(ParameterError, match=message):
        SteadyRoute(P, stride, target)


def test_gaits_of_a_scenario():
    assert example_one().gaits == {"walk", "run"}
    only = replace(example_one(), segments=(Segment("walk", speed=1.1, steps=2),))
    assert only.gaits == {"walk"}


def test_each_stride_knows_the_next_of_another_kind():
    route = ScenarioRoute(
        scenario(
            Segment("walk", 1.1, steps=1),
            Segment("walk", 1.0, steps=1),
            Segment("run", 2.0, steps=1),
            Segment("run", 3.0, steps=1),
            Segment("walk", 1.1, steps=1),
        )
    )
    kinds, section = [], route.section
    for now in np.arange(9) * 0.5:
        goal = route.next(section, WALK[: section.dimension], now)
        if goal is None:
            break
        kinds.append((goal.stride, goal.then))
        section = section_of(AUTOMATON.sections(STRIDE_START[goal.stride])[1])
    assert kinds == [
        ("w", "wr"),
        ("w", "wr"),
        ("wr", "r"),
        ("r", "rw"),
        ("r", "rw"),
        ("rw", "w"),
        ("w", None),
    ]
    assert SteadyRoute(P, "w", WALK).next(VLO, WALK, 0.0).then is None


def test_the_apex_height_may_depend_on_the_speed():
    segments = (Segment("walk", 1.1, steps=1), Segment("run", 2.0, acceleration=1.0, steps=3))
    route = ScenarioRoute(scenario(*segments), lambda speed: 1.0 - 0.01 * speed)
    np.testing.assert_allclose(route.next(VLO, WALK, 0.0).target, [1.1, 0.98, 0.0])
    np.testing.assert_allclose(route.next(VLO, WALK, 0.5).target, [2.0, 0.98])
    goal = route.next(APEX, APEX_STATE, 1.0)
    assert goal.wanted_speed > 2.3
    np.testing.assert_allclose(goal.target, [goal.wanted_speed, 1.0 - 0.01 * goal.wanted_speed])
