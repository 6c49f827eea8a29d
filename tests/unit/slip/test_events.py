"""Every event of every guard is found: guards that graze zero, and a foot already at the ground."""

import numpy as np
import pytest
import slip_reference
from scipy.optimize import brentq, minimize_scalar

from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, MapKind, Outcome, Phase, Reset, Slot
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.dynamics.stride import StrideSimulator, controls, simulate_stride
from template_control.slip.maps.return_map import RESULTS, ReturnMap, one_stride
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
L0 = P.rest_length
# DOP853 at 1e-12 is 1e-11 off after a stride. It does not decide whether a guard that comes closer
# to zero reaches it, nor, to 1e-8, when one fires that rises more slowly [SI].
UNDECIDED, SLOW = 1e-10, 1e-3


def test_a_leg_stretched_for_an_instant_lifts_off():
    """Two strides whose stance leg is over its rest length for a few milliseconds."""
    u = controls(np.radians(74.62637228566973), *[37218.609700845016] * 2)
    walked = ReturnMap(P, "w")([2.1971479352754484, 0.9853064143937674, 0.20886167909399356], u)
    assert walked.outcome == Outcome.UNWANTED_FLIGHT
    u = controls(np.radians(82.21424723302393), *[27819.70037986532] * 2)
    ran = ReturnMap(P, "r")([0.6598864657309247, 0.9908203484609734], u)
    assert ran.outcome == Outcome.SECTION
    np.testing.assert_allclose(ran.state, [0.52774, 0.99882], atol=5e-6)


# One stance phase, one guard, and a number that moves the guard's extremum: the start's vertical or
# forward speed, where the toe stands that is in the air, or the touchdown angle.
REAR, FRONT = (Slot.K_SC, None), (None, Slot.K_SC)
LONGEST = 0.8  # [s]


def phase(event, legs):
    """An automaton of one phase, which ``event`` may end, or none."""
    guarded = () if event is None else (Edge(event, Outcome.NO_LIFTOFF),)
    node = Node("SS", Phase.SS, *legs, (*guarded, Edge(Event.REST, "SS", section=True)))
    return Automaton(nodes=(node,), starts={"one": "SS"})


def value(event, s, toes, alpha):
    """A guard (n,) along states ``s`` (n, 6), by the table in ``Event``."""
    x, y, u, v = s.T[:4]
    return {
        Event.TOUCHDOWN: L0 * np.sin(alpha) - y,
        Event.REAR_LIFTOFF: np.hypot(x - toes[0], y) - L0,
        Event.FRONT_LIFTOFF: np.hypot(x - toes[1], y) - L0,
        Event.APEX: -v,
        Event.BOTTOM: (x - toes[0]) * u + y * v,
        Event.VIRTUAL_BOTTOM: (x - 0.5 * (toes[0] + toes[1])) * u + y * v,
        Event.VLO: x - toes[0],
        Event.PASSED_FRONT_FOOT: x - toes[1],
        Event.BACKWARD: -u,
    }[event]


def by_rise(x, y, u, number):
    return [x, y, u, number], (0.0, 0.0), 1.3


def by_speed(x, y, u, number):
    return [x, y, number, u], (0.0, 0.0), 1.3


def by_rear_toe(x, y, u, number):
    return [x, y, u, -0.2], (x + number, 0.0), 1.3


def by_front_toe(x, y, u, number):
    return [x, y, u, -0.2], (0.0, x + number), 1.3


def by_angle(x, y, u, number):
    return [x, y, u, -0.4], (0.0, 0.0), np.arcsin((y - number) / L0)


# By guard: the legs that stand, what the number is and its range, ranges of x and dx/dt. FALL is
# missing: a CoM at the height of its toes falls on.
GRAZING = {
    Event.TOUCHDOWN: (REAR, by_angle, (0.002, 0.1), (-0.1, 0.1), (0.5, 1.5)),
    Event.REAR_LIFTOFF: (REAR, by_rise, (0.0, 1.0), (-0.1, 0.0), (1.0, 2.0)),
    Event.FRONT_LIFTOFF: (FRONT, by_rise, (0.0, 1.0), (-0.1, 0.0), (1.0, 2.0)),
    Event.APEX: (REAR, by_rise, (0.0, 0.4), (-0.3, -0.2), (1.0, 2.0)),
    Event.BOTTOM: (FRONT, by_rear_toe, (-1.0, 2.0), (-0.1, 0.1), (0.5, 1.5)),
    Event.VIRTUAL_BOTTOM: (REAR, by_front_toe, (-1.0, 4.0), (-0.1, 0.1), (0.5, 1.5)),
    Event.VLO: (FRONT, by_rear_toe, (0.002, 0.3), (-0.3, -0.2), (0.3, 0.5)),
    Event.PASSED_FRONT_FOOT: (REAR, by_front_toe, (0.002, 0.3), (-0.3, -0.2), (0.3, 0.5)),
    Event.BACKWARD: (REAR, by_speed, (0.0, 0.6), (-0.3, -0.2), (0.4, 0.8)),
}


