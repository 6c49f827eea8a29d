"""The linear sideways motion against the nonlinear spring-mass walker in space."""

import numpy as np
import pytest
from heading import Heading
from space_slip import acceleration as space_acceleration
from space_slip import energy, step

from template_control.embedding import LqrPlanner
from template_control.embedding.planners.planner import Context
from template_control.slip import (
    LateralLearningOptions,
    LateralLearnt,
    LateralOptions,
    LateralWish,
    Side,
    SlipParameters,
    Slot,
    gait_at,
    lateral_aim,
    lateral_cycle,
    lateral_gait,
    lateral_path,
    place,
    simulate_stride,
)
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.lateral.path import acceleration, transition
from template_control.slip.maps.section import VLO

P = SlipParameters()
WALK = gait_at(P, np.radians(68.0), 1.05)
LATERAL = lateral_gait(WALK)
OPTIONS = LateralOptions()
# In a turn in space the steps of the inner leg are not those of the outer one.
LEARNING = LateralLearningOptions(one_sided=1.0)
TOE = np.zeros(2)


def planar(z, u):
    stride = simulate_stride(P, STRIDE_START["w"], VLO.state(z), u)
    return stride, lateral_path((stride,), P.gravity)


def at_vlo(z, y=0.0, dy=0.0):
    """State (6,) in space at a VLO state z, beside the toe TOE."""
    return np.array([0.0, y, z[1], z[0], dy, z[2]])


def errors(size):
    """Of y and dy/dt, and of dx/dt, z, dz/dt, after a step that is ``size`` wide."""
    start, foothold = at_vlo(WALK.vlo, -0.4 * size, 0.3 * size), -size
    truth = step(P, start, TOE, WALK.controls, lambda _t, _s: foothold)
    stride, path = planar(WALK.vlo, WALK.controls)
    linear = transition(path, 0.0, path.section) @ [*start[[1, 4]], 0.0, 0.0, foothold]
    sagittal = truth.end[[3, 2, 5]] - VLO.of(stride.state)
    return np.abs(truth.end[[1, 4]] - linear), np.abs(sagittal)


def test_errors_are_of_the_order_that_the_theory_says():
    coarse, fine = errors(0.02), errors(0.01)
    np.testing.assert_allclose(np.log2(coarse[0] / fine[0]), 3.0, atol=0.1)
    np.testing.assert_allclose(np.log2(coarse[1] / fine[1]), 2.0, atol=0.1)
    assert errors(0.001)[0].max() < 2e-8


def test_a_step_in_space_keeps_its_energy():
    start = at_vlo(WALK.vlo, -0.04, 0.05)
    k = WALK.controls[Slot.K_SC]
    truth = step(P, start, TOE, WALK.controls, lambda _t, _s: -0.15)
    before, after = (energy(P, s, [toe], [k]) for s, toe in ((start, TOE), (truth.end, truth.toe)))
    assert np.isclose(before, after, rtol=1e-10)


def test_without_width_the_walker_in_space_is_the_planar_one():
    truth = step(P, at_vlo(WALK.vlo), TOE, WALK.controls, lambda _t, _s: 0.0)
    np.testing.assert_allclose(truth.end[[3, 2, 5]], WALK.vlo, atol=1e-9)
    assert np.isclose(truth.duration, WALK.step_duration, atol=1e-9)


def test_eigenvalues_are_those_of_the_walker_in_space():
    """Central differences of a step with the law, about a walk that is hardly wide."""
    width, small = 0.01, 1e-4
    options = LateralOptions(widths=(1e-3, 0.6))
    cycle = lateral_cycle(LATERAL, LateralWish(width))
    aim = lateral_aim(LATERAL, cycle, Side.LEFT, LateralLearnt(), options)
    _, path = planar(WALK.vlo, WALK.controls)

    def foothold(_time, state):
        return place(path, aim, 0.0, state[[1, 4]], np.zeros(2)).y

    def after(error):
        start = at_vlo(WALK.vlo, *(cycle.states[0] + error))
        truth = step(P, start, TOE, WALK.controls, foothold)
        return truth.end[[1, 4]] - (truth.toe[1], 0.0)

    # Mirrored, as the next step is one from the right.
    columns = [-(after(e) - after(-e)) / (2.0 * small) for e in small * np.eye(2)]
    found = np.sort(np.linalg.eigvals(np.column_stack(columns)))
    np.testing.assert_allclose(found, np.sort(LATERAL.closed_loop.real), atol=0.003)


