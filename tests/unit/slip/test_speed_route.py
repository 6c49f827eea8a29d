"""The gait that a speed chooses, and the strides that lead to it."""

from itertools import groupby, pairwise

import numpy as np
import pytest

import template_control as tc
from template_control.slip import AUTOMATON, GaitChangeOptions, StrideKind
from template_control.slip.maps.section import APEX, REST, VLO, section_of

P = tc.SlipParameters()
ALL = ("stand", "walk", "run")
DURATION = 0.5  # of a stride [s]


def followed(route, end):
    """Goals of a route, by time, if each stride lasts as long and ends in its target."""
    goals, section, z, now = [], route.section, route.start, 0.0
    route.reset()
    while now < end and (goal := route.next(section, z, now)) is not None:
        goals.append((now, goal))
        section = section_of(AUTOMATON.sections(AUTOMATON.starts[goal.stride])[1])
        z, now = np.array(goal.target), now + DURATION
    return goals


def kinds(goals):
    return [kind for kind, _ in groupby(goal.stride for _, goal in goals)]


def test_a_speed_from_zero_to_a_run_and_back_stands_walks_and_runs():
    wanted = tc.SpeedProfile((0.0, 2.0, 2.1, 12.0, 12.1), (0.0, 0.0, 2.5, 2.5, 0.0))
    goals = followed(tc.SpeedRoute(P, wanted, gaits=ALL), 30.0)
    assert kinds(goals) == [
        StrideKind.STAND,
        StrideKind.STAND_TO_WALK,
        StrideKind.WALK_PUSH_OFF,
        StrideKind.WALK_TO_RUN,
        StrideKind.RUN,
        StrideKind.RUN_TO_WALK,
        StrideKind.WALK_PUSH_OFF,
        StrideKind.WALK_TO_STAND,
        StrideKind.STEP_FORWARD,
        StrideKind.STAND,
    ]


def test_a_robot_that_hops_goes_through_the_spot_backward_and_walks_again():
    def wanted(time):
        return -0.4 if 2.0 < time < 20.0 else 1.0

    changes = GaitChangeOptions(hop=0.8)
    goals = followed(tc.SpeedRoute(P, wanted, gaits=("walk", "run"), changes=changes), 35.0)
    assert kinds(goals) == [
        StrideKind.WALK_PUSH_OFF,
        StrideKind.WALK_TO_RUN,
        StrideKind.HOP,
        StrideKind.RUN,
        StrideKind.RUN_TO_WALK,
        StrideKind.WALK_PUSH_OFF,
    ]
    hops = [goal for _, goal in goals if goal.stride == StrideKind.HOP]
    speeds = np.array([goal.target[0] for goal in hops])
    assert speeds.min() == -0.4
    assert np.abs(np.diff(speeds)).max() <= DURATION * changes.acceleration + 1e-9
    assert all(goal.target[1] > 0.99 for goal in hops)


def test_feet_that_bear_are_not_closed_by_a_step():
    wanted = tc.SpeedProfile((0.0, 4.0, 4.1), (0.8, 0.8, 0.0))
    goals = followed(tc.SpeedRoute(P, wanted, gaits=ALL, bears=True), 10.0)
    assert kinds(goals) == [StrideKind.WALK_PUSH_OFF, StrideKind.WALK_TO_STAND, StrideKind.STAND]
    assert kinds(followed(tc.SpeedRoute(P, wanted, gaits=ALL), 10.0))[2] == StrideKind.STEP_FORWARD


def test_a_route_that_ends_within_a_change_of_gait_leads_on():
    """Each stride's ``then`` begins where the stride ends."""
    wanted = tc.SpeedProfile((0.0, 2.0, 2.1, 12.0, 12.1), (0.0, 0.0, 2.5, 2.5, 0.0))
    for _, goal in followed(tc.SpeedRoute(P, wanted, gaits=ALL), 30.0):
        begin, end = AUTOMATON.sections(AUTOMATON.starts[goal.stride])
        if begin is not end:
            assert AUTOMATON.sections(AUTOMATON.starts[goal.then])[0] is end


def test_the_trunk_has_time_to_lean_before_a_run_and_to_rise_after_it():
    wanted = tc.SpeedProfile((0.0, 1.0, 1.1, 10.0, 10.1), (1.0, 1.0, 2.0, 2.0, 0.0))
    goals = followed(tc.SpeedRoute(P, wanted, gaits=ALL), 30.0)
    announced = next(t for t, g in goals if g.then == StrideKind.WALK_TO_RUN)
    at = {g.stride: t for t, g in goals}  # the last of each kind
    assert at[StrideKind.WALK_TO_RUN] - announced >= 3.5
    assert at[StrideKind.WALK_TO_STAND] - at[StrideKind.RUN_TO_WALK] >= 3.5


