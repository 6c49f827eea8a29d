"""The planner of a stride from one gait to the other: on the template, and from within a stride."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    Planner,
    RestContext,
)
from template_control.embedding.planners.running import RunningPlanner
from template_control.embedding.planners.transition import (
    RUN_TO_WALK,
    TOLERANCE,
    WALK_TO_RUN,
    TransitionPlanner,
)
from template_control.embedding.replanning import free_controls
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.state import EstimatorState, TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event, Outcome, Slot
from template_control.slip.control.stride_solver import rest
from template_control.slip.dynamics.stride import StrideSimulator, simulate_stride
from template_control.slip.gaits.running_gait import running_gait, running_speeds
from template_control.slip.gaits.walking_by_speed import walking_gait
from template_control.slip.maps.return_map import ReturnMap, new_workspace
from template_control.slip.maps.section import APEX, VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import StrideGoal

P = SlipParameters()
UNIT = P.mass * P.gravity / P.rest_length
SLOWEST, FASTEST = running_speeds(P)


def runs(speed):
    return running_gait(P, float(np.clip(speed, SLOWEST, FASTEST)))


WALK = walking_gait(P, 1.1)
WALKING = LqrPlanner(WALK)
RUNNING = RunningPlanner(runs(SLOWEST))


def walk_to_run(**options):
    return TransitionPlanner("wr", WALKING, runs, replace(WALK_TO_RUN, **options))


def run_to_walk(**options):
    return TransitionPlanner(
        "rw", RUNNING, partial(walking_gait, P), replace(RUN_TO_WALK, **options)
    )


@pytest.mark.parametrize("planner", [walk_to_run(), run_to_walk()])
def test_it_is_a_planner_that_chooses_again_where_a_foot_has_landed(planner):
    assert isinstance(planner, Planner)
    assert type(planner).decide_rest is not Planner.decide_rest


@pytest.mark.parametrize("speed", [1.3, 1.5, 2.0])
def test_from_the_walk_it_comes_to_the_run_within_tolerance(speed):
    target, planner = runs(speed).apex, walk_to_run()
    decision = planner.decide(Context(WALK.vlo, target))
    end, outcome = ReturnMap(P, "wr").step(WALK.vlo, decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted, [*end, 0.0], atol=1e-12)
    assert np.all(np.abs(end - target) < TOLERANCE[:2] / 5)
    walks = WALK.controls[[Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD]]
    np.testing.assert_allclose(decision.controls[:3], walks, rtol=1e-3)
    assert decision.feasible
    assert not decision.nominal, "one stride teaches nothing"
    assert planner.gait.apex[0] == speed


@pytest.mark.parametrize("speed", [1.25, 1.4])
def test_from_the_run_it_comes_near_the_walk_with_legs_that_a_knee_can_be(speed):
    z = runs(speed).apex
    decision = run_to_walk().decide(Context(z, WALK.vlo))
    end, outcome = ReturnMap(P, "rw").step(z, decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted, end, atol=1e-12)
    tolerance = TOLERANCE
    assert np.all(np.abs(end - WALK.vlo) < 4.0 * tolerance)
    # The walking planner makes good what is left.
    for _ in range(8):
        end, outcome = ReturnMap(P, "w").step(end, WALKING.decide(Context(end)).controls)
        assert outcome is Outcome.SECTION
    assert np.all(np.abs(end - WALK.vlo) < 0.3 * tolerance)


@given(speed=st.floats(0.9, 1.3), height=st.floats(0.955, 0.995), target=st.floats(1.2, 2.5))
@settings(max_examples=25, deadline=None)
def test_walk_to_run_keeps_its_bounds(speed, height, target):
    decision = walk_to_run().decide(Context(np.array([speed, height, 0.0]), runs(target).apex))
    share = decision.controls[[Slot.K_SC_WR, Slot.K_SD_WR]] / (UNIT * np.array(WALK_TO_RUN.base))
    assert np.all(share >= 0.5 - 1e-12)
    assert np.all(share <= 2.0 + 1e-12)


@given(speed=st.floats(0.9, 2.5), height=st.floats(0.93, 1.05), target=st.floats(0.7, 1.2))
@settings(max_examples=25, deadline=None)
def test_run_to_walk_keeps_its_bounds(speed, height, target):
    decision = run_to_walk().decide(
        Context(np.array([speed, height]), np.array([target, 0.978, 0.0]))
    )
    angle = decision.controls[Slot.TOUCHDOWN_ANGLE]
    assert angle < np.arcsin(min(height, 1.0)), "the foot would be on the ground at once"
    assert angle <= RUN_TO_WALK.base[0] + RUN_TO_WALK.bounds[0][1] + 1e-12
    share = decision.controls[[Slot.K_SC, Slot.K_SD]] / (UNIT * np.array(RUN_TO_WALK.base[1:]))
    assert np.all(share >= 0.5 - 1e-12)
    assert np.all(share <= 2.0 + 1e-12)


@pytest.mark.parametrize("angle", [1.3, 1.34])
def test_an_angle_that_is_given_stays(angle):
    decision = run_to_walk().decide(Context(runs(1.3).apex, WALK.vlo, (angle, angle)))
    assert decision.controls[Slot.TOUCHDOWN_ANGLE] == angle


@pytest.mark.parametrize("base", [(4.0, 4.0), (60.0, 60.0)])
def test_where_the_base_fails_a_grid_finds_a_stride(base):
    step, target = ReturnMap(P, "wr"), runs(1.3).apex
    u = WALKING.decide(Context(WALK.vlo)).controls.copy()
    u[[Slot.K_SC_WR, Slot.K_SD_WR]] = UNIT * np.array(base)
    assert step.step(WALK.vlo, u)[1] is not Outcome.SECTION
    wide = walk_to_run(base=base, bounds=((0.2, 6.0), (0.2, 6.0)))
    decision = wide.decide(Context(WALK.vlo, target))
    assert decision.feasible
    end, outcome = step.step(WALK.vlo, decision.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(decision.predicted[:2], end, atol=1e-12)


def test_where_nothing_is_found_it_says_so_and_keeps_to_its_base():
    narrow = walk_to_run(base=(4.0, 4.0), bounds=((0.9, 1.1), (0.9, 1.1)))
    target = runs(1.3).apex
    decision = narrow.decide(Context(WALK.vlo, target))
    assert not decision.feasible
    assert not decision.lasting
    np.testing.assert_allclose(decision.controls[[Slot.K_SC_WR, Slot.K_SD_WR]], 4.0 * UNIT)
    np.testing.assert_allclose(decision.predicted, [*target, 0.0])


def middle(stride, z, section, u, event):
    """Node, state and toes of the template right after an event."""
    whole = simulate_stride(P, AUTOMATON.starts[stride], section.state(z), u)
    at = whole.time_of(event) + 1e-9
    (node,) = whole.nodes(at)
    row = int(np.searchsorted(whole.meta[:, 0], at, side="right")) - 1
    return node, whole.sample(at)[0, :4], whole.meta[row, 3:5]


def ahead_from(node, state, toes):
    return rest(StrideSimulator(P), node, state, toes, new_workspace())


CASES = {
    "wr": (walk_to_run(), WALK.vlo, VLO, Event.VIRTUAL_BOTTOM, runs(1.4).apex),
    "rw": (run_to_walk(), runs(1.3).apex, APEX, Event.TOUCHDOWN, np.array([1.0, 0.97, 0.0])),
}


@pytest.mark.parametrize("stride", CASES)
def test_what_is_chosen_within_a_stride_is_what_the_whole_stride_does(stride):
    planner, z, begin, event, target = CASES[stride]
    first = planner.decide(Context(z))
    node, state, toes = middle(stride, z, begin, first.controls, event)
    free = free_controls(AUTOMATON, AUTOMATON.node(node))
    ahead = ahead_from(node, state, toes)
    again = planner.decide_rest(RestContext(ahead, first, target, free))
    assert again.feasible
    kept = [slot for slot in Slot if slot not in free]
    np.testing.assert_array_equal(again.controls[kept], first.controls[kept])
    # None of the free stiffnesses has acted before: the stride from its section must be the same.
    whole, outcome = ReturnMap(P, stride).step(z, again.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(again.predicted[: len(whole)], whole, atol=1e-7)
    tolerance = TOLERANCE[: len(target)]
    before = ReturnMap(P, stride).step(z, first.controls)[0]
    missed = [np.linalg.norm((x - target) / tolerance) for x in (before, whole)]
    assert missed[1] < 0.9 * missed[0]


def test_a_leg_that_has_landed_elsewhere_gets_other_stiffnesses():
    planner, z, begin, event, target = CASES["rw"]
    first = planner.decide(Context(z, target))
    node, state, toes = middle("rw", z, begin, first.controls, event)
    state[2] += 0.1  # faster than planned
    ahead = ahead_from(node, state, toes)
    again = planner.decide_rest(
        RestContext(ahead, first, target, free_controls(AUTOMATON, AUTOMATON.node(node)))
    )
    tolerance = TOLERANCE
    left, right = (
        np.linalg.norm((ahead(d.controls)[0] - target) / tolerance) for d in (first, again)
    )
    assert right < left
    assert again.controls[Slot.TOUCHDOWN_ANGLE] == first.controls[Slot.TOUCHDOWN_ANGLE]


class IntoARun:
    """A route that begins with the transition."""

    parameters, start, section, endless = P, WALK.vlo, VLO, True

    def reset(self):
        pass

    def next(self, section, z, now):
        return StrideGoal("wr" if section is VLO else "r", runs(1.3).apex, 1.3)

    ahead = next


def test_a_push_within_a_transition_gets_other_stiffnesses():
    supervisor = StrideSupervisor(IntoARun(), {"wr": walk_to_run(), "r": RUNNING}, ReplanOptions())
    supervisor.begin(VLO)
    speed, height, vertical = WALK.vlo
    start = TemplateState(np.array([0.0, height, speed, vertical]), np.zeros(2))
    supervisor.decide(VLO, start, 0.0, EstimatorState(load=1.0, trim=0.0, lean=0.0))
    before = supervisor.decision.controls.copy()
    node, state, toes = middle("wr", WALK.vlo, VLO, before, Event.REAR_LIFTOFF)
    pushed = TemplateState(state - [0.0, 0.0, 0.2, 0.0], np.array(toes))
    as_before = StrideSimulator(P).run(node, pushed.state, before, tuple(toes))
    assert as_before.outcome is not Outcome.SECTION, "it does not leave the ground"
    supervisor.replan(Cause.DEVIATION, AUTOMATON.node(node), pushed, 0.5, phase_time=0.1)
    after = supervisor.decision.controls
    # The energy that the push took comes back from a leg that becomes stiffer at its bottom.
    assert (
        after[Slot.K_SD_WR] / after[Slot.K_SC_WR]
        > 1.1 * before[Slot.K_SD_WR] / before[Slot.K_SC_WR]
    )
    kept = [Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD]
    np.testing.assert_array_equal(after[kept], before[kept])
    assert supervisor.path.strides[0].outcome is Outcome.SECTION


def test_where_the_rest_cannot_be_done_the_controls_stay():
    planner, z, *_, target = CASES["rw"]
    first = planner.decide(Context(z, target))

    # With any legs it falls.
    fails = ahead_from("SS_sc^rw", [0.0, 0.6, 1.0, -8.0], (-0.3, 0.3))
    again = planner.decide_rest(RestContext(fails, first, target, [Slot.K_SC, Slot.K_SD]))
    assert isinstance(again, Decision)
    assert not again.feasible
    np.testing.assert_array_equal(again.controls, first.controls)


@pytest.mark.parametrize("stride", CASES)
def test_templates_of_all_sizes_change_alike(stride):
    unit = 10.0 * 3.7 / 0.4
    stiffness = P.leg_stiffness * unit / UNIT
    small = SlipParameters(mass=10.0, gravity=3.7, rest_length=0.4, leg_stiffness=stiffness)
    ratio = np.sqrt(small.gravity * small.rest_length / (P.gravity * P.rest_length))

    def its_runs(speed):
        low, high = running_speeds(small)
        return running_gait(small, float(np.clip(speed, low, high)))

    if stride == "wr":
        walk = walking_gait(small, 1.1 * ratio)
        other = TransitionPlanner("wr", LqrPlanner(walk), its_runs, WALK_TO_RUN)
    else:
        run = RunningPlanner(its_runs(SLOWEST * ratio))
        other = TransitionPlanner("rw", run, partial(walking_gait, small), RUN_TO_WALK)
    planner, z, *_, target = CASES[stride]
    sizes = np.array([ratio, small.rest_length, ratio])
    u = planner.decide(Context(z, target)).controls
    v = other.decide(Context(z * sizes[: len(z)], target * sizes[: len(target)])).controls
    np.testing.assert_allclose(v[0], u[0], rtol=1e-4)
    np.testing.assert_allclose(v[1:] / unit, u[1:] / UNIT, rtol=1e-3)


@pytest.mark.parametrize(
    ("node", "free"),
    [
        ("SS_av^w", [Slot.K_SC, Slot.K_SD]),
        ("SS_bv^w", [Slot.K_SD]),
        ("F_aa^r", [Slot.K_SC, Slot.K_SD]),
        ("SS_sd^r", [Slot.K_SD]),
        ("F_ba^r", []),
        ("SS_av^wr", [Slot.K_SC, Slot.K_SD, Slot.K_SC_WR, Slot.K_SD_WR]),
        ("DS_sd^wr", [Slot.K_SD, Slot.K_SC_WR, Slot.K_SD_WR]),
        ("SS_sc^wr", [Slot.K_SC_WR, Slot.K_SD_WR]),
        ("SS_sd^wr", [Slot.K_SD_WR]),
        ("SS_sc^rw", [Slot.K_SC, Slot.K_SD]),
        ("SS_sd^rw", [Slot.K_SD]),
    ],
)
def test_free_are_the_stiffnesses_that_the_rest_of_a_stride_uses(node, free):
    assert free_controls(AUTOMATON, AUTOMATON.node(node)) == free