class Grazing:
    """A phase along which a guard comes up to zero, by a number that decides how far."""

    def __init__(self, event, random):
        legs, start, range_, xs, speeds = GRAZING[event]
        self.event, self.stiffness = event, random.uniform(15e3, 30e3)
        x, y, u = random.uniform(*xs), random.uniform(0.9, 0.97), random.uniform(*speeds)
        self.start = lambda number: start(x, y, u, number)
        self.free = StrideSimulator(P, phase(None, legs), max_time=LONGEST)
        self.watched = StrideSimulator(P, phase(event, legs), max_time=LONGEST)
        numbers = np.linspace(*range_, 20)
        over = np.array([self.top(n)[0] for n in numbers])
        crossed = np.flatnonzero(over[1:] * over[:-1] < 0.0)
        self.brackets = [(numbers[i], numbers[i + 1]) for i in crossed]

    def run(self, simulator, number):
        state, toes, alpha = self.start(number)
        u = controls(alpha, self.stiffness, self.stiffness)
        return simulator.run("SS", state, u, toes)

    def guard(self, number):
        """The guard as a function of a time or of times (n,) until the end of the phase."""
        stride, (_, toes, alpha) = self.run(self.free, number), self.start(number)
        return lambda t: np.squeeze(value(self.event, stride.sample(t), toes, alpha))

    def top(self, number):
        """Value and time of the guard's first maximum after it was below zero; NaN if none."""
        g = self.guard(number)
        t = np.linspace(0.0, LONGEST, 300)
        v = g(t)
        turns = np.flatnonzero((v[1:-1] > v[:-2]) & (v[1:-1] >= v[2:])) + 1
        if v[0] > -1e-3 or turns.size == 0:
            return np.nan, np.nan
        bounds = t[turns[0] - 1], t[turns[0] + 1]
        best = minimize_scalar(lambda x: -g(x), bounds=bounds, options={"xatol": 1e-9})
        return -best.fun, best.x

    def number(self, height):
        """The number that makes the first maximum ``height``; None if none does."""
        for ends in self.brackets:
            found = brentq(lambda n: self.top(n)[0] - height, *ends, xtol=1e-15, rtol=1e-15)
            if abs(self.top(found)[0] - height) < 0.01 * abs(height):
                return found
        return None


@pytest.mark.parametrize("event", GRAZING, ids=lambda event: event.name)
def test_a_guard_that_is_above_zero_for_an_instant_fires(event):
    """Micrometres or less above zero, and as much below it."""
    random, found = np.random.default_rng(int(event)), 0
    while found < 2:
        grazing = Grazing(event, random)
        for height in (1e-6, 1e-9, -1e-9):
            number = grazing.number(height)
            if number is None:
                break
            found += height < 0.0
            _, time = grazing.top(number)
            before = [e.time for e in grazing.run(grazing.watched, number).events]
            if height < 0.0:
                assert not before or before[0] > time + 1e-3
                continue
            risen = brentq(grazing.guard(number), max(time - 0.01, 0.0), time, xtol=1e-15)
            assert before[0] == pytest.approx(risen, abs=1e-9)


def starts_in_flight(kind):
    return AUTOMATON.start(kind).phase is Phase.F


@pytest.mark.parametrize("kind", [k for k in STRIDE_START if starts_in_flight(k)])
def test_touchdown_from_an_apex_at_the_touchdown_height(kind):
    """The foot is on the ground at once, or after the fall's time, to a nanosecond."""
    random = np.random.default_rng(15)
    heights = np.concatenate(([0.0], np.geomspace(1e-13, 1e-6, 15)))
    for alpha in random.uniform(0.9, 1.4, 5):
        u = controls(alpha, *[25e3] * 4)
        ground = L0 * np.sin(alpha)
        for y in ground + heights:
            stride = simulate_stride(P, STRIDE_START[kind], [0.0, y, 2.0, 0.0], u)
            fall = np.sqrt(2.0 * (y - ground) / P.gravity)
            assert stride.time_of(Event.TOUCHDOWN) == pytest.approx(fall, abs=1e-9)
        below = simulate_stride(P, STRIDE_START[kind], [0.0, ground - 1e-6, 2.0, 0.0], u)
        assert below.outcome is Outcome.NO_TOUCHDOWN


