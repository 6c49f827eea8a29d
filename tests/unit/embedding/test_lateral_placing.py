"""The foothold's y: the law it keeps, its bounds, mirror symmetry, and what is learnt."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are
from scipy.optimize import minimize_scalar

from template_control.embedding.free.lateral import LATERAL as MEMORY
from template_control.embedding.free.lateral import LateralPlanner, lateral_foothold
from template_control.slip import (
    LateralLearnt,
    LateralOptions,
    LateralWish,
    Side,
    SlipParameters,
    gait_at,
    lateral_aim,
    lateral_cycle,
    lateral_gait,
    lateral_path,
    place,
    running_gait,
    simulate_stride,
)
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.lateral.path import motion_ahead, transition
from template_control.slip.lateral.placing import LATERAL as KERNELS
from template_control.slip.lateral.placing import before_turn, contact, pivot
from template_control.slip.maps.section import APEX, VLO
from template_control.warm_up import ready

P = SlipParameters()
WALK = gait_at(P, np.radians(68.0), 1.05)
RUN = running_gait(P, 3.0)
OPTIONS = LateralOptions()
LATERAL = lateral_gait(WALK)
STRIDE = simulate_stride(P, STRIDE_START["w"], VLO.state(WALK.vlo), WALK.controls)
PATH = lateral_path((STRIDE, STRIDE), P.gravity)
ANY = st.floats(-0.5, 0.5)


def aim(side, learnt=None, **wish):
    learnt = learnt or LateralLearnt()
    cycle = lateral_cycle(LATERAL, LateralWish(**{"width": 0.2, **wish}), learnt.offset)
    return lateral_aim(LATERAL, cycle, side, learnt, OPTIONS), cycle


@pytest.mark.parametrize("gait", [WALK, RUN], ids=["walk", "run"])
def test_the_periodic_motion_is_its_own_mirror_image(gait):
    lateral = lateral_gait(gait)
    cycle = lateral_cycle(lateral, LateralWish(0.2))
    left, right = cycle.states
    np.testing.assert_allclose(left, -right, atol=1e-14)
    np.testing.assert_allclose(lateral.a @ left + lateral.b * cycle.steps[0], right, atol=1e-12)
    np.testing.assert_allclose(cycle.steps, [-0.2, 0.2])
    assert left[0] < 0.0  # the CoM is between the feet


@pytest.mark.parametrize(("gait", "share"), [(WALK, 1.0), (RUN, 0.5)], ids=["walk", "run"])
def test_a_run_may_be_narrower_than_a_walk(gait, share):
    narrow = lateral_gait(gait, LateralOptions(running_width=0.5))
    cycle, wide = (lateral_cycle(g, LateralWish(0.2)) for g in (narrow, lateral_gait(gait)))
    np.testing.assert_allclose(cycle.steps, share * wide.steps)
    np.testing.assert_allclose(cycle.states, share * wide.states)
    # To the left it goes as far as a wide one.
    cycle = lateral_cycle(narrow, LateralWish(0.2, left=0.03))
    assert np.isclose(cycle.steps.sum(), 2 * 0.03)


def test_a_gait_symmetric_in_time_sways_symmetrically():
    cycle = lateral_cycle(LATERAL, LateralWish(0.2))
    np.testing.assert_allclose(cycle.states[:, 1], 0.0, atol=1e-6)


def test_a_walk_aside_is_periodic_too():
    cycle = lateral_cycle(LATERAL, LateralWish(0.2, left=0.03))
    for side in Side:
        ahead = LATERAL.a @ cycle.states[side.row] + LATERAL.b * cycle.steps[side.row]
        np.testing.assert_allclose(ahead, cycle.states[side.other.row], atol=1e-12)
    assert np.isclose(cycle.steps.sum(), 2 * 0.03)


def test_a_turning_walk_is_periodic_in_its_heading():
    wish = LateralWish(0.2, turn=0.1)
    cycle, jump = lateral_cycle(LATERAL, wish), -WALK.vlo[0] * wish.turn
    for side in Side:
        turned = cycle.states[side.row] + (0.0, jump)
        ahead = LATERAL.a @ turned + LATERAL.b * cycle.steps[side.row]
        np.testing.assert_allclose(ahead, cycle.states[side.other.row], atol=1e-12)
    middle = cycle.states.mean(axis=0)
    np.testing.assert_allclose(middle[1], -jump / 2)
    assert middle[0] > 0.0  # it leans into the curve


def test_an_aim_before_a_turn_is_the_one_after_it():
    lateral, turn = lateral_gait(RUN), 1e-4
    aim = lateral_aim(
        lateral,
        lateral_cycle(lateral, LateralWish(0.2, turn=turn)),
        Side.LEFT,
        LateralLearnt(),
        OPTIONS,
    )
    before = before_turn(aim, lateral, turn)
    c, s = np.cos(turn), np.sin(turn)
    back = np.array([[c, -s], [s, c]])  # from the axes after the turn to those before it
    np.testing.assert_allclose(before.step, (back @ (RUN.step_length, aim.step))[1], atol=1e-8)
    np.testing.assert_allclose(before.state[1], (back @ (RUN.state[0], aim.state[1]))[1], atol=1e-8)
    # The CoM is so far ahead of the foot that it pushed off from at the apex after it.
    stride = simulate_stride(P, STRIDE_START["r"], APEX.state(RUN.state), RUN.controls)
    ahead = stride.state[0] - stride.toes[1]
    assert 0.0 < ahead < RUN.step_length
    np.testing.assert_allclose(before.state[0], (back @ (ahead, aim.state[0]))[1], atol=1e-8)


def test_cost_to_go_solves_the_riccati_equation():
    cost = solve_discrete_are(
        LATERAL.a, LATERAL.b[:, None], np.diag(OPTIONS.state_cost), [[OPTIONS.step_cost]]
    )
    np.testing.assert_allclose(LATERAL.cost, cost, rtol=1e-9)


@pytest.mark.parametrize("gait", [WALK, RUN], ids=["walk", "run"])
def test_the_law_returns_to_the_periodic_motion(gait):
    lateral = lateral_gait(gait)
    assert np.abs(lateral.open_loop).max() > 2.0
    assert np.abs(lateral.closed_loop).max() < 0.5
    # Forward and backward in time the motion is the same: the eigenvalues come in pairs 1/e, e.
    assert np.isclose(np.prod(lateral.open_loop).real, 1.0, atol=1e-5)


@settings(deadline=None, max_examples=50)
@given(ANY, ANY)
def test_all_moved_aside_is_moved_aside(y, start):
    matrix = transition(PATH, (start + 0.5) * PATH.touchdown, PATH.section)
    np.testing.assert_allclose(matrix[:, 0] + matrix[:, 2:].sum(axis=1), [1.0, 0.0], atol=1e-12)
    there = matrix @ [y, 0.0, y, y, y]
    np.testing.assert_allclose(there, [y, 0.0], atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(st.floats(0.0, 1.0), st.floats(0.9, 1.2))
def test_what_is_ahead_is_the_same_from_a_node_on(share, stretch):
    path = lateral_path((STRIDE, STRIDE), P.gravity, stretch=stretch)
    time = share * path.section
    ahead = motion_ahead(path, time)
    np.testing.assert_allclose(ahead[1:], transition(path, time, path.section), atol=1e-5)
    landing = transition(path, time, max(time, path.touchdown))[0]
    np.testing.assert_allclose(ahead[0], landing, atol=1e-5)


@settings(deadline=None, max_examples=50)
@given(st.sampled_from(list(Side)), st.floats(-0.05, 0.05), st.floats(-0.2, 0.2), ANY)
def test_at_a_section_it_is_the_linear_law(side, dy, dv, stance):
    to, cycle = aim(side)
    error = np.array([dy, dv])
    com = cycle.states[side.row] + error + (stance, 0.0)
    got = place(PATH, to, 0.0, com, np.array([stance, 9.0]))
    law = stance + cycle.steps[side.row] - LATERAL.gain @ error
    assert np.isclose(got.wanted, law, atol=1e-6)
    assert np.isclose(got.left, PATH.touchdown)


@settings(deadline=None, max_examples=50)
@given(ANY, ANY, st.floats(0.0, 0.9))
def test_no_other_foothold_costs_less(y, v, share):
    to, _ = aim(Side.LEFT)
    got = place(PATH, to, share * PATH.touchdown, np.array([y, v]), np.array([0.1, 0.0]))

    def cost(foothold):
        error = got.state(foothold) - to.state
        return error @ to.cost @ error + to.step_cost * (foothold - 0.1 - to.step) ** 2

    best = minimize_scalar(cost)
    assert np.isclose(got.wanted, best.x, atol=1e-5)


@settings(deadline=None, max_examples=50)
@given(st.sampled_from(list(Side)), ANY, st.floats(-2.0, 2.0), ANY, st.floats(0.0, 1.0))
def test_feet_never_cross_and_legs_do_not_split(side, y, v, stance, share):
    to, _ = aim(side)
    feet = np.array([stance, 0.0])
    got = place(PATH, to, share * PATH.touchdown, np.array([y, v]), feet)
    width = side * (stance - got.y)
    least, greatest = OPTIONS.widths
    assert least - 1e-12 <= width <= greatest + 1e-12
    bound = abs(got.y - got.com) <= OPTIONS.reach + 1e-12
    assert bound or np.isclose(width, least) or np.isclose(width, greatest)


@settings(deadline=None, max_examples=50)
@given(ANY, ANY, ANY, st.floats(0.0, 1.0))
def test_left_and_right_are_mirror_images(y, v, stance, share):
    left, right = (
        place(
            PATH,
            aim(side)[0],
            share * PATH.touchdown,
            side * np.array([y, v]),
            side * np.array([stance, 0.3]),
        )
        for side in Side
    )
    np.testing.assert_allclose(left.y, -right.y, atol=1e-12)
    np.testing.assert_allclose(left.expected, -right.expected, atol=1e-10)


def test_the_foot_in_the_air_does_not_count():
    to, cycle = aim(Side.RIGHT)
    one, other = (
        place(PATH, to, 0.1, cycle.states[1], np.array([0.0, swing])) for swing in (0.0, 5.0)
    )
    assert one.y == other.y


def test_in_double_stance_the_next_foot_is_the_one_that_will_lift_off():
    start, end = (STRIDE.events[i].state for i in (0, 2))
    toes = (STRIDE.meta[-1, 3] - WALK.step_length, STRIDE.meta[-1, 3])
    rest = simulate_stride(P, "DS_sc^w", start, WALK.controls, toes)
    following = simulate_stride(P, STRIDE_START["w"], rest.state, WALK.controls, rest.toes)
    path = lateral_path((rest, following), P.gravity)
    assert end[0] > start[0]
    assert path.stance == 1
    assert path.footholds[0].tolist() == [0, 1]
    np.testing.assert_allclose(path.touchdown, rest.duration + PATH.touchdown, atol=1e-9)


def test_a_path_without_a_touchdown_has_no_foothold():
    short = simulate_stride(P, "SS_bv^w", (-0.2, 0.97, 1.05, 0.1), WALK.controls)
    path = lateral_path((short,), P.gravity)
    got = place(path, aim(Side.LEFT)[0], 0.0, np.zeros(2), np.zeros(2))
    assert path.section == np.inf
    assert np.isnan(got.y)


def test_where_single_stance_lasts_longer_the_foot_is_put_further_out():
    slow = lateral_path((STRIDE, STRIDE), P.gravity, stretch=1.07)
    for side in Side:
        to, cycle = aim(side)
        com = cycle.states[side.row]
        there, further = (place(path, to, 0.0, com, np.zeros(2)) for path in (PATH, slow))
        assert side * further.y < side * there.y
        assert np.isclose(further.left, 1.07 * there.left)


def test_a_learnt_offset_keeps_the_wished_width():
    """Of a robot that adds it to where the template's steps end."""
    learnt = LateralLearnt(offset=np.array([[0.004, 0.01], [-0.002, 0.02]]))
    side, stance = Side.LEFT, 0.1
    com = aim(side)[1].states[0] + (stance, 0.0)
    for _ in range(30):
        to, _ = aim(side, learnt)
        got = place(PATH, to, 0.0, com, np.array([stance, 0.0]))
        com, stance = got.state(got.y) + (got.y, 0.0), got.y
        side = side.other
    to, cycle = aim(side, learnt)
    assert np.isclose(com[0] - stance, cycle.states[side.row, 0], atol=1e-6)
    got = place(PATH, to, 0.0, com, np.array([stance, 0.0]))
    assert np.isclose(side * (stance - got.y), 0.2, atol=1e-5)


