"""A walk that cannot go on breaks into a run, slows down and walks on."""

import json
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.planner import Cause, Decision, RestContext
from template_control.embedding.recovery import CatchOptions, Recovery
from template_control.embedding.replanning import free_controls
from template_control.embedding.rollout import ReplanOptions, RoutePlanners
from template_control.embedding.state import EstimatorState, TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.run.robot_route import robot_route
from template_control.slip.automaton.automaton import AUTOMATON, RUN_ON
from template_control.slip.automaton.vocabulary import Event, Outcome, Slot
from template_control.slip.control.stride_solver import rest
from template_control.slip.dynamics.stride import StrideSimulator, simulate_stride
from template_control.slip.gaits.running_gait import running_gait, running_speeds
from template_control.slip.gaits.walking_by_speed import walking_gait
from template_control.slip.maps.return_map import new_workspace
from template_control.slip.maps.section import APEX, VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute
from template_control.slip.scenario.scenario import Scenario, Segment
from template_control.slip.scenario.scenario_route import ScenarioRoute

P = SlipParameters()
WALK = walking_gait(P, 1.1)
FAST, SLOW = np.array([2.0, 0.98]), np.array([1.3, 0.98])
NOTHING = EstimatorState(load=1.0, trim=0.0, lean=0.0)


def recovering(**options):
    """A recovery on the route's walk, and the walk."""
    recovery = Recovery(P, CatchOptions(**options))
    walk = SteadyRoute.of(WALK).next(VLO, WALK.vlo, 0.0)
    recovery.follow(walk)
    return recovery, walk


def asked(planners, *sections):
    """Kinds of stride that are asked for; what is said ahead is what is then asked for."""
    kinds = []
    for section, z in sections:
        ahead, goal = planners.ahead(section, z, 0.0), planners.next(section, z, 0.0)
        assert ahead.stride == goal.stride
        kinds.append(goal.stride)
    return kinds


def on(route):
    """The planners of a route that recovers."""
    recovery = Recovery(P)
    return RoutePlanners(route, default_planners(route), AUTOMATON, recovery), recovery


def test_undisturbed_the_route_alone_is_asked():
    route = SteadyRoute.of(WALK)
    planners, recovery = on(route)
    assert asked(planners, *[(VLO, WALK.vlo)] * 3) == ["w"] * 3
    goal = planners.next(VLO, WALK.vlo, 0.0)
    np.testing.assert_array_equal(goal.target, WALK.vlo)
    assert goal.then is None, "no lean for a run that never comes"
    assert recovery.goal(VLO, WALK.vlo) is None


def test_it_runs_until_it_is_slow_and_walks_on():
    recovery, walk = recovering(walkable=1.45, slow=1.35)
    (run,) = recovery.ways(walk, speed=2.0, excess=0.9)
    assert (run.stride, run.then) == ("wr", "r")
    assert run.target[0] == 2.0
    assert recovery.goal(APEX, FAST) is None, "naming a way does not go it"
    recovery.take(run)
    assert recovery.goal(APEX, FAST).target[0] == 1.35
    assert recovery.goal(APEX, FAST).stride == "r"
    assert recovery.goal(APEX, np.array([1.46, 0.98])).stride == "r"
    back = recovery.goal(APEX, SLOW)
    assert (back.stride, back.then) == ("rw", "w")
    np.testing.assert_array_equal(back.target, WALK.vlo)
    assert recovery.goal(VLO, WALK.vlo) is None, "the route goes on"
    recovery.reset()
    assert recovery.goal(APEX, FAST) is None


def test_only_a_walk_that_is_much_too_fast_is_caught():
    recovery, walk = recovering(excess=0.42, fast=9.0)
    slowest, fastest = running_speeds(P)
    assert not recovery.ways(walk, 2.0, 0.41)
    assert not recovery.ways(walk, slowest - 1e-6, 0.5), "no run is that slow"
    assert recovery.ways(walk, 9.0, 8.0)[0].target[0] == fastest
    changing = replace(walk, stride="wr")
    assert not recovery.ways(changing, 2.0, 0.9), "a transition that was planned goes on"
    recovery.take(*recovery.ways(walk, 2.0, 0.9))
    assert recovery.ways(changing, 2.0, 0.0)[0].stride == "wr", "pushed again, it aims again"
    assert not recovery.ways(replace(walk, stride="r"), 2.0, 0.9)


def test_a_walk_that_is_about_to_take_off_is_caught():
    recovery, walk = recovering(excess=0.42, fast=1.49)
    left = 1.49 - float(walk.target[0])
    assert 0.3 < left < 0.42
    assert not recovery.ways(walk, 1.6, left - 0.01)
    assert recovery.ways(walk, 1.6, left + 0.01)[0].stride == "wr"


