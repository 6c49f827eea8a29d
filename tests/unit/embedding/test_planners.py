"""Planners: what they choose on the template, for every state, and when they plan anew."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import template_control as tc
from template_control.embedding.learners import MomentumTrim
from template_control.embedding.planners import lqr
from template_control.embedding.planners.lqr import LqrOptions, LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Cause, Context, RestContext
from template_control.embedding.recovery import Recovery
from template_control.embedding.replanning import (
    AGILITY,
    SOONEST,
    SOONEST_SHARE,
)
from template_control.embedding.rollout import ReplanOptions, RoutePlanners
from template_control.embedding.state import EstimatorState, TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event, Outcome, Slot
from template_control.slip.control.touchdown import touchdown_angle_after
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import uncontrolled, vlo_jacobians
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute

P = SlipParameters()


@pytest.fixture(params=[LqrPlanner, ModifiedPlanner])
def planner(request, gait):
    return request.param(gait)


def test_planner_leaves_the_gait_alone(planner, gait):
    decision = planner.decide(Context(gait.vlo))
    assert decision.feasible
    assert decision.nominal
    np.testing.assert_allclose(decision.predicted, gait.vlo, atol=4e-3)
    assert decision.controls[Slot.TOUCHDOWN_ANGLE] == pytest.approx(np.radians(66.0), abs=4e-3)


def test_dear_controls_are_changed_less_and_dear_states_more(gait):
    z = gait.vlo + [0.02, 0.003, -0.03]

    def change(**costs):
        decision = LqrPlanner(gait, LqrOptions(**costs)).decide(Context(z))
        return abs(decision.controls - gait.controls)[Slot.TOUCHDOWN_ANGLE]

    assert change(control_cost=(5e3, 2e3, 2e3)) < 0.5 * change()
    assert change(state_cost=(1e3, 1e4, 1e3)) > change()


def test_the_modified_planner_keeps_its_bounds(gait):
    alpha, z = gait.controls[Slot.TOUCHDOWN_ANGLE], gait.vlo + [0.3, 0.0, 0.0]
    angles = [
        ModifiedPlanner(gait, ModifiedOptions(**bounds)).decide(Context(z)).controls[0]
        for bounds in ({}, {"angle_range": (-0.01, 0.01)}, {"top_margin": 0.2})
    ]
    assert abs(angles[0] - alpha) > 0.02
    assert abs(angles[1] - alpha) <= 0.01 + 1e-12
    assert angles[2] <= np.arcsin(z[1] / P.rest_length) - 0.2 + 1e-12
    near = Context(gait.vlo + [0.02, 0.0, 0.0])
    for tolerance in (1e-6, 0.05):
        planner = ModifiedPlanner(gait, ModifiedOptions(tolerance=tolerance))
        assert planner.decide(near).nominal == (tolerance > 1e-3)


def test_prediction_is_the_exact_map(planner, gait):
    z = gait.vlo + [0.02, 0.003, -0.03]
    decision = planner.decide(Context(z))
    z_next, outcome = ReturnMap(P).step(z, decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted, z_next, atol=1e-9)


@given(speed=st.floats(0.4, 1.8), height=st.floats(0.85, 1.0), vertical=st.floats(-0.5, 0.5))
@settings(max_examples=60, deadline=None)
def test_planner_answers_for_every_state(brisk_gait, speed, height, vertical):
    for kind in (LqrPlanner, ModifiedPlanner):
        decision = kind(brisk_gait).decide(Context(np.array([speed, height, vertical])))
        alpha = decision.controls[Slot.TOUCHDOWN_ANGLE]
        assert np.all(np.isfinite(decision.controls))
        # Above asin(y / l0) the foot would be under the ground already.
        assert np.sin(alpha) < height
        k0 = P.leg_stiffness
        for slot in (Slot.K_SC, Slot.K_SD):
            assert 0.5 * k0 - 1e-6 <= decision.controls[slot] <= 1.5 * k0 + 1e-6


@pytest.mark.parametrize("z", [[1.18, 0.927, -0.14], [1.3, 0.94, -0.4], [1.37, 0.948, -0.39]])
def test_a_foot_can_be_given_time_until_touchdown(gait, z):
    earliest, times = 0.03, []
    for options in (LqrOptions(earliest_touchdown=t) for t in (0.0, earliest)):
        decision = LqrPlanner(gait, options).decide(Context(np.array(z)))
        assert decision.feasible
        stride = simulate_stride(P, STRIDE_START["w"], VLO.state(z), decision.controls)
        times.append(stride.time_of(Event.TOUCHDOWN))
    assert times[0] < earliest
    assert times[1] > 0.99 * earliest


def test_time_until_touchdown_changes_nothing_where_there_is_enough(gait):
    z = gait.vlo + [0.02, 0.003, -0.03]
    hasty, calm = (
        LqrPlanner(gait, LqrOptions(earliest_touchdown=t)).decide(Context(z)) for t in (0, 0.1)
    )
    np.testing.assert_array_equal(hasty.controls, calm.controls)


@pytest.mark.parametrize("shift", [[0.04, 0.0, 0.0], [0.0, 0.006, 0.0], [0.0, 0.0, 0.1]])
def test_lqr_brings_the_template_back(gait, shift):
    planner, z = LqrPlanner(gait), gait.vlo + shift
    for _ in range(25):
        z, outcome = ReturnMap(P).step(z, planner.decide(Context(z)).controls)
        assert outcome is Outcome.SECTION
    np.testing.assert_allclose(z, gait.vlo, atol=2e-3)


def test_lqr_settles_on_target_in_spite_of_an_offset(gait):
    """A plant that adds a constant to every step still ends at the gait."""
    planner, z = LqrPlanner(gait), gait.vlo.copy()
    offset = np.array([0.008, -0.001, 0.02])
    for _ in range(80):
        decision = planner.decide(Context(z))
        z, outcome = ReturnMap(P).step(z, decision.controls)
        assert outcome is Outcome.SECTION
        z = z + offset
        planner.observe(decision, z)
    np.testing.assert_allclose(planner.offset, offset, atol=1e-4)
    error = np.abs(z - gait.vlo)
    assert np.all(error < [0.011, 0.005, 0.03])


def test_modified_planner_meets_the_energy_of_equation_38(gait):
    planner = ModifiedPlanner(gait)
    z = gait.vlo + [0.03, 0.002, 0.0]
    decision = planner.decide(Context(z))
    k0, k2 = P.leg_stiffness, decision.controls[Slot.K_SD]
    assert k2 != k0
    # Stance stiffness is back at k0 at the next VLO; the reset's energy is part of (38) only
    # where the height met is the wanted one, so compare before the reset.
    y = decision.predicted[1]
    before_reset = VLO.energy(P, decision.predicted) + 0.5 * (k2 - k0) * (1.0 - y) ** 2
    injected = 0.5 * (k2 - k0) * (1.0 - gait.vlo[1]) ** 2
    assert before_reset == pytest.approx(gait.energy + injected, abs=1e-6)


def test_unreachable_state_is_said(planner, gait):
    decision = planner.decide(Context(gait.vlo + [0.5, 0.01, 0.3]))
    assert not decision.nominal


NOTHING = EstimatorState(load=1.0, trim=0.0, lean=0.0)


def planned(gait, options=None):
    """The planning of a walk that keeps its gait."""
    return StrideSupervisor(
        SteadyRoute.of(gait), {"w": LqrPlanner(gait)}, options or ReplanOptions()
    )


@pytest.mark.parametrize("side", [-1.0, 1.0], ids=["before", "after"])
def test_after_a_turn_a_stride_is_decided_where_the_template_passes_its_section(gait, side):
    passed = gait.vlo + [0.0, 0.0, 0.05 * side]
    stride = simulate_stride(
        P, STRIDE_START["w"], VLO.state(gait.vlo + [0, 0, 0.05]), gait.controls
    )
    x, y, dx, dy = stride.sample([0.012])[0, :4]
    planning = planned(gait)
    planning.begin(VLO)
    planning.decide(VLO, TemplateState(state=VLO.state(gait.vlo)), 0.0, NOTHING)
    sensed = TemplateState(state=np.array([side * x, y, dx, side * dy]))
    planning.decide(VLO, sensed, 0.6, NOTHING, gait.vlo)
    np.testing.assert_allclose(planning.reports[-1].state, passed, atol=1e-6)
    assert abs(sensed.state[3] - passed[2]) > 0.02, "and not where the robot is"
    np.testing.assert_allclose(planning.planner.offset, 0.0, atol=1e-3)


@pytest.mark.parametrize(("before", "speed_kept"), [("w", True), ("rw", False)])
def test_a_walk_after_a_run_forgets_what_its_steps_added_to_the_speed(gait, before, speed_kept):
    planner = LqrPlanner(gait)
    route = SteadyRoute.of(gait)
    planners = RoutePlanners(route, {"w": planner, "rw": planner}, AUTOMATON, Recovery(P))
    report, *_ = planners.decide(VLO, Context(gait.vlo), 0.0, NOTHING, None)
    planner.offset = np.array([0.02, -0.002, -0.05])
    goal = replace(report.goal, stride=before)
    off_law = replace(report, goal=goal, decision=replace(report.decision, nominal=False))
    there, *_ = planners.decide(VLO, Context(gait.vlo), 0.5, NOTHING, off_law)
    kept = [0.02 if speed_kept else 0.0, -0.002, -0.05]
    np.testing.assert_array_equal(there.offset, kept)
    if not speed_kept:
        fresh = LqrPlanner(gait)
        fresh.offset = np.array(kept)
        fresh.forget()
        np.testing.assert_array_equal(
            there.decision.controls, fresh.decide(Context(gait.vlo)).controls
        )


def test_overdue_ground_keeps_the_template_in_single_stance(gait):
    supervisor = planned(gait)
    sensed = TemplateState(np.array([0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2]]), np.zeros(2))
    node = AUTOMATON.node(STRIDE_START["w"])
    supervisor.decide(VLO, sensed, 0.0, NOTHING)
    touchdown = supervisor.time_of(Event.TOUCHDOWN)
    assert supervisor.surprise(node, 0.0, touchdown + 0.009, 10.0) is None
    assert supervisor.surprise(node, 0.0, touchdown + 0.011, 10.0) is Cause.OVERDUE
    stride = simulate_stride(P, node.name, sensed.state, supervisor.decision.controls)
    sensed.state[:] = stride.sample(touchdown - 1e-6)[0][:4]
    supervisor.replan(Cause.OVERDUE, node, sensed, touchdown)
    assert supervisor.without_touchdown
    assert supervisor.time_of(Event.TOUCHDOWN) > 0.03, "not at once"
    assert supervisor.surprise(node, 0.0, 1.0, 10.0) is None, "once is enough"
    assert supervisor.surprise(node, 1.0, 1.0, 10.0) is None


def test_a_template_that_would_take_off_is_planned_from_the_ground(gait):
    supervisor = planned(gait)
    high = np.array([1.1, 0.999, 0.4])
    assert not supervisor.planners["w"].decide(Context(high)).feasible
    sensed = TemplateState(np.array([0.0, high[1], high[0], high[2]]), np.zeros(2))
    supervisor.decide(VLO, sensed, 0.0, NOTHING)
    report = supervisor.reports[0]
    assert not report.decision.feasible, "the record keeps the truth"
    np.testing.assert_array_equal(report.state, high)
    assert np.isfinite(supervisor.time_of(Event.TOUCHDOWN))


@settings(max_examples=20, deadline=None)
@given(st.floats(0.02, 0.12), st.floats(-0.2, 0.2), st.floats(-0.02, 0.005))
def test_a_disturbed_step_is_planned_from_the_vlo_it_seems_to_come_from(
    gait, later, faster, higher
):
    node = AUTOMATON.node(STRIDE_START["w"])
    supervisor = planned(gait)
    sensed = TemplateState(np.array([0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2]]), np.zeros(2))
    supervisor.decide(VLO, sensed, 0.0, NOTHING)
    u = supervisor.decision.controls
    z = gait.vlo + [faster, higher, 0.0]
    disturbed = simulate_stride(P, node.name, VLO.state(z), u)
    assume(later < disturbed.time_of(Event.TOUCHDOWN))
    sensed.state[:] = disturbed.sample(later)[0][:4]
    left = supervisor.time_of(Event.TOUCHDOWN) - later
    change = AGILITY * left**2
    # The foot needs some time until it is down, if it had so much.
    soonest = max(min(left, SOONEST, SOONEST_SHARE * gait.step_duration), 0.002)
    where = sensed.state, sensed.toes, P
    most = min(u[0] + change, touchdown_angle_after(*where, u[Slot.K_SC], soonest))
    supervisor.replan(Cause.DEVIATION, node, sensed, later, phase_time=later)
    expected = LqrPlanner(gait).decide(Context(z, angles=(min(u[0] - change, most), most))).controls
    np.testing.assert_allclose(supervisor.decision.controls, expected, rtol=1e-6)
    assert supervisor.time_of(Event.TOUCHDOWN) >= 0.9 * soonest
    assert len(supervisor.reports) == 1


@pytest.mark.parametrize("time", [0.0, 0.02, 0.06])
def test_a_leg_at_a_later_angle_lands_then(gait, time):
    node = STRIDE_START["w"]
    early = simulate_stride(P, node, VLO.state(gait.vlo), gait.controls).sample(0.05)[0][:4]
    u, toes = gait.controls.copy(), np.zeros(2)
    u[Slot.TOUCHDOWN_ANGLE] = touchdown_angle_after(early, toes, P, u[Slot.K_SC], time) - 1e-9
    landed = simulate_stride(P, node, early, u).time_of(Event.TOUCHDOWN)
    assert landed == pytest.approx(time, abs=1e-6 + 2.0 * time**2), "the series ends there"


def test_a_step_is_not_planned_anew_with_a_touchdown_that_is_over(gait):
    """The template's foot cannot land below the ground: it would never, and the robot's stay up."""
    node, supervisor = AUTOMATON.node(STRIDE_START["w"]), planned(gait)
    sensed = TemplateState(VLO.state(gait.vlo), np.zeros(2))
    supervisor.decide(VLO, sensed, 0.0, NOTHING)
    touchdown = supervisor.time_of(Event.TOUCHDOWN)
    u = supervisor.decision.controls
    landing = simulate_stride(P, node.name, sensed.state, u).sample(touchdown - 1e-6)[0][:4]
    sensed.state[:] = landing + [0.0, -0.004, 0.15, 0.0]
    supervisor.replan(Cause.DEVIATION, node, sensed, touchdown, phase_time=touchdown)
    assert 0.0 <= supervisor.time_of(Event.TOUCHDOWN) < 0.005


def test_surprise_is_a_large_deviation_some_time_after_the_last_plan(gait):
    supervisor = planned(gait, ReplanOptions(speed=0.05, interval=0.02))
    node = AUTOMATON.node(STRIDE_START["w"])
    assert supervisor.surprise(node, -0.06, phase_time=0.1, now=0.1) is Cause.DEVIATION
    assert supervisor.surprise(node, 0.04, phase_time=0.1, now=0.1) is None
    assert supervisor.surprise(node, 0.06, phase_time=0.01, now=0.1) is None
    assert supervisor.surprise(node, 0.06, phase_time=0.1, now=0.01) is None


def test_a_step_that_does_not_go_on_is_tried_again_and_again(gait):
    supervisor = planned(gait)
    sensed = TemplateState(VLO.state(np.array([0.2, 0.85, 0.0])), np.zeros(2))  # it falls back
    node = supervisor.decide(VLO, sensed, 0.0, NOTHING)
    assert not supervisor.decision.feasible
    assert supervisor.surprise(node, 0.0, 0.01, 0.01) is None, "this was just planned"
    assert supervisor.surprise(node, 0.0, 0.03, 0.03) is Cause.NO_FUTURE
    stride = simulate_stride(P, node.name, VLO.state(gait.vlo), gait.controls)
    sensed.state[:] = stride.sample(0.05)[0][:4]
    supervisor.replan(Cause.DEVIATION, node, sensed, 0.03, phase_time=0.03)
    assert supervisor.decision.feasible
    assert supervisor.surprise(node, 0.0, 0.03, 0.06) is None


def test_a_stride_that_is_not_completed_is_planned_again_by_any_planner(gait):
    supervisor = planned(gait)
    supervisor.planners["w"].retries = False
    sensed = TemplateState(VLO.state(gait.vlo), np.zeros(2))
    node = supervisor.decide(VLO, sensed, 0.0, NOTHING)
    assert supervisor.decision.feasible
    assert supervisor.surprise(node, 0.0, 0.03, 0.03) is None, "it goes on"
    sensed.state[2] = 0.1  # it falls back
    supervisor.follow(node, sensed, 0.03)
    assert supervisor.decision.feasible, "as it was decided"
    assert supervisor.surprise(node, 0.0, 0.03, 0.06) is Cause.NO_FUTURE


def test_a_stride_may_have_come_here_on_the_legs_of_the_gait(gait):
    """With legs so stiff the CoM was in the air before."""
    node, supervisor = AUTOMATON.node(STRIDE_START["w"]), planned(gait)
    sensed = TemplateState(VLO.state(gait.vlo), np.zeros(2))
    supervisor.decide(VLO, sensed, 0.0, NOTHING)
    stiff = supervisor.decision.controls.copy()
    stiff[Slot.K_SC] *= 4.0
    supervisor.decision = replace(supervisor.decision, controls=stiff)
    stride = simulate_stride(P, node.name, VLO.state(gait.vlo), gait.controls)
    sensed.state[:] = stride.sample(0.1)[0][:4]
    supervisor.replan(Cause.DEVIATION, node, sensed, 0.1, phase_time=0.1)
    decision = supervisor.decision
    assert decision.feasible
    np.testing.assert_allclose(decision.predicted, gait.vlo, atol=1e-3)


def knee_moment(gait, z, controls):
    """Of the stiffest leg's force about its knee at the virtual bottom, at most [N m]."""
    stride = simulate_stride(gait.parameters, STRIDE_START[gait.stride], VLO.state(z), controls)
    bottom = next(e for e in stride.events if e.event is Event.VIRTUAL_BOTTOM).state
    toes = 0.0, stride.toes[0]  # the front leg of the step is the rear one after it
    moments = []
    for toe, slots in zip(toes, ((Slot.K_SC, Slot.K_PUSH), (Slot.K_SC,)), strict=True):
        length = np.hypot(bottom[0] - toe, bottom[1])
        force = max(controls[slot] for slot in slots) * (gait.parameters.rest_length - length)
        moments.append(force * 0.5 * np.sqrt(1.095**2 - length**2))
    return max(moments)


