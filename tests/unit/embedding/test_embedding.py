"""Plans, phases, guards, the load and the start: the parts of the embedding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from robot_guards import RobotGuards

from template_control.embedding.learners import LoadEstimate
from template_control.embedding.modes import GuardOptions
from template_control.embedding.state import TemplateState
from template_control.embedding.tick import LOAD
from template_control.errors import GaitError, RobotError
from template_control.robot.start import state_at_vlo
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.gait import gait_from_energy
from template_control.slip.gaits.walking_by_speed import gait_for_speed
from template_control.slip.parameters import SlipParameters
from template_control.slip.path import at_direction, join, leg_forces, sample

P = SlipParameters()


def test_joined_path_is_continuous_and_knows_its_events(gait):
    u = gait.controls
    first = simulate_stride(
        P, STRIDE_START["w"], [2.0, gait.vlo[1], gait.vlo[0], 0.0], u, (2.0, 0.0)
    )
    second = simulate_stride(P, first.node, first.state, u, tuple(first.toes))
    path = join([first, second])
    times = np.linspace(0.0, first.duration + second.duration - 1e-6, 400)
    states = np.empty((400, 6))
    for t, row in zip(times, states, strict=True):
        sample(path.curve, t, row)
    assert np.max(np.abs(np.diff(states[:, :2], axis=0))) < 0.01
    touchdown, liftoff = path.time_of(Event.TOUCHDOWN), path.time_of(Event.REAR_LIFTOFF)
    assert touchdown < liftoff < path.time_of(Event.VLO)
    assert path.time_of(Event.VLO) == pytest.approx(gait.step_duration, abs=1e-9)
    np.testing.assert_allclose(path.section_state, gait.vlo, atol=1e-7)
    # The front leg lands first; then the one that is the rear leg's at the start.
    rear, front = path.landings
    assert front.x == pytest.approx(2.0 + gait.step_length, abs=1e-6)
    assert rear.x == pytest.approx(2.0 + 2.0 * gait.step_length, abs=1e-6)
    assert front.time == touchdown
    assert rear.time == pytest.approx(touchdown + gait.step_duration, abs=1e-9)


def test_events_that_are_over_are_not_due_again(gait):
    stride = simulate_stride(
        P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], gait.controls
    )
    path = join([stride, stride])
    first = path.time_of(Event.TOUCHDOWN)
    passed = path.after(Event.TOUCHDOWN, 0)
    assert path.time_of(Event.TOUCHDOWN, passed) == pytest.approx(first + stride.duration)
    passed = path.after(Event.TOUCHDOWN, passed)
    assert path.time_of(Event.TOUCHDOWN, passed) == np.inf
    assert path.after(Event.TOUCHDOWN, passed) == passed


def test_running_path_knows_where_either_foot_lands():
    u = controls(np.radians(68.0), 20e3, 20e3)
    first = simulate_stride(P, STRIDE_START["r"], [0.0, 1.0, 3.0, 0.0], u)
    second = simulate_stride(P, STRIDE_START["r"], first.state, u)
    path = join([first, second])
    rear, front = path.landings
    down = [e for stride in (first, second) for e in stride.events if e.event is Event.TOUCHDOWN]
    reach = P.rest_length * np.cos(u[0])
    assert rear.x == pytest.approx(down[0].state[0] + reach)
    assert front.x == pytest.approx(down[1].state[0] + reach)
    assert rear.time < path.time_of(Event.APEX) < front.time


@given(time=st.floats(0.0, 0.32), scale=st.floats(0.97, 1.03))
@settings(max_examples=50, deadline=None)
def test_phase_look_up_inverts_the_path(brisk_gait, time, scale):
    gait, u = brisk_gait, brisk_gait.controls
    curve = join(
        [simulate_stride(P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], u)]
    ).curve
    state, found = np.empty(6), np.empty(6)
    sample(curve, time, state)
    # A robot on the same ray from the foot, a little nearer or farther, is in the same phase.
    t, _ = at_direction(curve, scale * state[0], scale * state[1], 0.2, found)
    assert t == pytest.approx(time, abs=1e-8)
    np.testing.assert_allclose(found, state, atol=1e-7)


def test_template_forces_accelerate_the_template(gait):
    u = gait.controls
    stride = simulate_stride(P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], u)
    forces = np.empty((2, 2))
    for row in stride.meta:
        t = row[0] + 0.5 * row[1]
        s = stride.sample(t)[0]
        leg_forces(row, 0.0, s, np.array([P.mass, P.gravity, 0.0, P.rest_length, 0.0]), forces)
        expected = P.mass * (s[4:] + [0.0, P.gravity])
        np.testing.assert_allclose(forces.sum(axis=0), expected, rtol=1e-9)


def test_guards_feel_what_the_template_sees():
    sensed = TemplateState(np.array([0.0, 0.97, 1.1, 0.0]), np.array([0.0, 0.6]))
    guards, stand = RobotGuards(P, GuardOptions()), (True, True)

    def happened(event, due=np.inf, swung=1.0):
        edges = [e for node in AUTOMATON.nodes for e in node.edges if e.event is event]
        return guards.fired(edges[0], sensed, due, contact=stand, swing_time=(np.inf, swung))

    assert happened(Event.VLO)
    assert happened(Event.TOUCHDOWN)
    assert not happened(Event.VIRTUAL_BOTTOM)
    assert not happened(Event.REAR_LIFTOFF)
    assert happened(Event.REAR_LIFTOFF, due=-0.01)
    assert not happened(Event.TOUCHDOWN, swung=0.01), "the foot that just left may still scrape"
    sensed.state[0] = -0.01
    assert not happened(Event.VLO)
    sensed.state[:2] = 0.5, 0.95
    assert happened(Event.REAR_LIFTOFF), "an overstretched leg is let go without a plan"


def test_touchdown_is_the_placed_leg_s():
    guards = RobotGuards(P, GuardOptions())
    walking = AUTOMATON.start("w").edge(Event.TOUCHDOWN)
    running = AUTOMATON.start("r").edge(Event.TOUCHDOWN)
    for leg, edge, other in ((0, running, walking), (1, walking, running)):
        contact, sensed = (leg == 0, leg == 1), TemplateState(toes=np.array([0.3, 0.3]))
        assert guards.fired(edge, sensed, np.inf, contact=contact)
        assert not guards.fired(other, sensed, np.inf, contact=contact)


def observe_load(data, feedback, duration):
    data["sum"] += feedback * duration
    data["time"] += duration


def test_load_learns_a_constant_and_ignores_the_gait():
    load = LoadEstimate(9.81, np.zeros(1, LOAD))
    load.end_stride(True)
    for _ in range(10):
        observe_load(load.data[0], 0.15, 0.5)  # within the dead zone
        load.end_stride(True)
        observe_load(load.data[0], 5.0, 0.5)  # a push
        load.end_stride(False)
    assert load.factor == 1.0
    for _ in range(20):
        observe_load(load.data[0], 9.81 * (1.1 - load.factor), 0.5)
        load.end_stride(True)
    # At the edge of the dead zone, less what is forgotten of it there.
    assert 1.07 < load.factor < 1.09
    for _ in range(60):
        observe_load(load.data[0], 0.0, 0.5)
        load.end_stride(True)
    assert load.factor == pytest.approx(1.0, abs=1e-3)


def test_a_load_is_learnt_from_strides_off_the_gait_that_agree():
    """A push is over by the next stride; a load that leads the robot off its gait is not."""
    load = LoadEstimate(9.81, np.zeros(1, LOAD))
    for feedback in (-1.5, 1.2, -0.9):
        observe_load(load.data[0], feedback, 0.5)
        load.end_stride(False)
    assert load.factor == 1.0
    for _ in range(12):
        observe_load(load.data[0], 9.81 * (0.9 - load.factor), 0.5)
        load.end_stride(False)
    assert 0.88 < load.factor < 0.93


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
    with pytest.raises(GaitError, match=r"5 m/s.*0\.25 to 1\.50"):
        gait_for_speed(P, 5.0)
    with pytest.raises(GaitError, match="leaves no speed"):
        gait_from_energy(P, 0.98, 100.0)


def test_events_lead_where_the_automaton_says(gait):
    stride = simulate_stride(
        P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], controls(1.15, 1.6e4, 1.7e4)
    )
    for event in stride.events:
        assert AUTOMATON.successor(event.source, event.event) == event.target
