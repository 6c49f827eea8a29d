"""A walk that is too slow to go on is carried on by both feet, or steps back."""

from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.planner import Cause
from template_control.embedding.recovery import EXITS, CatchOptions, Recovery
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.standing.curves import StandingOptions
from template_control.embedding.standing.planners import standing_planners
from template_control.embedding.state import EstimatorState, TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.gaits.walking_by_speed import walking_gait
from template_control.slip.maps.section import REST, VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute
from template_control.slip.scenario.speed_route import SpeedRoute

P = SlipParameters()
WALK = walking_gait(P, 1.1)
STILL = np.array([0.0, 0.97, 0.0])
NOTHING = EstimatorState(load=1.0, trim=0.0, lean=0.0)
CURVED = {"DS_bl^ww", "DS_br^ws", "SS_bt^sb", "DS_br^sb"}


def recovering(**options):
    """A recovery on the route's walk, and the walk."""
    recovery = Recovery(P, CatchOptions(**options))
    walk = SteadyRoute.of(WALK).next(VLO, WALK.vlo, 0.0)
    recovery.follow(walk)
    return recovery, walk


def kinds(goals):
    return [goal.stride for goal in goals]


def test_only_a_walk_that_lags_is_carried_or_steps_back():
    recovery, walk = recovering(lag=0.25)
    limit = float(walk.target[0]) - 0.25
    assert not recovery.ways(walk, limit + 1e-6, 0.0)
    carried, stop, back = recovery.ways(walk, limit, 0.0)
    assert (carried.stride, carried.then) == ("ww", "w")
    np.testing.assert_array_equal(carried.target, walk.target)
    assert [(goal.stride, goal.then) for goal in (stop, back)] == [("ws", "sw"), ("sb", "sw")]
    assert back.target[0] == back.target[2] == 0.0
    for kind in ("wr", "r", "rw", "ww"):
        assert not recovery.ways(replace(walk, stride=kind), 0.1, 0.0), "it is no walk"


def test_carried_on_it_walks_or_may_still_step_back():
    recovery, walk = recovering()
    carried = recovery.ways(walk, 0.3, -0.8)[0]
    recovery.take(carried)
    assert kinds(recovery.ways(carried, 0.3, -0.8)) == ["ww", "ws", "sb"]
    assert all(goal.then in ("w", "sw") for goal in recovery.ways(carried, 0.3, -0.8))
    assert recovery.goal(VLO, WALK.vlo) is None, "the route goes on"
    recovery.follow(walk)
    assert not recovery.ways(carried, 0.3, -0.8), "that is over"


@pytest.mark.parametrize("way", [1, 2])
def test_from_a_stand_it_starts_to_walk_again(way):
    recovery, walk = recovering()
    stop = recovery.ways(walk, 0.3, -0.8)[way]
    recovery.take(stop)
    start = recovery.goal(REST, STILL)
    assert (start.stride, start.then) == ("sw", "w")
    np.testing.assert_array_equal(start.target, walk.target)
    assert recovery.goal(VLO, WALK.vlo) is None, "the route goes on"
    recovery.take(stop)
    recovery.reset()
    assert recovery.goal(REST, STILL) is None


@pytest.mark.parametrize(("node", "kind"), EXITS, ids=str)
def test_the_same_legs_stand_where_a_stride_breaks_into_another_one(node, kind):
    before, after = AUTOMATON.node(node), AUTOMATON.node(EXITS[node, kind])
    assert before.stance == after.stance
    assert after in AUTOMATON.stride(AUTOMATON.starts[kind])


def nodes(kind, phase):
    """Where a stride breaks into another kind, in single (SS) or double stance (DS)."""
    return [node for node, stride in EXITS if stride == kind and node.startswith(phase)]


def slow(node, place, toes, speed):
    """Plan a step, put the robot into a double or single stance, slow, and plan again."""
    route = SteadyRoute.of(WALK)
    supervisor = StrideSupervisor(
        route, default_planners(route), ReplanOptions(), AUTOMATON, frozenset(CURVED), Recovery(P)
    )
    supervisor.begin(VLO)
    supervisor.decide(VLO, TemplateState(VLO.state(WALK.vlo), np.zeros(2)), 0.0, NOTHING)
    there, sensed = AUTOMATON.node(node), standing(place, toes, speed)
    assert supervisor.surprise(there, -0.5, 0.3, 0.3) is Cause.DEVIATION
    return supervisor, supervisor.replan(Cause.DEVIATION, there, sensed, 0.3, phase_time=0.3)


def standing(place, toes, speed):
    """The CoM at ``place``, 0.955 m high."""
    return TemplateState(
        np.array([place, 0.955, speed, 0.0]), np.array(toes), acceleration=np.zeros(2)
    )