def test_a_run_changes_its_wanted_speed_no_faster_than_asked():
    changes = GaitChangeOptions(acceleration=0.5)
    wanted = tc.SpeedProfile((0.0, 12.0, 12.1), (3.0, 3.0, 0.0))
    goals = followed(tc.SpeedRoute(P, wanted, gaits=ALL, changes=changes), 30.0)
    speeds = [g.target[0] for _, g in goals if g.stride == StrideKind.RUN]
    steps = [abs(b - a) for a, b in pairwise(speeds)]
    assert max(steps) == pytest.approx(0.5 * DURATION)
    assert max(speeds) > 2.9


@pytest.mark.parametrize(("hysteresis", "runs_on"), [(0.2, True), (0.0, False)])
def test_within_the_band_a_robot_keeps_its_gait(hysteresis, runs_on):
    """At 1.35 m/s, below the border of 1.4."""
    changes = GaitChangeOptions(hysteresis=hysteresis)
    wanted = tc.SpeedProfile((0.0, 10.0, 10.1), (2.0, 2.0, 1.35))
    goals = followed(tc.SpeedRoute(P, wanted, gaits=ALL, changes=changes), 30.0)
    assert (goals[-1][1].stride == StrideKind.RUN) is runs_on
    walks = followed(tc.SpeedRoute(P, lambda _: 1.35, gaits=ALL, changes=changes), 10.0)
    assert kinds(walks) == [StrideKind.WALK_PUSH_OFF]


def test_the_border_may_be_elsewhere():
    route = tc.SpeedRoute(P, lambda _: 1.3, gaits=ALL, changes=GaitChangeOptions(run=1.2))
    assert StrideKind.RUN in kinds(followed(route, 10.0))


def test_a_run_may_begin_slower():
    changes = GaitChangeOptions(run=0.9, take_off=0.7)
    goals = followed(tc.SpeedRoute(P, lambda _: 1.0, gaits=ALL, changes=changes), 10.0)
    assert {g.target[0] for _, g in goals if g.then == StrideKind.WALK_TO_RUN} == {0.7}


def test_a_run_is_no_faster_than_it_may_be():
    changes = GaitChangeOptions(fastest=1.8)
    goals = followed(tc.SpeedRoute(P, lambda _: 3.0, gaits=ALL, changes=changes), 20.0)
    assert max(g.target[0] for _, g in goals) == 1.8


def test_without_their_gaits_a_robot_only_walks():
    wanted = tc.SpeedProfile((0.0, 5.0, 5.1), (3.0, 3.0, 0.0))
    assert kinds(followed(tc.SpeedRoute(P, wanted), 10.0)) == [StrideKind.WALK_PUSH_OFF]


def test_each_stride_begins_at_the_section_that_the_one_before_leads_to():
    wanted = tc.SpeedProfile((0.0, 2.0, 2.1, 12.0, 12.1), (0.0, 0.0, 2.5, 2.5, 0.0))
    ends = None
    for _, goal in followed(tc.SpeedRoute(P, wanted, gaits=ALL), 30.0):
        begin, end = (section_of(e) for e in AUTOMATON.sections(AUTOMATON.starts[goal.stride]))
        assert begin is (ends or REST)
        assert len(goal.target) == {REST: 3, VLO: 3, APEX: 2}[end]
        ends = end


def test_a_template_of_another_size_does_the_same_in_its_own_units():
    small = tc.SlipParameters(mass=2.0, rest_length=0.3, leg_stiffness=1000.0)
    unit = np.sqrt(0.3)  # of speeds and times
    times = np.array([0.0, 2.0, 2.1, 12.0, 12.1])
    speeds = np.array([0.0, 0.0, 2.5, 2.5, 0.0])
    big = followed(tc.SpeedRoute(P, tc.SpeedProfile(tuple(times), tuple(speeds)), gaits=ALL), 25.0)
    profile = tc.SpeedProfile(tuple(unit * times), tuple(unit * speeds))
    route = tc.SpeedRoute(small, lambda t: profile(t), gaits=ALL)
    section, z = route.section, route.start
    for at, goal in big:
        own = route.next(section, z, unit * at)
        assert own.stride == goal.stride
        # Mean speeds of the family have two digits.
        np.testing.assert_allclose(own.target[0], unit * goal.target[0], atol=0.02)
        section = section_of(AUTOMATON.sections(AUTOMATON.starts[own.stride])[1])
        z = np.array(own.target)
