"""A foot that meets something: what counts as a touchdown, which legs then push."""

from dataclasses import replace

import numpy as np
import pytest
from robot_guards import RobotGuards

import template_control as tc
from template_control.embedding import HIGH_SWING, GuardOptions, SwingOptions, Swings
from template_control.embedding.planners.planner import Decision
from template_control.embedding.replanning import (
    END_TOLERANCE,
    choose_legs,
)
from template_control.embedding.state import TemplateState
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot
from template_control.slip.control.stride_solver import rest
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.maps.return_map import new_workspace
from template_control.slip.maps.section import VLO
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import Scale

SCALE = Scale.of(tc.SlipParameters())


@pytest.mark.parametrize(
    ("place", "due", "expected"),
    [(0.2, np.inf, True), (0.2, 0.1, True), (-0.1, 0.2, False), (-0.1, 0.03, True)],
)
def test_an_early_contact_counts_in_front_of_the_com(place, due, expected):
    guards = RobotGuards(tc.SlipParameters(), GuardOptions())
    edge = AUTOMATON.start("w").edge(Event.TOUCHDOWN)
    sensed = TemplateState(toes=np.array([-0.3, place]))
    assert guards.fired(edge, sensed, due, contact=(False, True)) is expected


def landing(gait, height):
    """Where the step ends by its controls, from a touchdown on ground that much higher.

    On lower ground the leg has its length when the CoM has fallen, and is faster.
    """
    simulator = StrideSimulator(gait.parameters, AUTOMATON)
    stride = simulator.run("SS_av^w", VLO.state(gait.vlo), gait.controls)
    touchdown = next(e.time for e in stride.events if e.event is Event.TOUCHDOWN)
    row = np.flatnonzero(np.isclose(stride.meta[:, 0], touchdown))[0]
    toes = tuple(stride.meta[row, 3:5])
    state = np.array([c[row, n] for n in (0, 1) for c in (stride.cx, stride.cy)])
    state[1] -= max(height, 0.0)
    fall = max(-height, 0.0)
    state[2:] *= np.sqrt(1.0 + 2.0 * gait.parameters.gravity * fall / (state[2:] @ state[2:]))
    return rest(simulator, "DS_sc^w", state, toes, new_workspace())


def test_legs_push_longer_after_a_step_up(gait):
    """The template steps on ground 3 cm higher, with its leg that much shorter."""
    ahead = landing(gait, 0.03)

    def surprise(end):
        return np.abs((end - gait.vlo) / END_TOLERANCE).max()

    decision = Decision(gait.controls, gait.vlo, True, True, True)
    free = [Slot.K_SC, Slot.K_SD]
    chosen = choose_legs(ahead, decision, gait.vlo, free, gait.controls, SCALE)
    before, _ = ahead(gait.controls)
    after, outcome = ahead(chosen.controls)
    assert outcome is Outcome.SECTION
    assert surprise(after) < 0.7 * surprise(before)
    np.testing.assert_allclose(chosen.predicted, after)
    assert not chosen.nominal, "nothing is learnt from it"
    k = chosen.controls[free] / gait.controls[free]
    assert np.all((k >= 0.5) & (k <= 2.0))


def test_legs_without_stiffnesses_to_choose_stay_as_they_are(gait):
    """The gait of a step from a stand has none: no springs carry it."""
    ahead, none = landing(gait, -0.03), np.zeros(NUM_SLOTS)
    decision = Decision(gait.controls, gait.vlo, True, True, True)
    chosen = choose_legs(ahead, decision, gait.vlo, [Slot.K_SC], none, SCALE, lambda end: 1.0)
    np.testing.assert_array_equal(chosen.controls, gait.controls)
    np.testing.assert_allclose(chosen.predicted, ahead(gait.controls)[0])


def test_after_a_step_down_the_legs_lead_where_the_next_step_can_brake(gait):
    """The end that looks nearest to the gait is not the one from which a step brakes best."""
    ahead = landing(gait, -0.03)
    planner = tc.LqrPlanner(gait)
    decision = Decision(gait.controls, gait.vlo, True, True, True)
    free = [Slot.K_SC, Slot.K_SD]
    near = choose_legs(ahead, decision, gait.vlo, free, gait.controls, SCALE)
    cheap = choose_legs(ahead, decision, gait.vlo, free, gait.controls, SCALE, planner.cost)
    end, outcome = ahead(cheap.controls)
    assert outcome is Outcome.SECTION
    np.testing.assert_allclose(cheap.predicted, end)
    assert planner.cost(end) < 0.7 * planner.cost(near.predicted)


@pytest.mark.parametrize(("name", "high"), [("five-link", True), ("rabbit", False)])
def test_light_legs_lift_their_feet_high_in_steady_walking(name, high):
    robot = tc.load_robot(name)
    swings = Swings.of(robot, SCALE)
    walk = StrideGoal("w", np.zeros(3), 1.1)
    assert (swings.towards(walk) == HIGH_SWING) is high
    assert swings.towards(replace(walk, then="wr")) == SwingOptions(), "a run comes"
    own = SwingOptions(clearance=0.07)
    assert Swings.of(robot, SCALE, own).towards(walk) == own


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("place", "height"), [(3.935, 0.03), (3.083, -0.03), (5.851, -0.03)])
def test_an_unseen_step_leaves_the_walk_at_its_speed(default_gait, place, height):
    """With the feet lower or with legs chosen by the end state alone the robot fell."""
    gait = default_gait
    plant = tc.PlantOptions(terrain=tc.Terrain.step(height, place * gait.step_length))
    record = tc.simulate(
        tc.Experiment(
            tc.load_robot("five-link"),
            planner=tc.LqrPlanner(gait),
            steps=int(place) + 9,
            world=plant,
            record_every=5,
        )
    )
    assert not record.fell
    assert record.section_state[-2:, 0] == pytest.approx(gait.state[0], rel=0.03)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("place", [3.01, 3.91, 3.995])
def test_a_step_up_right_before_a_foothold_is_climbed(default_gait, place):
    """The foot came down in front of the wall, or lifted off right behind it."""
    gait = default_gait
    plant = tc.PlantOptions(terrain=tc.Terrain.step(0.03, place * gait.step_length))
    record = tc.simulate(
        tc.Experiment(
            tc.load_robot("five-link"), planner=tc.LqrPlanner(gait), steps=12, world=plant
        )
    )
    assert not record.fell
    assert record.foot[-1, :, 1].min() > 0.029
    assert record.section_state[-1, 0] > 0.9 * gait.state[0]
