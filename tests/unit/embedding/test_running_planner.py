"""The running planner: what it chooses on the template, its bounds, and what it learns."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.embedding.planners.planner import Cause, Context, Planner
from template_control.embedding.planners.running import (
    AGILE,
    OFFSET_GAIN,
    SURPRISE_BOUND,
    RunningOptions,
    RunningPlanner,
)
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.state import EstimatorState, TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event, Outcome, Slot
from template_control.slip.control.stride_solver import solve_within_reach
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import APEX
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute

P = SlipParameters()
OPTIONS = RunningOptions()


@pytest.fixture(scope="module")
def gait():
    return running_gait(P, 3.0)


@pytest.fixture
def planner(gait):
    return RunningPlanner(gait)


def test_planner_leaves_the_gait_alone(planner, gait):
    assert isinstance(planner, Planner)
    decision = planner.decide(Context(gait.apex))
    assert decision.feasible
    assert decision.nominal
    np.testing.assert_allclose(decision.controls, gait.controls, rtol=1e-9)
    np.testing.assert_allclose(decision.predicted, [*gait.apex, 0.0], atol=1e-9)


def test_an_error_is_nearly_gone_after_one_stride(planner, gait):
    z = gait.apex + [0.05, 0.004]
    decision = planner.decide(Context(z))
    assert decision.nominal
    end, outcome = ReturnMap(P, "r").step(z, decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted[:2], end, atol=1e-12)
    assert abs(end[0] - gait.apex[0]) < 0.3 * 0.05
    assert abs(end[1] - gait.apex[1]) < 0.3 * 0.004


def test_a_hop_turns_back_in_one_stance_and_mirrored_the_other_way():
    """Within a stance dx/dt changes its sign, which is no failure of a hop."""
    planner, step = RunningPlanner(running_gait(P, 1.0, stride="hr")), ReturnMap(P, "hr")
    ends, angles = [], []
    for sign in (1.0, -1.0):
        z, target = np.array([0.03 * sign, 1.014]), np.array([-0.04 * sign, 1.015])
        decision = planner.decide(Context(z, target))
        assert decision.nominal
        end, outcome = step.step(z, decision.controls)
        assert outcome is Outcome.SECTION
        assert end[0] == pytest.approx(target[0], abs=0.02)
        ends.append(sign * end[0])
        angles.append(sign * (decision.controls[Slot.TOUCHDOWN_ANGLE] - 0.5 * np.pi))
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert angles[0] == pytest.approx(angles[1], abs=1e-9)


def test_a_leg_lands_on_the_side_to_which_a_low_apex_goes():
    """Below l0 a leg near the vertical would be on the ground at once."""
    planner = RunningPlanner(running_gait(P, 1.0, stride="hr"))
    for sign in (1.0, -1.0):
        target = running_gait(P, 0.5 * sign, stride="hr").apex
        decision = planner.decide(Context(np.array([0.5 * sign, 0.996]), target))
        assert decision.feasible
        steep = decision.controls[Slot.TOUCHDOWN_ANGLE]
        assert np.sin(steep) < 0.996
        assert np.sign(np.cos(steep)) == sign


@pytest.mark.parametrize("speed", [2.0, 4.0])
def test_a_far_target_is_approached_step_by_step(planner, speed):
    z, target, step = np.array([3.0, 0.97]), running_gait(P, speed).apex, ReturnMap(P, "r")
    decision = planner.decide(Context(z, target))
    assert decision.feasible
    assert not decision.nominal, "nothing is learnt on the way"
    for _ in range(60):
        before = z
        z, outcome = step.step(z, planner.decide(Context(z, target)).controls)
        assert outcome is Outcome.SECTION
        assert abs(z[0] - before[0]) < 2.0 * OPTIONS.pace
    np.testing.assert_allclose(z, target, atol=2e-3)
    assert planner.gait.apex[0] == speed


@given(speed=st.floats(0.3, 7.0), height=st.floats(0.85, 1.2), target=st.floats(1.3, 4.9))
@settings(max_examples=60, deadline=None)
def test_planner_answers_within_its_bounds(speed, height, target):
    planner = RunningPlanner(running_gait(P, 3.0))
    decision = planner.decide(Context(np.array([speed, height]), np.array([target, 0.97])))
    u = decision.controls
    assert np.all(np.isfinite(u))
    assert np.all(np.isfinite(decision.predicted))
    assert 0.9 < u[Slot.TOUCHDOWN_ANGLE] <= np.arcsin(min(height, 1.0))
    assert 8e3 < u[Slot.K_SC] < 60e3
    assert 8e3 < u[Slot.K_SD] < 60e3


def test_after_touchdown_only_the_stiffnesses_are_free(planner, gait):
    angle = gait.controls[Slot.TOUCHDOWN_ANGLE] + 0.01
    decision = planner.decide(Context(gait.apex, None, (angle, angle)))
    assert decision.controls[Slot.TOUCHDOWN_ANGLE] == angle
    assert decision.controls[Slot.K_SC] != decision.controls[Slot.K_SD]
    u = gait.controls.copy()
    u[Slot.TOUCHDOWN_ANGLE] = angle
    left, _ = ReturnMap(P, "r").step(gait.apex, u)
    assert np.linalg.norm(decision.predicted[:2] - gait.apex) < 0.5 * np.linalg.norm(
        left - gait.apex
    )


def test_a_foot_that_lands_changes_no_aim(planner, gait):
    begun = planner.decide(Context(gait.apex))
    # As it lands, the legs' swing adds more to the speed than the pace is.
    z, angle = gait.apex + [0.3, 0.0], gait.controls[Slot.TOUCHDOWN_ANGLE]
    landed, pushed = (
        planner.decide(Context(z, None, (angle, angle), cause, begun))
        for cause in (Cause.TOUCHDOWN, Cause.DEVIATION)
    )
    assert landed.nominal
    assert not pushed.nominal
    assert abs(landed.predicted[0] - gait.apex[0]) < abs(pushed.predicted[0] - gait.apex[0])


def test_what_every_stride_adds_is_learnt(planner, gait):
    step, extra = ReturnMap(P, "r"), np.array([-0.03, 0.004])
    z = gait.apex
    for _ in range(60):
        decision = planner.decide(Context(z))
        z = step.step(z, decision.controls)[0] + extra
        planner.observe(decision, z)
    np.testing.assert_allclose(planner.offset[:2], extra, atol=1e-4)
    # The regularisation leaves a little of it.
    assert abs(z[0] - gait.apex[0]) < 0.01
    assert abs(z[1] - gait.apex[1]) < 0.001
    planner.reset()
    assert not planner.offset.any()


def test_a_push_is_no_offset(planner, gait):
    decision = planner.decide(Context(gait.apex))
    planner.observe(decision, gait.apex + [1.0, -0.1])
    limit = SURPRISE_BOUND * OFFSET_GAIN
    np.testing.assert_allclose(planner.offset[:2], limit * [1.0, -1.0])


def test_templates_of_all_sizes_are_planned_alike(planner, gait):
    small = SlipParameters(mass=10.0, gravity=3.7, rest_length=0.4, leg_stiffness=500.0)
    speed = np.sqrt(small.gravity * small.rest_length / (P.gravity * P.rest_length))
    other = RunningPlanner(running_gait(small, 3.0 * speed))
    z = gait.apex + [0.1, -0.005]
    u = planner.decide(Context(z)).controls
    v = other.decide(Context(z * [speed, small.rest_length])).controls
    unit = P.mass * P.gravity / P.rest_length
    other_unit = small.mass * small.gravity / small.rest_length
    np.testing.assert_allclose(v[0], u[0], rtol=1e-6)
    np.testing.assert_allclose(v[1:3] / other_unit, u[1:3] / unit, rtol=1e-5)


@pytest.mark.parametrize("options", [AGILE, replace(AGILE, brake=None, rounds=4)])
@pytest.mark.parametrize("speed", [3.2, 2.7, 2.5, 2.25])
def test_a_run_that_is_too_fast_slows_down_whatever_it_is_asked_for(options, speed):
    z, target = np.array([speed, 0.971]), running_gait(P, max(speed - 0.6, 1.9)).apex
    decision = RunningPlanner(running_gait(P, 1.5), options).decide(Context(z, target))
    end, outcome = ReturnMap(P, "r").step(z, decision.controls)
    assert outcome is Outcome.SECTION
    assert end[0] - speed < -0.12, "the great change that is asked for made it 0.05 m/s once"
    assert abs(end[1] - 0.975) < 0.01


def test_of_the_strides_that_aim_at_less_the_nearest_is_taken():
    asked = []

    def solve(goal):
        asked.append(round(goal[0], 9))
        made = 0.1 if goal[0] > 3.3 else goal[0] - 3.0
        return np.array([goal[0]]), np.array([3.0 + made, goal[1]])

    z, aim = np.array([3.0, 0.97]), np.array([3.4, 0.97])
    _, end = solve_within_reach(solve, z, aim, 0.1)
    assert asked == [3.4, 3.28]
    assert end[0] == pytest.approx(3.28)
    asked.clear()
    assert solve_within_reach(solve, z, aim, 0.35)[1][0] == pytest.approx(3.1)
    assert solve_within_reach(lambda goal: (goal, None), z, aim, 0.1)[1] is None
    assert asked == [3.4]


@pytest.mark.parametrize(("ahead", "lets_go"), [(-0.004, False), (0.004, True)])
def test_a_leg_beyond_its_rest_length_lets_go_at_once(planner, gait, ahead, lets_go):
    """On a path from there it pulls, and would reach its rest length again 0.4 s later."""
    supervisor = StrideSupervisor(SteadyRoute.of(gait), {"r": planner}, ReplanOptions())
    start = TemplateState(APEX.state(gait.apex), np.zeros(2))
    supervisor.begin(APEX)
    supervisor.decide(APEX, start, 0.0, EstimatorState(load=1.0, trim=0.0, lean=0.0))
    stride = simulate_stride(P, STRIDE_START["r"], start.state, supervisor.decision.controls)
    down, *_, liftoff = (e for e in stride.events if e.event is not Event.APEX)
    toe = down.state[0] + P.rest_length * np.cos(supervisor.decision.controls[0])
    robot = TemplateState(liftoff.state + [ahead, 0.0, 0.0, 0.0], np.array([toe, toe]))
    supervisor.replan(Cause.DEVIATION, AUTOMATON.node(liftoff.source), robot, 0.3, phase_time=0.3)
    due = supervisor.time_of(Event.REAR_LIFTOFF)
    assert due == 0.0 if lets_go else 0.0 < due < 0.01