def test_a_scenario_goes_on_after_the_catch():
    segments = (Segment("walk", 1.1, steps=2), Segment("run", 2.0, steps=1))
    planners, recovery = on(ScenarioRoute(Scenario(segments=segments)))
    walk = planners.next(VLO, WALK.vlo, 0.0)
    recovery.take(*recovery.ways(walk, 2.0, 0.9))
    assert asked(planners, (APEX, FAST), (APEX, SLOW), (VLO, WALK.vlo)) == ["r", "rw", "w"]
    assert asked(planners, (VLO, WALK.vlo), (APEX, FAST)) == ["wr", "r"], "the scenario's own run"
    assert planners.next(APEX, SLOW, 9.0) is None


def test_a_catch_tells_no_duration_of_a_step():
    segments = (Segment("walk", 0.9, steps=1), Segment("walk", acceleration=0.1, duration=9.0))
    planners, recovery = on(ScenarioRoute(Scenario(segments=segments, start=(0.9, 0.98, 0.0))))
    planners.next(VLO, WALK.vlo, 0.0)
    walk = planners.next(VLO, WALK.vlo, 0.5)
    (run,) = recovery.ways(walk, 2.0, 1.0)
    assert (walk.segment, run.segment) == (1, 1)
    recovery.take(run)
    assert asked(planners, (APEX, FAST), (APEX, SLOW)) == ["r", "rw"]
    later = planners.next(VLO, WALK.vlo, 4.5)
    assert later.wanted_speed == pytest.approx(0.9 + 0.1 * 5.0, abs=0.06), "one step ahead"


@pytest.mark.parametrize(("walks", "runs"), RUN_ON.items())
def test_the_same_legs_stand_where_a_walk_breaks_into_a_run(walks, runs):
    before, after = AUTOMATON.node(walks), AUTOMATON.node(runs)
    assert before.stance == after.stance
    assert after in AUTOMATON.stride(AUTOMATON.starts["wr"])


def test_a_walker_that_takes_off_lands_on_the_other_foot_and_runs():
    u = running_gait(P, 2.4).controls.copy()
    u[Slot.TOUCHDOWN_ANGLE] = 1.22
    u[[Slot.K_SC_WR, Slot.K_SD_WR]] = u[[Slot.K_SC, Slot.K_SD]]
    u[[Slot.K_SC, Slot.K_SD]] = P.leg_stiffness
    stride = simulate_stride(P, "SS_av^wr", VLO.state([2.4, 0.99, 0.4]), u)
    assert stride.outcome is Outcome.SECTION
    assert [e.target for e in stride.events] == [
        "F_aa^wr", "SS_sc^wr", "SS_sd^wr", "F_ba^wr", "F_aa^r"
    ]  # fmt: skip
    landing = stride.events[1]
    assert landing.event is Event.TOUCHDOWN
    assert stride.toes.max() > 0.3, "it lands ahead of the foot that took off"


@pytest.mark.parametrize("turn", [0.0, 0.05, 10.0])
def test_a_stride_that_is_broken_into_comes_near_its_target(turn):
    planner = default_planners(SteadyRoute.of(WALK))["wr"]
    node, state = AUTOMATON.node("SS_av^wr"), VLO.state([1.9, 0.985, 0.1])
    u, target = WALK.controls, running_gait(P, 1.9).apex
    ahead = rest(StrideSimulator(P), node.name, state, (0.0, 0.0), new_workspace())
    free = [int(Slot.TOUCHDOWN_ANGLE), *free_controls(AUTOMATON, node)]
    left = Decision(u, WALK.vlo, True, True, True)
    decision = planner.decide_rest(RestContext(ahead, left, target, free, turn, Cause.RECOVERY))
    assert decision.feasible
    assert not decision.nominal
    end, outcome = ahead(decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted[:2], end, atol=1e-12)
    assert abs(end[0] - target[0]) < 0.3
    assert abs(end[1] - target[1]) < 0.06
    moved = decision.controls[Slot.TOUCHDOWN_ANGLE] - u[Slot.TOUCHDOWN_ANGLE]
    assert abs(moved) <= turn + 1e-12
    stays = [Slot.K_SC, Slot.K_SD]
    np.testing.assert_array_equal(decision.controls[stays], u[stays])


def pushed(speed, recovery):
    """Plan a walking step, push the robot 60 ms later, and plan again: planning and node then."""
    route = SteadyRoute.of(WALK)
    supervisor = StrideSupervisor(
        route, default_planners(route), ReplanOptions(), recovery=recovery
    )
    supervisor.begin(VLO)
    sensed = TemplateState(VLO.state(WALK.vlo), np.zeros(2))
    node = supervisor.decide(VLO, sensed, 0.0, NOTHING)
    u = supervisor.reports[0].decision.controls
    sensed.state[:] = simulate_stride(P, node.name, sensed.state, u).sample(0.06)[0, :4]
    sensed.state[2] += speed
    assert supervisor.surprise(node, speed, 0.06, 0.06) is Cause.DEVIATION
    return supervisor, supervisor.replan(Cause.DEVIATION, node, sensed, 0.06, phase_time=0.06)