@pytest.mark.parametrize(
    "z", [(0.784, 0.993, 0.05), (0.768, 0.974, 0.298), (0.756, 0.98, 0.156), (0.679, 0.964, 0.283)]
)
def test_a_slow_robot_gets_no_step_that_its_knees_do_not_carry(z):
    """Two-link legs, whose knees are straight at 1.095 m, and 350 N m: five-link's."""
    gait, free = tc.default_gait(tc.load_robot("five-link")), LqrOptions(knee_load_price=0.0)
    z = np.array(z)
    without, bounded = (LqrPlanner(gait, o).decide(Context(z)) for o in (free, LqrOptions()))
    assert knee_moment(gait, z, without.controls) > 400.0
    assert knee_moment(gait, z, bounded.controls) < 360.0
    assert bounded.lasting


def test_the_rest_of_a_slow_step_is_not_made_soft(monkeypatch):
    """What brakes takes energy out; that of a fast step may."""
    bounds = []

    def solved(ahead, aim, prior, weights):
        bounds.append(prior.table[2] / k0)
        return prior.controls, aim

    monkeypatch.setattr(lqr, "solve_stride", solved)
    gait = tc.default_gait(tc.load_robot("five-link"))
    planner = LqrPlanner(gait)
    k0, slots = gait.parameters.leg_stiffness, [int(Slot.K_SD)]
    for speed, least in ((0.3, 0.75), (1.5, 0.5)):
        slower = gait.vlo + [speed - gait.vlo[0], 0.0, 0.0]

        def ahead(u, end=slower):
            return end, Outcome.SECTION

        decision = planner.decide(Context(gait.vlo))
        planner.decide_rest(RestContext(ahead, decision, gait.vlo, slots))
        np.testing.assert_allclose(bounds[-1], least)


