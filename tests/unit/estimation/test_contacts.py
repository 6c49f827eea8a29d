"""Contact flags: which are believed at once and which are not, walls, and wrong flags at random."""

from dataclasses import replace

import numpy as np
import pytest
from contact_flags import take_in
from hypothesis import given, settings
from hypothesis import strategies as st

import template_control as tc
from template_control.embedding import EmbeddingOptions
from template_control.estimation import ContactOptions
from template_control.estimation.contacts import CONTACTS, set_contacts
from template_control.robot.biped import SINGLE
from template_control.robot.library import load_floating_robot
from template_control.robot.start import state_at_vlo
from template_control.slip.similarity import Scale

WEIGHT, DT = 785.0, 1e-3
DOUBT = 4  # ticks of DT
OPTIONS = ContactOptions(doubt=DOUBT * DT)
STANDS, IN_THE_AIR, DUE = True, False, None


def contacts_of(standing=(False, False), options=OPTIONS):
    found = np.zeros(1, CONTACTS)
    set_contacts(found, options, WEIGHT, Scale.of(tc.SlipParameters()), SINGLE)
    for _ in range(DOUBT):
        take_in(found, np.array(standing), None, standing, DT)
    return found


@pytest.mark.parametrize("expected", [STANDS, IN_THE_AIR, DUE])
@pytest.mark.parametrize("stood", [False, True])
def test_what_the_path_expects_is_believed_at_once_and_nothing_else(expected, stood):
    """The other foot, of which nothing is said, keeps its state."""
    contacts = contacts_of((stood, stood))
    for tick in range(1, DOUBT + 1):
        stands = take_in(contacts, np.array([not stood, stood]), None, (expected, stood), DT)
        at_once = expected in (DUE, not stood)
        assert stands[0] == (not stood if at_once or tick == DOUBT else stood)
        assert stands[1] == stood


@given(
    flags=st.lists(st.booleans(), min_size=1, max_size=60),
    expected=st.sampled_from([STANDS, IN_THE_AIR]),
)
@settings(max_examples=200, deadline=None)
def test_only_a_flag_that_lasts_moves_a_foot_against_the_path(flags, expected):
    contacts = contacts_of((expected, False))
    for tick in range(len(flags)):
        now = np.array([flags[tick], False])
        stands = take_in(contacts, now, None, (expected, False), DT)
        last = flags[max(tick + 1 - DOUBT, 0) : tick + 1]
        against = len(last) == DOUBT and expected not in last
        assert stands[0] == (expected is not against)


def test_a_false_flag_becomes_no_touchdown_by_coming_due():
    """A foot that is due is asked anew: what was said of it before does not count."""
    contacts = contacts_of()
    take_in(contacts, np.array([True, False]), None, (IN_THE_AIR, STANDS), DT)
    assert not take_in(contacts, np.array([False, False]), None, (DUE, STANDS), DT)[0]
    assert take_in(contacts, np.array([True, False]), None, (DUE, STANDS), DT)[0]


def test_a_wall_is_told_from_ground_by_the_direction_of_its_force():
    contacts, both = contacts_of(), np.ones(2, dtype=bool)
    force = np.array([[-60.0, 100.0], [-100.0, 60.0]])
    assert take_in(contacts, both, force, (DUE, DUE), DT).tolist() == [True, False]
    assert (contacts["wall"][0] > 0.0).tolist() == [False, True]
    force = np.array([[100.0, 0.0], [-10.0, 0.0]])
    assert take_in(contacts, both, force, (DUE, DUE), DT).tolist() == [False, True]
    assert contacts["wall"][0, 0] <= 0.0, "a wall behind the foot is not in its way"


def test_a_wall_counts_for_a_while_after_its_last_force():
    contacts, none = contacts_of(options=replace(OPTIONS, linger=0.01)), np.zeros(2, dtype=bool)
    take_in(contacts, none, np.array([[-100.0, 0.0], [0.0, 0.0]]), (DUE, DUE), DT)
    after = 0
    while contacts["wall"][0, 0] > 0.0:
        take_in(contacts, none, np.zeros((2, 2)), (DUE, DUE), DT)
        after += 1
    assert after == pytest.approx(10, abs=1)


def test_axes_that_turn_do_not_forget_a_wall(robot, default_gait):
    """State and contacts are read again as the axes lean with the ground."""
    controller = tc.EmbeddingController(robot, tc.LqrPlanner(default_gait))
    z, swing = default_gait.vlo, np.array([0.0, controller.swings.other.clearance])
    q, v = state_at_vlo(robot, z, 0, swing, np.array([2.0 * z[0], 0.0]))
    controller.start()
    wall = np.array([[0.0, WEIGHT], [-0.5 * WEIGHT, 0.1 * WEIGHT]])
    for _ in range(2 * DOUBT):
        controller.tick(q, v, np.ones(2, dtype=bool), DT, wall)
    standing = controller.memory[0]["contacts"]["standing"][0]
    assert standing.tolist() == [1, 0]
    assert controller._tilt_axes(0.05, 0), "the axes turn"
    assert standing.tolist() == [1, 0]


def flawed(steps, seed, embedding=None, share=0.02):
    """Options of a run in which flags are wrong."""
    sensors = tc.SensorOptions(contact_errors=share, seed=seed)
    return tc.Experiment(
        steps=steps, sensors=sensors, controller=embedding or EmbeddingOptions(), record_every=10
    )


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("seed", [1])
def test_a_walk_bears_wrong_flags_by_doubting_them(robot, default_gait, seed):
    """Believed at once, one of them puts a foot down 6 cm over the ground."""
    planner = tc.LqrPlanner(default_gait)
    rash = EmbeddingOptions(contacts=ContactOptions(doubt=0.0))
    assert tc.simulate(replace(flawed(20, seed, rash), robot=robot, planner=planner)).fell
    record = tc.simulate(replace(flawed(20, seed), robot=robot, planner=planner))
    assert not record.fell
    assert record.section_state[-5:, 0] == pytest.approx(default_gait.vlo[0], rel=0.01)


@pytest.mark.slow(seconds=4)
def test_an_undisturbed_walk_is_the_same_whatever_the_doubt(robot, default_gait):
    """All its touchdowns are due."""
    planner = tc.LqrPlanner(default_gait)
    walks = [
        tc.simulate(
            tc.Experiment(
                robot,
                planner=planner,
                steps=4,
                controller=EmbeddingOptions(contacts=ContactOptions(doubt=doubt)),
            )
        )
        for doubt in (0.0, 0.05)
    ]
    np.testing.assert_array_equal(walks[0].torque, walks[1].torque)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("name", ["bolt", "five-link-3d"])
def test_a_free_robot_bears_wrong_flags(name):
    robot = load_floating_robot(name)
    sensors = tc.SensorOptions(contact_errors=0.02, seed=1)
    record = tc.simulate(
        tc.Experiment(
            robot,
            planner=tc.LqrPlanner(tc.default_gait(robot)),
            steps=12,
            sensors=sensors,
            record_every=10,
        )
    )
    assert not record.fell


@pytest.mark.slow(seconds=5)
def test_many_steps_with_two_flags_in_a_hundred_wrong(robot, default_gait):
    record = tc.simulate(replace(flawed(80, 0), robot=robot, planner=tc.LqrPlanner(default_gait)))
    assert not record.fell
    assert record.steps == 80