@pytest.mark.parametrize("map_kind", MapKind)
def test_every_map_goes_on_smoothly_to_an_apex_at_the_touchdown_height(map_kind):
    """A run falls for a time of the square root of the height: no map jumps there."""
    step, u = ReturnMap(P, "r", map_kind), controls(1.2, 25e3, 25e3)
    heights = np.array([0.0, 1e-12, 1e-10, 1e-8, 1e-6])
    ends = step(np.column_stack((np.full(5, 3.0), L0 * np.sin(1.2) + heights)), u)
    assert np.all(ends.outcome == Outcome.SECTION)
    late = np.sqrt(2.0 * heights[1:] / P.gravity)
    slopes = (ends.advance[1:] - ends.advance[0]) / late
    np.testing.assert_allclose(slopes, slopes[-1], rtol=5e-3)


@pytest.mark.parametrize(("rise", "first"), [(0.02, 0.02 * 2.0 / P.gravity), (-0.02, 0.0)])
def test_a_flight_at_the_touchdown_height_lands_on_its_way_down(rise, first):
    """Upward there is a hop of a few milliseconds yet; downward the foot is on the ground."""
    u = controls(1.2, 25e3, 25e3)
    stride = simulate_stride(P, STRIDE_START["r"], [0.0, L0 * np.sin(1.2), 3.0, rise], u)
    assert stride.time_of(Event.TOUCHDOWN) == pytest.approx(first, abs=1e-9)


@pytest.mark.parametrize("map_kind", MapKind)
def test_a_hop_of_milliseconds_is_a_flight_in_every_map(map_kind):
    """It ends where the stride from its apex does."""
    kernel, kind, u = stride_kernel(P, "r"), int(map_kind), controls(1.2, 25e3, 25e3)
    rise, ground = 0.02, L0 * np.sin(1.2)
    ends = np.empty((2, RESULTS))
    for end, y, v in zip(
        ends, (ground, ground + rise**2 / (2.0 * P.gravity)), (rise, 0.0), strict=True
    ):
        z = np.array([3.0, y, v])
        assert one_stride(kernel, kind, z, u, new_scratch(), end) == Outcome.SECTION
    np.testing.assert_allclose(ends[0, :3], ends[1, :3], atol=1e-8)


def test_the_touchdown_that_began_a_phase_does_not_end_it():
    """A stance whose other foot may land, as in a grounded run, begins at the touchdown height."""
    fall = Edge(Event.FALL, Outcome.FALL)
    lands = Edge(Event.TOUCHDOWN, "SS", Reset.PLACE_REAR)
    again = Edge(Event.TOUCHDOWN, "F", Reset.NONE, section=True)
    nodes = (
        Node("F", Phase.F, None, None, (lands, fall)),
        Node("SS", Phase.SS, Slot.K_SC, None, (again, fall)),
    )
    grounded = Automaton(nodes=nodes, starts={"g": "F"})
    stride = StrideSimulator(P, grounded).run("F", [0.0, 0.98, 1.5, 0.0], controls(1.2, 3e4, 3e4))
    assert [e.event for e in stride.events] == [Event.TOUCHDOWN, Event.TOUCHDOWN]
    assert stride.events[1].time > stride.events[0].time + 0.05


def drawn(kind, random):
    """State (4,) and controls of a stride; half of the draws have nearly equal stiffnesses."""
    if starts_in_flight(kind):
        y, speed, rise = random.uniform(0.9, 1.1), random.uniform(0.4, 6.0), 0.0
    else:
        y, speed = random.uniform(0.94, 1.0), random.uniform(0.4, 2.5)
        rise = random.uniform(-0.4, 0.3)
    alpha = np.arcsin(min(y, 0.9999 * L0) / L0) - random.uniform(0.0005, 0.35)
    stiffness = random.uniform(8e3, 60e3, 5)
    if random.random() < 0.5:
        stiffness[1:] = stiffness[0] * random.uniform(0.9, 1.1, 4)
    return np.array([0.0, y, speed, rise]), controls(alpha, *stiffness)


@pytest.mark.slow(seconds=8)
@pytest.mark.parametrize("draws", [300])
def test_random_strides_end_as_they_do_by_dop853(draws):
    """Every kind of stride: outcome, number of events and the state where it ends or fails."""
    simulator, undecided = StrideSimulator(P), 0
    for kind, start in STRIDE_START.items():
        random = np.random.default_rng([2, list(STRIDE_START).index(kind)])
        for i in range(draws):
            state, u = drawn(kind, random)
            found = simulator.run(start, state, u)
            true = slip_reference.stride(P, AUTOMATON, start, state, u)
            if true.margin < UNDECIDED or true.slowest < SLOW:
                undecided += 1
                continue
            where = f"{kind} {i}"
            assert (found.outcome, len(found.events)) == (true.outcome, true.events), where
            np.testing.assert_allclose(found.state, true.state, rtol=0, atol=1e-8, err_msg=where)
    assert undecided <= 1e-3 * draws * len(STRIDE_START)
