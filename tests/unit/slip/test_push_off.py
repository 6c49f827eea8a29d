"""The fourth control: the rear leg's own stiffness in double stance."""

import numpy as np
import pytest

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.modified import ModifiedPlanner
from template_control.embedding.planners.planner import Cause, Context, RestContext
from template_control.embedding.replanning import free_controls
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event, MapKind, Outcome, Phase, Slot
from template_control.slip.control.stride_solver import rest
from template_control.slip.dynamics.stride import StrideSimulator, controls
from template_control.slip.gaits.gait import (
    uncontrolled,
    vlo_jacobians,
    with_push_off,
    without_push_off,
)
from template_control.slip.maps.return_map import ReturnMap, new_workspace
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
K0 = P.leg_stiffness


@pytest.fixture(scope="module")
def pushing(gait):
    return with_push_off(gait)


def test_only_the_rear_leg_of_double_stance_has_it():
    for node in AUTOMATON.stride(STRIDE_START["wp"]):
        assert (node.rear is Slot.K_PUSH) == (node.phase is Phase.DS)
        assert node.front is not Slot.K_PUSH
        twin = AUTOMATON.node(node.name.removesuffix("p"))
        assert [edge.event for edge in node.edges] == [edge.event for edge in twin.edges]


@pytest.mark.parametrize("kind", list(MapKind))
def test_equal_stiffness_is_the_step_of_the_paper(gait, kind):
    z = gait.vlo + [0.03, 0.002, -0.04]
    u = controls(np.radians(66.5), K0, K0, k_push=K0)
    paper, ours = (ReturnMap(P, stride, kind).step(z, u) for stride in ("w", "wp"))
    np.testing.assert_array_equal(ours[0], paper[0])
    assert ours[1] is paper[1] is Outcome.SECTION


@pytest.mark.parametrize("push", [0.6, 0.85, 1.2, 1.4])
def test_the_improved_map_knows_unequal_legs(gait, push):
    u = controls(np.radians(66.0), K0, K0, k_push=push * K0)
    exact, improved = (ReturnMap(P, "wp", k) for k in (MapKind.EXACT, MapKind.IMPROVED))
    np.testing.assert_allclose(improved(gait.vlo, u).state, exact(gait.vlo, u).state, atol=0.03)


def test_a_stiff_push_off_speeds_up(gait):
    step = ReturnMap(P, "wp")
    soft, stiff = (
        step(gait.vlo, controls(np.radians(66.0), K0, K0, k_push=share * K0)).state
        for share in (0.95, 1.05)
    )
    energy = [step.sections[0].energy(P, z) for z in (soft, gait.vlo, stiff)]
    assert energy[0] < energy[1] < energy[2]


def test_it_gives_the_controls_the_third_direction(gait, pushing):
    without, b = vlo_jacobians(gait)[1], vlo_jacobians(pushing)[1]
    assert np.linalg.svd(without)[1][2] < 1e-9
    assert np.linalg.svd(b)[1][2] > 0.05
    # What the paper's controls leave alone, the angle and equal stiffnesses leave alone too.
    n = uncontrolled(gait)
    assert n @ b[:, 0] == pytest.approx(0.0, abs=1e-9)
    assert n @ b[:, 1:].sum(axis=1) == pytest.approx(0.0, abs=1e-9)
    assert abs(n @ b[:, 3]) > 0.05


def test_the_planner_settles_on_the_gait_whatever_the_robot_adds(pushing):
    planner, step, z = LqrPlanner(pushing), ReturnMap(P, "wp"), pushing.vlo.copy()
    for _ in range(80):
        decision = planner.decide(Context(z))
        z_next = step.step(z, decision.controls)[0] + [0.01, -0.001, 0.02]
        planner.observe(decision, z_next)
        z = z_next
    assert np.all(np.abs(z - pushing.vlo) < [0.001, 0.0005, 0.003])


def test_the_planner_completes_steps_far_from_the_gait(pushing):
    planner, step = LqrPlanner(pushing), ReturnMap(P, "wp")
    rng = np.random.default_rng(5)
    for _ in range(20):
        z = pushing.vlo + rng.uniform(-1.0, 1.0, 3) * [0.2, 0.01, 0.2]
        decision = planner.decide(Context(z))
        assert decision.feasible
        k = decision.controls[Slot.K_PUSH]
        assert 0.5 * K0 - 1e-6 <= k <= 1.5 * K0 + 1e-6
        np.testing.assert_allclose(step.step(z, decision.controls)[0], decision.predicted)


