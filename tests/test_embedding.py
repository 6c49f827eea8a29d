"""Plans, phases, guards, the load and the start: the parts of the embedding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.embedding.guards import Sensed, fired
from template_control.embedding.load import LoadEstimate, LoadOptions
from template_control.embedding.plan import at_phase, chain, sample
from template_control.embedding.references import leg_forces
from template_control.errors import GaitError, RobotError
from template_control.robot.start import state_at_vlo
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.gait import gait_for_speed, gait_from_energy
from template_control.slip.parameters import SlipParameters

P = SlipParameters()


def test_chained_plan_is_continuous_and_knows_its_events(gait):
    u = gait.controls
    first = simulate_stride(
        P, STRIDE_START["w"], [2.0, gait.vlo[1], gait.vlo[0], 0.0], u, (2.0, 0.0)
    )
    second = simulate_stride(P, first.node, first.state, u, tuple(first.toes))
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
def test_phase_look_up_inverts_the_path(brisk_gait, time, scale):
    gait, u = brisk_gait, brisk_gait.controls
    plan = chain([simulate_stride(P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], u)])
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
    stride = simulate_stride(P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], u)
    forces = np.empty((2, 2))
    for row in stride.meta:
        t = row[0] + 0.5 * row[1]
        s = stride.sample(t)[0]
        leg_forces(row, s[0], s[1], P.rest_length, forces)
        expected = P.mass * (s[4:] + [0.0, P.gravity])
        np.testing.assert_allclose(forces.sum(axis=0), expected, rtol=1e-9)


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
    stride = simulate_stride(
        P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], controls(1.15, 1.6e4, 1.7e4)
    )
    for event in stride.events:
        assert AUTOMATON.successor(event.source, event.event) == event.target
