"""Guards: values and rates agree; each fires where it should, and none where it should not."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from template_control.embedding.modes import GuardOptions, first_fired, modes, set_guards
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.tick import TICK
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event, Outcome
from template_control.slip.dynamics.guards import (
    SERIES,
    Path,
    all_bends,
    all_guards,
    guard,
    guard_rate,
    sample,
)
from template_control.slip.dynamics.model import ORDER, TOLERANCE, expand, steepest
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
L0 = P.rest_length
# x, y, dx/dt, dy/dt, d2x/dt2, d2y/dt2 of the CoM, and the toes.
positions = st.tuples(st.floats(-1.0, 2.0), st.floats(0.3, 1.5))
velocities = st.tuples(st.floats(-3.0, 8.0), st.floats(-4.0, 4.0))
accelerations = st.tuples(st.floats(-60.0, 60.0), st.floats(-9.81, 80.0))
feet = st.tuples(st.floats(-1.0, 1.0), st.floats(0.0, 1.5)).map(lambda c: np.array([c[0], sum(c)]))
angles = st.floats(0.3, 1.5)


def moved(path, time):
    """State (4,) after ``time`` at constant acceleration."""
    position, velocity, acceleration = path.reshape(3, 2)
    return np.concatenate(
        (
            position + time * velocity + 0.5 * time**2 * acceleration,
            velocity + time * acceleration,
        )
    )


def guards_of(state, toes, alpha):
    """Values (NUM_EVENTS,) of all guards at once."""
    values = np.full(NUM_EVENTS, np.nan)
    all_guards(state, toes, L0, L0 * np.sin(alpha), values)
    return values


@given(positions, velocities, accelerations, feet, angles)
@settings(max_examples=60, deadline=None)
def test_guards_and_their_rates_agree(position, velocity, acceleration, toes, alpha):
    """One guard, all at once, and the rate against a central difference along a path."""
    path = np.concatenate((position, velocity, acceleration))
    together = guards_of(path[:4], toes, alpha)
    h = 1e-5
    ahead, behind = (guards_of(moved(path, t), toes, alpha) for t in (h, -h))
    for event in Event:
        value = guard(int(event), path, toes, L0, L0 * np.sin(alpha))
        assert value == pytest.approx(together[event], abs=1e-13), event.name
        rate = guard_rate(int(event), path, toes)
        difference = (ahead[event] - behind[event]) / (2.0 * h)
        assert rate == pytest.approx(difference, rel=1e-6, abs=1e-6), event.name


@given(positions, velocities, feet, angles, st.tuples(st.floats(0.0, 1e3), st.floats(0.0, 1e3)))
@settings(max_examples=60, deadline=None)
def test_bends_bound_the_second_derivatives_of_guards(position, velocity, toes, alpha, stiffness):
    """Along series of random phases, against second differences of the guards."""
    state = np.array([*position, *velocity])
    assume(np.hypot(state[0] - toes, state[1]).min() > 0.6)
    x, y, bends = np.zeros(ORDER + 1), np.zeros(ORDER + 1), np.zeros(NUM_EVENTS)
    forces, work = P.mass * np.array(stiffness), np.zeros((2, 4, ORDER + 1))
    physics = P.mass, P.gravity, 0.0, L0, TOLERANCE
    step = min(expand(state, toes, forces, physics, x, y, work), 0.03)
    all_bends(state, toes, L0, steepest(x, y, step), step, bends)
    times, out = np.linspace(0.0, step, 31), np.zeros(6)
    guards = []
    for t in times:
        sample(SERIES, Path(x, y), t, out)
        guards.append(guards_of(out[:4], toes, alpha))
    curved = np.diff(guards, n=2, axis=0) / (times[1] - times[0]) ** 2
    largest = np.abs(curved).max(axis=0)
    largest[Event.REST] = 0.0  # it never rises above zero
    # A length is shorter than half l0 nowhere, and differences of numbers of order 10 are rounded.
    rounded = 1e-14 / (times[1] - times[0]) ** 2
    assert np.all(largest <= bends + rounded)


def test_guards_are_those_of_the_vocabulary():
    """The table in ``Event``, in numbers: 3-4-5 triangles from either toe."""
    state, toes = np.array([0.3, 0.4, 2.0, -1.0]), np.array([0.0, 0.6])
    expected = {
        Event.TOUCHDOWN: L0 * np.sin(0.5) - 0.4,
        Event.REAR_LIFTOFF: 0.5 - L0,
        Event.FRONT_LIFTOFF: 0.5 - L0,
        Event.APEX: 1.0,
        Event.BOTTOM: 0.3 * 2.0 - 0.4,
        Event.VIRTUAL_BOTTOM: -0.4,
        Event.VLO: 0.3,
        Event.PASSED_FRONT_FOOT: -0.3,
        Event.FALL: -0.4,
        Event.BACKWARD: -2.0,
        Event.REST: -5.0,
    }
    assert list(expected) == list(Event)
    np.testing.assert_allclose(guards_of(state, toes, 0.5), list(expected.values()), atol=1e-15)


# Strides from VLO that end as no other test's do: angle, k_sc, k_sd, and the stiffnesses of the
# front leg in a walk-to-run stride.
SOFT_AND_STEEP = controls(1.494, 15.2e3, 36.0e3, 59.1e3, 17.4e3)
STIFF_AND_STEEP = controls(1.409, 79.6e3, 28.7e3, 18.7e3, 71.0e3)
THROWN_BACK = controls(1.240, 10.5e3, 40.7e3, 37.1e3, 36.8e3)
ENDS = [
    ("w", (0.999, 0.572, -0.132), SOFT_AND_STEEP, Event.PASSED_FRONT_FOOT, "DS_sc^w"),
    ("w", (0.987, 1.424, -0.225), STIFF_AND_STEEP, Event.PASSED_FRONT_FOOT, "DS_sd^w"),
    ("wr", (0.999, 0.572, -0.132), SOFT_AND_STEEP, Event.PASSED_FRONT_FOOT, "DS_sc^wr"),
    ("wr*", (0.999, 0.572, -0.132), SOFT_AND_STEEP, Event.PASSED_FRONT_FOOT, "DS_sc^wr*"),
    ("w", (0.956, 0.506, -0.187), THROWN_BACK, Event.FRONT_LIFTOFF, "DS_sd^w"),
]
REASON = {
    Event.PASSED_FRONT_FOOT: Outcome.NO_LIFTOFF,
    Event.FRONT_LIFTOFF: Outcome.UNWANTED_FLIGHT,
}


@pytest.mark.parametrize(("kind", "vlo", "u", "event", "node"), ENDS)
def test_a_double_stance_may_end_over_or_off_the_front_foot(kind, vlo, u, event, node):
    y, speed, vertical = vlo
    stride = simulate_stride(P, STRIDE_START[kind], [0.0, y, speed, vertical], u)
    last = stride.events[-1]
    assert stride.outcome is REASON[event]
    assert (last.event, last.source, last.target) == (event, node, "")
    rear, front = np.hypot(last.state[0] - stride.toes, last.state[1])
    if event is Event.PASSED_FRONT_FOOT:
        assert last.state[0] == pytest.approx(stride.toes[1], abs=1e-12)
        assert front < rear < L0
    else:
        assert front == pytest.approx(L0, abs=1e-12)
        assert rear < L0


def test_the_front_leg_alone_may_be_passed():
    """What ends a double stance is no guard of the simplified walk-to-run stride."""
    u = controls(1.391, 36.7e3, 7.1e3, 14.3e3, 55.3e3)
    stride = simulate_stride(P, STRIDE_START["wr*"], [0.0, 0.994, 1.491, -0.150], u)
    assert stride.completed
    touchdown, _, liftoff = stride.events[:3]
    assert (liftoff.event, liftoff.source) == (Event.REAR_LIFTOFF, "SS_br^wr*")
    front = touchdown.state[0] + L0 * np.cos(1.391)
    assert liftoff.state[0] > front + 0.1


def crossings(stride, alpha):
    """Guards that rise through zero before the end of their phase."""
    ends = [e.time for e in stride.events]
    begins = [0.0, *ends[:-1]]
    for begin, end, fired in zip(begins, ends, stride.events, strict=True):
        edges = [int(e.event) for e in AUTOMATON.node(fired.source).edges]
        times = np.linspace(begin, end, 100)[1:-1]
        rows = np.searchsorted(stride.meta[:, 0], times, side="right") - 1
        found = np.array(
            [
                guards_of(state[:4], toes, alpha)
                for state, toes in zip(stride.sample(times), stride.meta[rows, 3:5], strict=True)
            ]
        )[:, edges]
        # A guard counts from where it has been below zero.
        above = (found > 1e-7) & np.logical_or.accumulate(found < -1e-7)
        for event, over in zip(edges, above.T, strict=True):
            if over.any():
                yield fired.source, Event(event).name


@given(
    kind=st.sampled_from(sorted(STRIDE_START)),
    vlo=st.tuples(st.floats(0.94, 1.0), st.floats(0.4, 2.5), st.floats(-0.4, 0.2)),
    apex=st.tuples(st.floats(0.93, 1.1), st.floats(1.0, 6.0)),
    drop=st.floats(0.002, 0.3),
    stiffness=st.tuples(*[st.floats(8e3, 60e3)] * 4),
)
@settings(max_examples=60, deadline=None)
def test_the_guard_that_fires_is_the_first_of_its_node(kind, vlo, apex, drop, stiffness):
    """Between events no guard of the node at hand rises through zero unseen."""
    y, speed, vertical = (*apex, 0.0) if kind in ("r", "rw") else vlo
    alpha = np.arcsin(min(y, 0.999 * L0) / L0) - drop  # the foot is over the ground at first
    u = controls(alpha, *stiffness)
    stride = simulate_stride(P, STRIDE_START[kind], [0.0, y, speed, vertical], u)
    assume(stride.events)
    assert not list(crossings(stride, alpha))
    values = guards_of(stride.events[-1].state, stride.meta[-1, 3:5], alpha)
    assert values[stride.events[-1].event] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("node", "x", "vertical", "fires"),
    [
        ("SS_sc^rw", -0.05, -0.01, False),
        ("SS_sc^rw", -0.05, 0.2, True),
        ("SS_sc^rw", 0.01, -0.05, True),  # over the foot: the bottom was grazed
        ("SS_sc^r", 0.01, -0.05, False),
        ("SS_sd^rw", -0.05, 0.2, False),
    ],
)
def test_a_robot_that_is_over_its_foot_has_passed_the_bottom(node, x, vertical, fires):
    """In a run-to-walk stride, whose stance ends there; that of a run may have it later."""
    tick = np.zeros(1, TICK)
    tick["mode"] = modes(AUTOMATON, 7, EmbeddingOptions().phase_table())[node].data
    set_guards(tick["guards"], P, GuardOptions())
    tick["path"]["event_times"] = np.inf
    tick["sensed"]["state"] = x, 0.95, 0.7, vertical
    assert (first_fired(tick) >= 0) == fires
