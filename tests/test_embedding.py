"""Planners, plans, phases, swing foot, guards: the parts of the embedding."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from template_control.embedding.guards import Sensed, fired
from template_control.embedding.load import LoadEstimate, LoadOptions
from template_control.embedding.lqr import LqrPlanner
from template_control.embedding.modified import ModifiedPlanner
from template_control.embedding.momentum_trim import MomentumTrim, TrimOptions, uncontrolled
from template_control.embedding.plan import at_phase, chain, sample
from template_control.embedding.references import leg_forces
from template_control.embedding.start import state_at_vlo
from template_control.embedding.step_planning import ReplanOptions, StepPlanning
from template_control.embedding.swing_foot import SwingFoot, SwingOptions, quintic_step
from template_control.errors import GaitError, RobotError
from template_control.slip.automaton import AUTOMATON, STRIDE_START
from template_control.slip.gait import (
    gait_at,
    gait_for_speed,
    gait_from_energy,
    vlo_energy,
    vlo_jacobians,
)
from template_control.slip.parameters import SlipParameters
from template_control.slip.return_map import ReturnMap
from template_control.slip.stride import controls, run
from template_control.slip.vocabulary import Event, Outcome, Slot

P = SlipParameters()


@pytest.fixture(params=[LqrPlanner, ModifiedPlanner])
def planner(request, gait):
    return request.param(gait)


def test_planner_leaves_the_gait_alone(planner, gait):
    decision = planner.decide(gait.vlo)
    assert decision.feasible
    assert decision.reached
    np.testing.assert_allclose(decision.predicted, gait.vlo, atol=4e-3)
    assert decision.controls[Slot.TOUCHDOWN_ANGLE] == pytest.approx(np.radians(66.0), abs=4e-3)


def test_prediction_is_the_exact_map(planner, gait):
    z = gait.vlo + [0.02, 0.003, -0.03]
    decision = planner.decide(z)
    z_next, outcome = ReturnMap(P).step(z, decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted, z_next, atol=1e-9)


@given(speed=st.floats(0.4, 1.8), height=st.floats(0.85, 1.0), vertical=st.floats(-0.5, 0.5))
@settings(max_examples=60, deadline=None)
def test_planner_answers_for_every_state(speed, height, vertical):
    gait = gait_for_speed(P, 1.2)
    for kind in (LqrPlanner, ModifiedPlanner):
        decision = kind(gait).decide(np.array([speed, height, vertical]))
        alpha = decision.controls[Slot.TOUCHDOWN_ANGLE]
        assert np.all(np.isfinite(decision.controls))
        # Above asin(y / l0) the foot would be under the ground already.
        assert np.sin(alpha) < height
        k0 = P.leg_stiffness
        for slot in (Slot.K_SC, Slot.K_SD):
            assert 0.5 * k0 - 1e-6 <= decision.controls[slot] <= 1.5 * k0 + 1e-6


@pytest.mark.parametrize("shift", [[0.04, 0.0, 0.0], [0.0, 0.006, 0.0], [0.0, 0.0, 0.1]])
def test_lqr_brings_the_template_back(gait, shift):
    planner, z = LqrPlanner(gait), gait.vlo + shift
    for _ in range(25):
        z, outcome = ReturnMap(P).step(z, planner.decide(z).controls)
        assert outcome is Outcome.SECTION
    np.testing.assert_allclose(z, gait.vlo, atol=2e-3)


def test_lqr_settles_on_target_in_spite_of_an_offset(gait):
    """A plant that adds a constant to every step still ends at the gait."""
    planner, z = LqrPlanner(gait), gait.vlo.copy()
    offset = np.array([0.008, -0.001, 0.02])
    for _ in range(80):
        decision = planner.decide(z)
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
    decision = planner.decide(z)
    k0, k2 = P.leg_stiffness, decision.controls[Slot.K_SD]
    assert k2 != k0
    # Stance stiffness is back at k0 at the next VLO; the reset's energy is part of (38) only
    # where the height met is the wanted one, so compare before the reset.
    y = decision.predicted[1]
    before_reset = vlo_energy(P, decision.predicted) + 0.5 * (k2 - k0) * (1.0 - y) ** 2
    injected = 0.5 * (k2 - k0) * (1.0 - gait.vlo[1]) ** 2
    assert before_reset == pytest.approx(gait.energy + injected, abs=1e-6)


def test_unreachable_state_is_said(planner, gait):
    decision = planner.decide(gait.vlo + [0.5, 0.01, 0.3])
    assert not decision.reached


def test_chained_plan_is_continuous_and_knows_its_events(gait):
    u = gait.controls
    first = run(P, STRIDE_START["w"], [2.0, gait.vlo[1], gait.vlo[0], 0.0], u, (2.0, 0.0))
    second = run(P, first.node, first.state, u, tuple(first.toes))
    plan = chain([first, second])
    times = np.linspace(0.0, plan.duration - 1e-6, 400)
    states = np.empty((400, 6))
    for t, row in zip(times, states, strict=True):
        sample(plan.cx, plan.cy, plan.meta, t, row)
    assert np.max(np.abs(np.diff(states[:, :2], axis=0))) < 0.01
    assert plan.foothold == pytest.approx(2.0 + gait.step_length, abs=1e-6)
    assert plan.touchdown < plan.liftoff < plan.vlo
    assert plan.vlo == pytest.approx(gait.step_duration, abs=1e-9)
    np.testing.assert_allclose(plan.vlo_state, gait.vlo, atol=1e-7)


@given(time=st.floats(0.0, 0.32), scale=st.floats(0.97, 1.03))
@settings(max_examples=50, deadline=None)
def test_phase_look_up_inverts_the_path(time, scale):
    gait = gait_for_speed(P, 1.2)
    u = gait.controls
    plan = chain([run(P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], u)])
    state, found = np.empty(6), np.empty(6)
    sample(plan.cx, plan.cy, plan.meta, time, state)
    # A robot on the same ray from the foot, a little nearer or farther, is in the same phase.
    t, _ = at_phase(
        plan.cx, plan.cy, plan.meta, 0.0, scale * state[0], scale * state[1], 0.2, found
    )
    assert t == pytest.approx(time, abs=1e-8)
    np.testing.assert_allclose(found, state, atol=1e-7)


def test_template_forces_accelerate_the_template(gait):
    u = gait.controls
    stride = run(P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], u)
    forces = np.empty((2, 2))
    for row in stride.meta:
        t = row[0] + 0.5 * row[1]
        s = stride.sample(t)[0]
        leg_forces(row, s[0], s[1], P.rest_length, forces)
        expected = P.mass * (s[4:] + [0.0, P.gravity])
        np.testing.assert_allclose(forces.sum(axis=0), expected, rtol=1e-9)


def test_quintic_arrives():
    state = np.array([0.1, -0.4, 3.0])
    remaining, dt = 0.3, 1e-3
    for i in range(299):
        quintic_step(state, 0.7, 0.2, remaining - i * dt, dt)
    assert state[0] == pytest.approx(0.7 - 0.2 * dt, abs=1e-5)
    assert state[1] == pytest.approx(0.2, abs=1e-3)


def test_swing_clears_the_ground_and_lands_slowly():
    options = SwingOptions()
    swing = SwingFoot(options)
    swing.start(np.array([-0.6, 0.0]), np.zeros(2))
    heights, accelerations = [], []
    for i in range(400):
        swing.advance(0.6, 0.4 - i * 1e-3, 1e-3, 0.0)
        heights.append(swing.y[0])
        accelerations.append(max(abs(swing.x[2]), abs(swing.y[2])))
    assert max(heights) == pytest.approx(options.clearance, abs=2e-3)
    assert heights[-1] == pytest.approx(0.0, abs=2e-3)
    assert min(heights) > -2e-3
    assert swing.x[0] == pytest.approx(0.6, abs=2e-3)
    assert abs(swing.x[1]) < 0.05
    assert abs(swing.y[1]) <= options.landing_speed + 1e-9
    assert max(accelerations) < 80.0


def test_swing_without_a_foothold_comes_down():
    swing = SwingFoot(SwingOptions())
    swing.start(np.array([0.0, 0.05]), np.array([1.0, 0.0]))
    for _ in range(100):
        swing.advance(np.nan, 0.3, 1e-3, 0.0)
    assert swing.y[0] == pytest.approx(0.05 - 0.02)
    assert swing.x[1] == 0.0


def test_swing_stays_within_reach_of_the_hip():
    swing = SwingFoot(SwingOptions(reach=0.97))
    swing.start(np.array([0.55, 0.1]), np.zeros(2))
    x = swing.furthest(np.array([0.2, 0.85]), 0.9)
    assert np.hypot(x - 0.2, 0.75) == pytest.approx(0.97 * 0.9)
    assert swing.furthest(np.array([0.2, 1.2]), 0.9) == 0.2, "nowhere but below the hip"


def test_swing_falls_to_ground_that_comes_late():
    options = SwingOptions()
    swing = SwingFoot(options)
    swing.start(np.array([0.6, 0.0]), np.array([0.1, -0.2]))
    for _ in range(50):
        swing.reach_down(1e-3)
    assert swing.y[0] == pytest.approx(-0.2 * 0.05 - 0.5 * options.reach_acceleration * 0.05**2)
    assert swing.x[0] == 0.6
    assert swing.x[1] == 0.0


def test_overdue_ground_keeps_the_template_in_single_stance():
    gait = gait_at(P, np.radians(66.0), 1.1)
    planning = StepPlanning(LqrPlanner(gait), ReplanOptions())
    sensed = Sensed(np.array([0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2]]), np.zeros(2))
    node = AUTOMATON.node(STRIDE_START["w"])
    planning.decide(node, sensed, 0.0, 1.0, 0.0)
    touchdown = planning.path.touchdown
    assert not planning.overdue(node, touchdown + 0.009)
    assert planning.overdue(node, touchdown + 0.011)
    stride = run(P, node.name, sensed.state, planning.steps[0].decision.controls)
    sensed.state[:] = stride.sample(touchdown - 1e-6)[0][:4]
    planning.reach_on(node, sensed, touchdown)
    assert planning.reaching
    assert planning.path.touchdown > 0.03, "not at once"
    assert not planning.overdue(node, 1.0), "once is enough"
    assert not planning.surprised(1.0, 1.0, 10.0)


def test_a_template_that_would_take_off_is_planned_from_the_ground():
    gait = gait_at(P, np.radians(66.0), 1.1)
    planning = StepPlanning(LqrPlanner(gait), ReplanOptions())
    high = np.array([1.1, 0.999, 0.4])
    assert not planning.planner.decide(high).feasible
    sensed = Sensed(np.array([0.0, high[1], high[0], high[2]]), np.zeros(2))
    planning.decide(AUTOMATON.node(STRIDE_START["w"]), sensed, 0.0, 1.0, 0.0)
    report = planning.steps[0]
    assert not report.decision.feasible, "the record keeps the truth"
    np.testing.assert_array_equal(report.state, high)
    assert np.isfinite(planning.path.touchdown)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.02, 0.12), st.floats(-0.2, 0.2), st.floats(-0.02, 0.005))
def test_a_disturbed_step_is_planned_from_the_vlo_it_seems_to_come_from(later, faster, higher):
    gait = gait_at(P, np.radians(66.0), 1.1)
    node = AUTOMATON.node(STRIDE_START["w"])
    planning = StepPlanning(LqrPlanner(gait), ReplanOptions())
    sensed = Sensed(np.array([0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2]]), np.zeros(2))
    planning.decide(node, sensed, 0.0, 1.0, 0.0)
    u = planning.steps[0].decision.controls
    z = gait.vlo + [faster, higher, 0.0]
    disturbed = run(P, node.name, [0.0, z[1], z[0], z[2]], u)
    assume(later < disturbed.time_of(Event.TOUCHDOWN))
    sensed.state[:] = disturbed.sample(later)[0][:4]
    change = ReplanOptions().agility * (planning.path.touchdown - later) ** 2
    planning.reconsider(node, sensed, later, later)
    expected = LqrPlanner(gait).decide(z, (u[0] - change, u[0] + change)).controls
    np.testing.assert_allclose(planning.steps[0].decision.controls, expected, rtol=1e-6)
    assert abs(planning.steps[0].decision.controls[0] - u[0]) <= change * (1 + 1e-12)
    assert len(planning.steps) == 1


def test_surprise_is_a_large_deviation_some_time_after_the_last_plan():
    planning = StepPlanning(
        LqrPlanner(gait_at(P, np.radians(66.0), 1.1)), ReplanOptions(speed=0.05, interval=0.02)
    )
    assert planning.surprised(-0.06, phase_time=0.1, now=0.1)
    assert not planning.surprised(0.04, phase_time=0.1, now=0.1)
    assert not planning.surprised(0.06, phase_time=0.01, now=0.1)
    assert not planning.surprised(0.06, phase_time=0.1, now=0.01)


def test_guards_feel_what_the_template_sees():
    sensed = Sensed(np.array([0.0, 0.97, 1.1, 0.0]), np.array([0.0, 0.6]), True, 1.0)

    def happened(event, phase=0.0, liftoff=np.inf):
        return fired(event, sensed, phase, liftoff, 1.0, 9.81)

    assert happened(Event.VLO)
    assert happened(Event.TOUCHDOWN)
    assert not happened(Event.VIRTUAL_BOTTOM)
    assert not happened(Event.REAR_LIFTOFF)
    assert happened(Event.REAR_LIFTOFF, phase=0.3, liftoff=0.29)
    sensed.swing_time = 0.01
    assert not happened(Event.TOUCHDOWN), "the foot that just left may still scrape"
    sensed.state[0] = -0.01
    assert not happened(Event.VLO)
    sensed.state[:2] = 0.5, 0.95
    assert happened(Event.REAR_LIFTOFF), "an overstretched leg is let go without a plan"


def test_load_learns_a_constant_and_ignores_the_gait():
    load = LoadEstimate(LoadOptions(), 9.81)
    load.end_step(True)
    for _ in range(10):
        load.observe(0.15, 0.5)  # within the dead zone
        load.end_step(True)
        load.observe(5.0, 0.5)  # a push
        load.end_step(False)
    assert load.factor == 1.0
    for _ in range(20):
        load.observe(9.81 * (1.1 - load.factor), 0.5)
        load.end_step(True)
    # At the edge of the dead zone, less what is forgotten of it there.
    assert 1.07 < load.factor < 1.09
    for _ in range(60):
        load.observe(0.0, 0.5)
        load.end_step(True)
    assert load.factor == pytest.approx(1.0, abs=1e-3)


def test_trim_goes_against_the_drift_that_no_control_takes_away(gait):
    a, b = vlo_jacobians(gait)
    n = uncontrolled(gait)
    np.testing.assert_allclose(n @ b, 0.0, atol=1e-6)
    # Such a drift must show in dy/dt at VLO, and in nothing else.
    np.testing.assert_allclose((n @ (np.eye(3) - a))[:2], 0.0, atol=1e-6)
    planning = StepPlanning(LqrPlanner(gait), ReplanOptions())
    sensed = Sensed(np.array([0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2]]), np.zeros(2))
    planning.decide(AUTOMATON.node(STRIDE_START["w"]), sensed, 0.0, 1.0, 0.0)
    plan = planning.path
    trim = MomentumTrim(gait, TrimOptions())
    trim.end_step(plan.vlo_state + 1.0, True)  # nothing was expected yet
    assert trim.acceleration == 0.0
    trim.expect(plan)
    trim.end_step(plan.vlo_state + [1.0, 0.0, 0.0], False)  # a push
    assert trim.acceleration == 0.0
    for _ in range(20):
        trim.end_step(plan.vlo_state + b @ [0.01, 0.01, -0.02], True)  # the planner's business
        trim.end_step(plan.vlo_state + [0.0024, 0.0, 0.0], True)  # within the dead zone
        trim.end_step(plan.vlo_state - [0.0024, 0.0, 0.0], True)
    assert trim.acceleration == 0.0
    # A robot whose drift yields to the trim settles within the dead zone.
    duration = plan.liftoff - plan.touchdown
    for _ in range(100):
        drift = 0.01 + trim.acceleration * duration
        trim.end_step(plan.vlo_state + [drift, 0.0, 0.0], True)
    assert 0.0 < drift <= 0.0008 * np.sqrt(9.81)
    for _ in range(100):
        trim.end_step(plan.vlo_state + [9.0, 0.0, 0.0], True)
    assert trim.acceleration == pytest.approx(-0.03 * 9.81)
    # A path without a double stance teaches nothing.
    trim.expect(replace(plan, liftoff=np.inf))
    trim.end_step(plan.vlo_state - [9.0, 0.0, 0.0], True)
    assert trim.acceleration == pytest.approx(-0.03 * 9.81)


def test_start_is_where_it_was_asked_for(robot, gait):
    swing, velocity = np.array([0.0, 0.05]), np.array([2.0, 0.0])
    q, v = state_at_vlo(robot, gait.vlo, 0, swing, velocity)
    robot.update(q, v)
    np.testing.assert_allclose(robot.com, [0.0, gait.vlo[1]], atol=1e-10)
    np.testing.assert_allclose(robot.foot_position, [[0.0, 0.0], swing], atol=1e-10)
    np.testing.assert_allclose(robot.foot_velocity, [[0.0, 0.0], velocity], atol=1e-10)
    effective = robot.com_velocity[0] + robot.angular_momentum / (80.0 * gait.vlo[1])
    assert effective == pytest.approx(gait.vlo[0], abs=1e-10)
    with pytest.raises(RobotError, match=r"reach|limits"):
        state_at_vlo(robot, np.array([1.1, 1.4, 0.0]), 0, swing, velocity)


def test_gaits_by_speed_and_impossible_ones():
    for speed in (0.9, 1.0, 1.3):
        assert gait_for_speed(P, speed).mean_speed == pytest.approx(speed, abs=1e-8)
    with pytest.raises(GaitError, match=r"5 m/s.*between"):
        gait_for_speed(P, 5.0)
    with pytest.raises(GaitError, match="leaves no speed"):
        gait_from_energy(P, 0.98, 100.0)


def test_events_lead_where_the_automaton_says(gait):
    stride = run(
        P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], controls(1.15, 1.6e4, 1.7e4)
    )
    for event in stride.events:
        assert AUTOMATON.successor(event.source, event.event) == event.target
