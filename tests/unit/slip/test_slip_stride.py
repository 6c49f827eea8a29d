"""The event-exact simulation against energy, symmetry and scipy's DOP853."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Event, Outcome
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
ALPHA = np.radians(66.0)
START = [0.0, 0.978, 1.1, 0.02]


def legs_acceleration(state, toes, stiffness):
    x, y = state[:2]
    a = np.array([0.0, -P.gravity])
    for toe, k in zip(toes, stiffness, strict=True):
        leg = np.array([x - toe, y])
        length = np.hypot(*leg)
        a += k * (P.rest_length - length) / P.mass * leg / length
    return a


def integrate(state, toes, stiffness, guard):
    """DOP853 at 1e-12 until ``guard(state)`` rises through zero."""

    def event(_, s):
        return guard(s)

    event.terminal, event.direction = True, 1.0
    solution = solve_ivp(
        lambda _, s: [*s[2:], *legs_acceleration(s, toes, stiffness)],
        (0.0, 3.0),
        state,
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
        events=event,
    )
    assert solution.t_events[0].size == 1
    return solution.t_events[0][0], solution.y_events[0][0]


def walk_by_scipy(state, alpha, k1, k2, push=None):
    """Event times and final state of one walking step, phase by phase."""
    l0 = P.rest_length
    rear = (k1, k2) if push is None else (push, push)
    times = []
    t, s = integrate(state, [0.0], [k1], lambda s: l0 * np.sin(alpha) - s[1])
    times.append(t)
    toe = s[0] + l0 * np.cos(alpha)
    t, s = integrate(s, [0.0, toe], [rear[0], k1], lambda s: (s[0] - toe / 2) * s[2] + s[1] * s[3])
    times.append(t)
    t, s = integrate(s, [0.0, toe], [rear[1], k2], lambda s: np.hypot(s[0], s[1]) - l0)
    times.append(t)
    t, s = integrate(s, [toe], [k2], lambda s: s[0] - toe)
    times.append(t)
    return np.cumsum(times), s


@pytest.mark.parametrize("k2", [16.5e3, 17.5e3])
def test_step_agrees_with_dop853(k2):
    stride = simulate_stride(P, STRIDE_START["w"], START, controls(ALPHA, 16.5e3, k2))
    times, state = walk_by_scipy(START, ALPHA, 16.5e3, k2)
    assert stride.completed
    np.testing.assert_allclose([e.time for e in stride.events], times, rtol=0, atol=1e-9)
    np.testing.assert_allclose(stride.state, state, rtol=0, atol=1e-9)


@pytest.mark.parametrize("push", [13e3, 19e3])
def test_step_with_push_off_agrees_with_dop853(push):
    u = controls(ALPHA, 16.5e3, 17e3, k_push=push)
    stride = simulate_stride(P, STRIDE_START["wp"], START, u)
    times, state = walk_by_scipy(START, ALPHA, 16.5e3, 17e3, push)
    assert stride.completed
    np.testing.assert_allclose([e.time for e in stride.events], times, rtol=0, atol=1e-9)
    np.testing.assert_allclose(stride.state, state, rtol=0, atol=1e-9)


def energy(sample, toes, stiffness):
    value = 0.5 * P.mass * np.sum(sample[2:4] ** 2) + P.mass * P.gravity * sample[1]
    for toe, k in zip(toes, stiffness, strict=True):
        length = np.hypot(sample[0] - toe, sample[1])
        value += 0.5 * k * (P.rest_length - length) ** 2 if k > 0.0 else 0.0
    return value


@given(
    speed=st.floats(0.95, 1.2),
    height=st.floats(0.965, 0.985),
    vertical=st.floats(-0.05, 0.05),
)
@settings(max_examples=30, deadline=None)
def test_passive_step_conserves_energy(speed, height, vertical):
    stride = simulate_stride(
        P, STRIDE_START["w"], [0.0, height, speed, vertical], controls(ALPHA, 16.5e3, 16.5e3)
    )
    values = []
    for row in stride.meta:
        times = np.linspace(row[0], row[0] + row[1] * (1 - 1e-12), 5)
        values += [energy(state, row[3:5], row[5:7]) for state in stride.sample(times)]
    assert np.ptp(values) <= 1e-10 * values[0]


def test_events_lie_on_their_guards():
    stride = simulate_stride(P, STRIDE_START["w"], START, controls(ALPHA, 16.5e3, 17.0e3))
    states = {e.event: e.state for e in stride.events}
    toe = stride.toes[0]
    assert states[Event.TOUCHDOWN][1] == pytest.approx(np.sin(ALPHA), abs=1e-12)
    rear = states[Event.REAR_LIFTOFF]
    assert np.hypot(rear[0], rear[1]) == pytest.approx(1.0, abs=1e-12)
    assert states[Event.VLO][0] == pytest.approx(toe, abs=1e-12)
    bottom = states[Event.VIRTUAL_BOTTOM]
    assert (bottom[0] - toe / 2) * bottom[2] + bottom[1] * bottom[3] == pytest.approx(0, abs=1e-11)


def test_path_is_smooth_over_segments():
    stride = simulate_stride(P, STRIDE_START["w"], START, controls(ALPHA, 16.5e3, 16.5e3))
    joints = stride.meta[1:, 0]
    before, after = stride.sample(joints - 1e-9), stride.sample(joints + 1e-9)
    np.testing.assert_allclose(before[:, :4], after[:, :4], atol=1e-7)


def test_derivatives_of_the_path_are_consistent():
    stride = simulate_stride(P, STRIDE_START["w"], START, controls(ALPHA, 16.5e3, 16.5e3))
    t, h = np.array([0.05, 0.23, 0.3, 0.45]), 1e-5
    numeric = (stride.sample(t + h)[:, :4] - stride.sample(t - h)[:, :4]) / (2 * h)
    np.testing.assert_allclose(numeric, stride.sample(t)[:, 2:], atol=1e-5)


@pytest.mark.parametrize(
    ("state", "alpha", "k", "outcome"),
    [
        ([0.0, 0.97, -0.5, 0.0], ALPHA, 16.5e3, Outcome.BACKWARD),
        ([0.0, 0.97, 1.1, 0.0], np.radians(89.0), 16.5e3, Outcome.UNWANTED_FLIGHT),
        ([0.0, 0.90, 0.1, -1.0], np.radians(89.0), 100.0, Outcome.NO_TOUCHDOWN),
        ([0.0, 0.98, 3.0, 0.5], ALPHA, 16.5e3, Outcome.UNWANTED_FLIGHT),
    ],
)
def test_failures_are_values(state, alpha, k, outcome):
    stride = simulate_stride(P, STRIDE_START["w"], state, controls(alpha, k, k))
    assert stride.outcome is outcome
    assert not stride.completed
    assert np.all(np.isfinite(stride.state))


def test_guard_that_starts_at_zero_does_not_fire():
    # Touchdown happens with the front leg exactly at rest length.
    stride = simulate_stride(P, STRIDE_START["w"], START, controls(ALPHA, 16.5e3, 16.5e3))
    assert [e.event for e in stride.events] == [
        Event.TOUCHDOWN,
        Event.VIRTUAL_BOTTOM,
        Event.REAR_LIFTOFF,
        Event.VLO,
    ]


def test_running_stride_runs_on_the_same_kernel():
    u = controls(np.radians(68.0), 25e3, 25e3)
    stride = simulate_stride(P, STRIDE_START["r"], [0.0, 1.0, 3.0, 0.0], u)
    assert stride.completed
    assert [e.event for e in stride.events] == [
        Event.TOUCHDOWN,
        Event.BOTTOM,
        Event.REAR_LIFTOFF,
        Event.APEX,
    ]
    e0 = 0.5 * P.mass * 9.0 + P.mass * P.gravity
    e1 = 0.5 * P.mass * stride.state[2] ** 2 + P.mass * P.gravity * stride.state[1]
    assert e1 == pytest.approx(e0, rel=1e-11)


def test_gait_returns_to_itself_and_is_symmetric(gait):
    z, outcome = ReturnMap(P).step(gait.vlo, gait.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(z, gait.vlo, atol=1e-8)
    stride = simulate_stride(
        P, STRIDE_START["w"], [0.0, gait.vlo[1], gait.vlo[0], 0.0], gait.controls
    )
    t = np.linspace(0.0, stride.duration, 41)
    forth, back = stride.sample(t), stride.sample(stride.duration - t)
    np.testing.assert_allclose(forth[:, 0], stride.state[0] - back[:, 0], atol=1e-8)
    np.testing.assert_allclose(forth[:, 1], back[:, 1], atol=1e-8)


def test_papers_equilibrium_exists(paper_gait):
    assert paper_gait.energy == pytest.approx(826.0, abs=1e-9)
    assert paper_gait.vlo[0] == pytest.approx(1.1484, abs=1e-4)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_nan_never_enters(bad):
    with pytest.raises(ParameterError, match="finite"):
        simulate_stride(P, STRIDE_START["w"], [0.0, bad, 1.0, 0.0], controls(ALPHA, 16.5e3, 16.5e3))
    with pytest.raises(ParameterError, match="finite"):
        controls(ALPHA, bad, 16.5e3)
    with pytest.raises(ParameterError, match="mass"):
        SlipParameters(mass=bad)