def test_trim_goes_against_the_drift_that_no_control_takes_away(gait):
    a, b = vlo_jacobians(gait)
    n = uncontrolled(gait)
    np.testing.assert_allclose(n @ b, 0.0, atol=1e-6)
    # Such a drift must show in dy/dt at VLO, and in nothing else.
    np.testing.assert_allclose((n @ (np.eye(3) - a))[:2], 0.0, atol=1e-6)
    supervisor = planned(gait)
    sensed = TemplateState(np.array([0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2]]), np.zeros(2))
    supervisor.decide(VLO, sensed, 0.0, NOTHING)
    plan = supervisor.path
    trim = MomentumTrim(P)
    trim.end_stride(plan.section_state + 1.0, True)  # nothing was expected yet
    assert trim.acceleration == 0.0
    trim.expect(plan, gait)
    trim.end_stride(plan.section_state + [1.0, 0.0, 0.0], False)  # a push
    assert trim.acceleration == 0.0
    for _ in range(20):
        trim.end_stride(
            plan.section_state + b @ [0.01, 0.01, -0.02], True
        )  # the planner's business
        trim.end_stride(plan.section_state + [0.0024, 0.0, 0.0], True)  # within the dead zone
        trim.end_stride(plan.section_state - [0.0024, 0.0, 0.0], True)
    assert trim.acceleration == 0.0
    # A robot whose drift yields to the trim settles within the dead zone.
    duration = plan.time_of(Event.REAR_LIFTOFF) - plan.time_of(Event.TOUCHDOWN)
    for _ in range(100):
        drift = 0.01 + trim.acceleration * duration
        trim.end_stride(plan.section_state + [drift, 0.0, 0.0], True)
    assert 0.0 < drift <= 0.0008 * np.sqrt(9.81)
    for _ in range(100):
        trim.end_stride(plan.section_state + [9.0, 0.0, 0.0], True)
    assert trim.acceleration == pytest.approx(-0.03 * 9.81)
    # After another kind of stride it begins anew.
    trim.forget()
    assert (trim.acceleration, trim.drift) == (0.0, 0.0)
    for _ in range(100):
        trim.end_stride(plan.section_state + [9.0, 0.0, 0.0], True)
    # A path without a double stance teaches nothing.
    trim.expect(replace(plan, events=plan.events[:1]), gait)
    trim.end_stride(plan.section_state - [9.0, 0.0, 0.0], True)
    assert trim.acceleration == pytest.approx(-0.03 * 9.81)