def test_a_tick_compiles_nothing_anew():
    ready(KERNELS)
    known = [len(f.signatures) for f in (place, transition)]
    # Whole numbers are taken too.
    options = LateralOptions(step_cost=1, reach=1, state_cost=(1, 0), hold=0)
    cycle, two = lateral_cycle(LATERAL, LateralWish(1)), np.zeros(2)
    place(PATH, lateral_aim(LATERAL, cycle, Side.LEFT, LateralLearnt(), options), 0.0, two, two)
    assert [len(f.signatures) for f in (place, transition)] == known


def test_the_com_falls_away_from_the_pivot_of_a_foot_that_rolls():
    rolling, stiffness, dt = 0.07, 29.0, 1e-4
    y, speed, foot = 0.02, 0.1, -0.01
    rests = pivot(foot, y, rolling)
    rate, ahead, start = np.sqrt((1.0 - rolling) * stiffness), speed, y - rests
    for _ in range(2000):
        speed += 0.5 * dt * stiffness * (y - foot)
        y, foot = y + dt * speed, foot + rolling * dt * speed
        speed += 0.5 * dt * stiffness * (y - foot)
    time = 2000 * dt
    falls = start * np.cosh(rate * time) + ahead / rate * np.sinh(rate * time)
    assert y == pytest.approx(rests + falls, rel=1e-6)
    assert foot == pytest.approx(contact(rests, y, rolling), abs=1e-12)


def test_a_foothold_that_is_not_known_is_neither_kept_nor_learnt_from():
    planner = LateralPlanner(P, OPTIONS, LateralWish(0.2), np.zeros(1, MEMORY))
    com, feet, (to, _) = np.array([0.05, 0.0]), np.array([0.1, 0.0]), aim(Side.LEFT)

    def foothold(section):
        plan = PATH._replace(section=section), to
        return lateral_foothold(planner.data[0], plan, 0.0, com, feet)

    assert np.isnan(foothold(np.inf))
    assert planner.placed is None
    known = foothold(PATH.section)
    assert np.isfinite(known)
    assert foothold(np.inf) == known
    assert planner.placed.y == known