@pytest.mark.parametrize(
    "slow", [(0.405, 0.985, 0.021), (0.515, 0.975, -0.089), (0.363, 0.977, 0.214)]
)
def test_the_search_takes_no_step_that_only_the_closed_form_completes(pushing, slow):
    planner = LqrPlanner(pushing)
    decision = planner.decide(Context(np.array(slow)))
    end, outcome = ReturnMap(P, "wp").step(np.array(slow), decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(end, decision.predicted, atol=1e-9)
    assert planner.cost(np.array(slow)) < 5.0


def test_the_search_does_not_bend_legs_for_nothing(pushing):
    """Without a price of controls it found legs of half the stiffness here, which sink."""
    decision = LqrPlanner(pushing).decide(Context(pushing.vlo + [-0.042, 0.002, -0.113]))
    assert decision.feasible
    stiff = decision.controls[[Slot.K_SC, Slot.K_SD, Slot.K_PUSH]]
    assert np.all(np.abs(stiff / K0 - 1.0) < 0.3)


def test_no_step_begins_in_flight(pushing):
    """There the template's leg would pull at the ground."""
    planner = LqrPlanner(pushing)
    steps = [planner.decide(Context(np.array([1.1, height, 0.4]))) for height in (0.98, 1.007)]
    assert [step.feasible for step in steps] == [True, False]


def test_the_paper_s_planner_walks_without_it(pushing):
    planner = ModifiedPlanner(pushing)
    assert planner.gait.stride == "w"
    assert planner.decide(Context(planner.gait.vlo)).controls[Slot.K_PUSH] == 0.0
    np.testing.assert_array_equal(without_push_off(pushing).controls, planner.gait.controls)


@pytest.mark.parametrize("push", [-0.12, 0.12])
def test_a_push_in_double_stance_is_answered_at_once(pushing, push):
    planner, simulator = LqrPlanner(pushing), StrideSimulator(P)
    decision = planner.decide(Context(pushing.vlo))
    first = simulator.run("SS_av^wp", VLO.state(pushing.vlo), decision.controls)
    node, time = "DS_sc^wp", first.time_of(Event.TOUCHDOWN)
    state = first.sample(np.array([time]))[0, :4] + [0.0, 0.0, push, 0.0]
    toes = (float(first.meta[-1, 3]) - pushing.step_length, float(first.meta[-1, 3]))

    ahead = rest(simulator, node, state, toes, new_workspace())
    free = free_controls(AUTOMATON, AUTOMATON.node(node))
    again = planner.decide_rest(RestContext(ahead, decision, pushing.vlo, free))
    left, better = (abs(ahead(d.controls)[0][0] - pushing.vlo[0]) for d in (decision, again))
    assert better < 0.8 * left
    np.testing.assert_array_equal(again.controls[Slot.TOUCHDOWN_ANGLE], decision.controls[0])
    # The offset is still learnt from the whole step.
    moved = ahead(again.controls)[0] - ahead(decision.controls)[0]
    np.testing.assert_allclose(again.predicted - decision.predicted, moved)


def test_where_nothing_completes_the_step_that_is_told(pushing):
    planner = LqrPlanner(pushing)
    decision = planner.decide(Context(pushing.vlo))

    down = [0.0, 0.6, 1.0, -5.0]  # with any legs it falls
    fails = rest(StrideSimulator(P), "DS_sc^wp", down, (-0.3, 0.3), new_workspace())
    lost = planner.decide_rest(RestContext(fails, decision, pushing.vlo, [int(Slot.K_PUSH)]))
    assert not lost.feasible
    assert not lost.nominal
    np.testing.assert_array_equal(lost.controls, decision.controls)


def test_three_controls_leave_the_rest_of_a_step(gait):
    planner = LqrPlanner(gait)
    decision = planner.decide(Context(gait.vlo))
    rest = RestContext(lambda u: (gait.vlo, Outcome.SECTION), decision, gait.vlo, [])
    assert planner.decide_rest(rest) is decision
    assert planner.decide_rest(rest._replace(cause=Cause.RECOVERY)) is None, (
        "nothing breaks into it"
    )