class Walker:
    """Walks in space with the planar planner's controls and the footholds aside.

    Attributes:
        state, toe: in the world, at VLO.
        widths: of the steps.
        sections: (n, 2) y from the stance foot and dy/dt, mirrored to those of the left.
    """

    def __init__(self, wish, error=(0.0, 0.0)):
        self.wish, self.planner, self.learnt = wish, LqrPlanner(WALK), LateralLearnt()
        self.heading, self.side = Heading(), Side.LEFT
        start = lateral_cycle(LATERAL, wish).states[0] + error
        self.state, self.toe = at_vlo(WALK.vlo, *start), np.zeros(2)
        self.widths, self.sections, self.speeds = [], [], []

    def local(self):
        """State in the heading frame, from the stance foot."""
        place = self.heading.position(self.state[:3]) - [*self.heading.position(self.toe), 0.0]
        return np.concatenate((place, self.heading.vector(self.state[3:])))

    def walk(self, steps, learns=True):
        for _ in range(steps):
            self.step(learns)
        return self

    def step(self, learns):
        self.heading = self.heading.turned(self.wish.turn, self.toe)
        start, side = self.local(), self.side
        z = start[[3, 2, 5]]
        decision = self.planner.decide(Context(z))
        _, path = planar(z, decision.controls)
        cycle = lateral_cycle(LATERAL, self.wish, self.learnt.offset)
        aim = lateral_aim(LATERAL, cycle, side, self.learnt, OPTIONS)
        placed = []

        def foothold(time, state):
            seen = min(time, path.touchdown)
            placed.append(place(path, aim, seen, state[[1, 4]], np.zeros(2)))
            return placed[-1].y

        looks = tuple(share * path.touchdown for share in (0.4, 0.8))
        truth = step(P, start, TOE, decision.controls, foothold, looks)
        found = truth.end[[1, 4]] - (truth.toe[1], 0.0)
        if learns:
            surprise = found - placed[-1].state(truth.toe[1])
            self.learnt = self.learnt.after_step(side, surprise, LEARNING)
        self.planner.observe(decision, truth.end[[3, 2, 5]])
        self.widths.append(-side * truth.toe[1])
        self.sections.append(side.other * found)
        self.speeds.append(truth.end[0] / truth.duration)
        origin = self.heading.position(np.array([*self.toe, 0.0]))
        self.state = np.concatenate(
            (
                self.heading.world_position(origin + truth.end[:3]),
                self.heading.world_vector(truth.end[3:]),
            )
        )
        self.toe = self.heading.world_position(origin[:2] + truth.toe)
        self.side = side.other


@pytest.mark.parametrize("error", [(0.01, 0.05), (-0.02, -0.1)])
def test_a_disturbed_walk_returns_to_its_width(error):
    walker = Walker(LateralWish(0.1), error).walk(9, learns=False)
    assert abs(walker.widths[0] - 0.1) > 0.015
    np.testing.assert_allclose(walker.widths[-3:], 0.1, atol=0.0015)
    np.testing.assert_allclose(walker.sections[-1], [-0.0397, 0.0], atol=0.001)
    assert min(walker.widths) >= OPTIONS.widths[0] - 1e-12


@pytest.mark.slow(seconds=4)
def test_what_the_linear_motion_leaves_out_is_learnt():
    walker = Walker(LateralWish(0.15)).walk(30)
    assert abs(walker.widths[1] - 0.15) > 0.0015
    np.testing.assert_allclose(walker.widths[-4:], 0.15, atol=0.0004)


@pytest.mark.slow(seconds=4)
def test_a_walk_turns_and_keeps_its_width():
    wish = LateralWish(0.1, turn=0.04)
    walker = Walker(wish).walk(25)
    cycle = lateral_cycle(LATERAL, wish)
    expected = [side * cycle.states[side.row] for side in (walker.side.other, walker.side)]
    np.testing.assert_allclose(walker.sections[-2:], expected, atol=0.003)
    np.testing.assert_allclose(np.mean(walker.widths[-2:]), 0.1, atol=0.0015)
    assert np.isclose(walker.heading.angle, 25 * 0.04)
    # The way that it goes turns with its heading: at a section it is half a turn ahead.
    way = np.arctan2(walker.state[4], walker.state[3])
    assert abs(walker.heading.yaw(way) - 0.02) < 0.004


def test_acceleration_is_the_walkers_to_the_first_order():
    stride, path = planar(WALK.vlo, WALK.controls)
    k, feet = WALK.controls[Slot.K_SC], 1e-4 * np.array([0.3, 9.0, -1.0])
    y = -0.4e-4
    for time in np.linspace(0.0, 0.999 * stride.duration, 20):
        row = np.searchsorted(stride.meta[:, 0], time, side="right") - 1
        x, z, *_ = stride.sample(time)[0]
        bearing = [i for i in range(2) if stride.meta[row, 5 + i] > 0.0]
        toes = [(stride.meta[row, 3 + i], feet[path.footholds[row, i]]) for i in bearing]
        truth = space_acceleration(P, np.array([x, y, z, 0.0, 0.0, 0.0]), toes, [k] * len(toes))
        assert np.isclose(acceleration(path, time, y, feet), truth[1], rtol=1e-6, atol=1e-12)