def test_a_push_within_a_step_is_answered_by_a_walk_or_by_a_run():
    supervisor, node = pushed(0.2, Recovery(P))
    assert node.name == "SS_av^w"
    assert supervisor.reports[0].goal.stride == "w"
    supervisor, node = pushed(0.9, Recovery(P))
    assert node.name == "SS_av^wr"
    report = supervisor.reports[0]
    assert (len(supervisor.reports), report.goal.stride) == (1, "wr")
    assert report.decision.feasible
    assert report.target[2] == 0.0, "of an apex"
    assert supervisor.path.strides[0].outcome is Outcome.SECTION
    supervisor.choose_assist(node, TemplateState(VLO.state(WALK.vlo), np.zeros(2)))
    assert supervisor.ground.assist == 0.0, "a planner that knows no slopes has no assist"
    _, node = pushed(0.9, None)
    assert node.name == "SS_av^w", "it knows no other way"


def kinds(record):
    return record.kinds_of_stride[:-1]


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("name", "phase"), [("runner", 0.3), ("five-link", 0.7)])
def test_a_robot_that_is_pushed_too_hard_runs_and_walks_on(name, phase):
    robot = tc.load_robot(name)
    planner = tc.LqrPlanner(tc.default_gait(robot))
    record = tc.simulate(
        tc.Experiment(
            robot, planner=planner, steps=18, pushes=(tc.Push(80.0, step=3, phase=phase),)
        )
    )
    assert record.fall_reason == ""
    found = kinds(record)
    runs = found.count("r")
    walks = len(found) - runs - 2
    assert found == ["wp"] * 3 + ["wr"] + ["r"] * runs + ["rw"] + ["wp"] * (walks - 3)
    assert runs >= 4
    assert walks > 5
    assert np.all(np.abs(record.torque) <= record.torque_limit)
    assert record.push.sum() * 1e-3 == pytest.approx(80.0, rel=1e-6), "it stays where it was"
    speed = record.section_state[:, 0]
    assert speed.max() > 1.9
    assert speed[-1] == pytest.approx(1.1, abs=0.06)


@pytest.mark.slow(seconds=6)
@pytest.mark.parametrize(("push_off", "step"), [(False, "w"), (True, "wp")])
def test_a_walk_of_a_scenario_runs_and_walks_on(push_off, step):
    segments = (Segment("walk", 1.1, steps=7),)
    scenario = Scenario(segments=segments, start=(1.1, 0.978, 0.0), map_kind=tc.MapKind.EXACT)
    robot = tc.load_robot("five-link")
    pushes = (tc.Push(60.0, step=2, phase=0.3),)

    def walked(**controller):
        route = robot_route(robot, scenario, push_off=push_off)
        options = tc.EmbeddingOptions(**controller)
        return tc.simulate(tc.Experiment(robot, route, pushes=pushes, controller=options))

    record = walked()
    assert record.arrived
    found = kinds(record)
    runs = found.count("r")
    assert runs >= 3
    assert found == [step] * 2 + ["wr"] + ["r"] * runs + ["rw"] + [step] * 4, "caught, it is a step"
    assert set(kinds(walked(catches=False))) == {step}


@pytest.mark.slow(seconds=4)
def test_a_walk_of_any_speed_runs_and_walks_on():
    robot = tc.load_robot("five-link")
    route = tc.SpeedRoute(tc.template_for(robot), tc.SpeedProfile((0.0, 9.0), (1.0, 1.0)), 9.0)
    pushes = (tc.Push(80.0, step=3, phase=0.7),)
    record = tc.simulate(tc.Experiment(robot, route, pushes=pushes))
    assert record.fall_reason == ""
    assert record.arrived
    found = kinds(record)
    runs = found.count("r")
    assert runs >= 3
    assert found[:4] == ["wp"] * 3 + ["wr"]
    assert set(found[4 + runs + 1 :]) == {"wp"}
    speed = record.section_state[:, 0]
    assert speed.max() > 1.9
    assert speed[-1] == pytest.approx(speed[0], abs=0.02), "at VLO, where 1 m/s are 0.91"


@pytest.mark.slow(seconds=4)
def test_the_command_says_no_and_counts_strides(tmp_path, capsys):
    arguments = ["walk", "--push", "60@2:0.4", "--steps", "5", "--no-figures", "--json"]
    assert main([*arguments, "--output", str(tmp_path / "caught")]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["strides"] == {"walking with push-off": 2, "walk to run": 1, "running": 2}
    assert main([*arguments, "--no-catch", "--output", str(tmp_path / "not")]) in (0, 1)
    assert set(json.loads(capsys.readouterr().out)["strides"]) == {"walking with push-off"}