@pytest.mark.parametrize("node", nodes("ww", "DS"))
def test_a_slow_double_stance_is_carried_to_the_next_vlo(node):
    supervisor, after = slow(node, 0.3, (0.0, 0.5), 0.6)
    assert after.name == "DS_bl^ww"
    report = supervisor.reports[-1]
    assert (len(supervisor.reports), report.goal.stride) == (1, "ww")
    assert report.decision.feasible
    np.testing.assert_array_equal(report.target, WALK.vlo)
    assert supervisor.path.strides[0].outcome is Outcome.SECTION
    _, after = slow(node, 0.3, (0.0, 0.5), float(WALK.vlo[0]))
    assert after.name == node, "fast enough, it walks"


@pytest.mark.parametrize("node", nodes("sb", "SS"))
def test_a_walk_that_falls_back_sets_its_foot_down_behind(node):
    supervisor, after = slow(node, -0.29, (0.0, -0.5), 0.7)
    assert after.name == "SS_bt^sb"
    report = supervisor.reports[-1]
    assert report.goal.stride == "sb"
    np.testing.assert_array_equal(report.target, report.goal.target)
    foothold = supervisor.path.landings[1].x
    assert foothold < -0.29, "behind the CoM"
    _, after = slow(node, -0.19, (0.0, -0.5), 0.84)
    assert after.name == node, "it passes over its foot"


def test_a_double_stance_that_falls_back_comes_to_a_stand():
    supervisor, after = slow("DS_sd^w", 0.1, (0.0, 0.45), -0.2)
    assert after.name == "DS_br^ws"
    assert supervisor.reports[-1].goal.stride == "ws"
    assert supervisor.reports[-1].decision.feasible
    pushed = standing(0.05, (0.0, 0.45), -0.5)
    after = supervisor.replan(Cause.DEVIATION, after, pushed, 0.4, phase_time=0.1)
    assert after.name == "DS_al^sb", "pushed on, it steps"
    assert supervisor.reports[-1].goal.stride == "sb"


def strides(record):
    return record.kinds_of_stride[:-1]


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("phase", "caught"), [(0.3, ["ww"]), (0.6, ["sb", "sw"])])
def test_a_robot_that_is_pushed_back_hard_walks_on(phase, caught):
    robot = tc.load_robot("five-link")
    planner = tc.LqrPlanner(tc.default_gait(robot))
    pushes = (tc.Push(-65.0, step=4, phase=phase),)
    record = tc.simulate(tc.Experiment(robot, planner=planner, steps=18, pushes=pushes))
    assert record.fall_reason == ""
    assert strides(record) == ["wp"] * 4 + caught + ["wp"] * (14 - len(caught))
    assert np.all(np.abs(record.torque) <= record.torque_limit)
    assert record.push.sum() * 1e-3 == pytest.approx(-65.0, rel=1e-6)
    assert record.section_state[-1, 0] == pytest.approx(1.1, abs=0.011)
    left = tc.simulate(
        tc.Experiment(
            robot,
            planner=planner,
            steps=18,
            pushes=pushes,
            controller=tc.EmbeddingOptions(catches=False),
        )
    )
    assert left.fell
    assert set(strides(left)) == {"wp"}


@pytest.mark.parametrize(("apart", "kind"), [(0.0, "sf"), (0.02, "sf"), (0.25, "sw")])
def test_from_feet_too_close_for_a_start_it_steps_first(apart, kind):
    """Soles next to each other do not bear the centre of pressure far enough behind the CoM."""
    route = SpeedRoute(P, lambda time: 0.9 if time > 1.0 else 0.0, gaits=("stand", "walk"))
    options = StandingOptions(half_length=0.1, slowest=0.3)
    planners = standing_planners(P, options) | {"wp": tc.LqrPlanner(tc.gait_for_speed(P, 0.9))}
    supervisor = StrideSupervisor(
        route, planners, ReplanOptions(), AUTOMATON, {"DS_ar^s", "DS_ar^sw", "DS_ar^sf"}
    )
    supervisor.begin(REST)
    state, toes = np.array([0.5 * apart, 0.97, 0.0, 0.0]), np.array([0.0, apart])
    there = TemplateState(state, toes, acceleration=np.zeros(2))
    assert supervisor.decide(REST, there, 0.0, NOTHING).name == "DS_ar^s"
    first = supervisor.decide(REST, there, 1.5, NOTHING)
    assert first.name == AUTOMATON.starts[kind]
    assert supervisor.goal.stride == kind
    assert supervisor.decision.feasible
