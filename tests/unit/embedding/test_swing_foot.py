"""The swing foot's path: clearance, reach, a slow landing, and ground that comes late."""

import numpy as np
import pytest

from template_control.embedding.swing import (
    FEET,
    HIGH_SWING,
    SLOW_SWING,
    SOLE_SWING,
    SwingOptions,
    Swings,
    begin_swing,
    drop,
    furthest,
    level_reach,
    meet_wall,
    quintic_step,
    swing_step,
    wait,
)
from template_control.embedding.tick import TICK, move_swings
from template_control.robot.library import load_floating_robot
from template_control.robot.template import template_for
from template_control.robot.terms import ROBOT_DATA
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.similarity import Scale, scaled
from template_control.whole_body.task import References


class Swing:
    """One foot's swing, from its start on."""

    def __init__(self, options, position, velocity, elapsed=0.0):
        self.data, self.reference = np.zeros(1, FEET), np.zeros((2, 3))
        begin_swing(self.data, 0, options, self.reference, position, velocity, elapsed)
        self.x, self.y = self.reference

    def advance(self, foothold, due, foreseen=True):
        aim = foothold, 0.0, due
        swing_step(self.data[0], 0, self.x, self.y, aim, foreseen, 1e-3)


def meet(swing, at, foothold, due):
    """A tick in which a foot is at a wall."""
    place = np.array([at[0], 0.0, at[1]])
    meet_wall(swing.data[0], 0, swing.x, swing.y, place, (foothold, due), 1e-3)


@pytest.mark.parametrize(("lag", "place"), [(None, 0.5), (0.2, 0.5), (0.1, 0.42)])
def test_a_reference_waits_for_a_foot_that_lags(lag, place):
    swing = Swing(SwingOptions(lag=lag), np.array([0.5, 0.0]), np.array([3.0, 0.0]))
    wait(swing.data[0], 0, swing.x, 0.32, 2.0)
    assert swing.x[0] == pytest.approx(place)
    assert swing.x[1] == (3.0 if place == 0.5 else 2.0)


def test_quintic_arrives():
    state = np.array([0.1, -0.4, 3.0])
    remaining, dt = 0.3, 1e-3
    for i in range(299):
        quintic_step(state, 0.7, 0.2, remaining - i * dt, dt)
    assert state[0] == pytest.approx(0.7 - 0.2 * dt, abs=1e-5)
    assert state[1] == pytest.approx(0.2, abs=1e-3)


def test_a_swing_steps_along_the_quintics_of_its_parts():
    options = SwingOptions(descent=0.1, horizon=0.015)
    here = np.array([0.1, -0.4, 3.0]), np.array([0.02, 0.2, -1.0])
    parts = {
        (0.0, 0.30): (options.clearance, 0.0, 0.5 * 0.30),  # it rises,
        (0.2, 0.15): (options.clearance, 0.0, 2.0 * options.horizon),  # stays up,
        (0.3, 0.08): (0.0, -options.landing_speed, 0.08),  # and comes down
    }
    for (elapsed, to_go), up in parts.items():
        other_x, other_y = (axis.copy() for axis in here)
        swing = Swing(options, np.zeros(2), np.zeros(2), elapsed)
        swing.x[:], swing.y[:] = here
        swing.advance(0.7, to_go)
        quintic_step(other_x, 0.7, 0.0, to_go - options.early, 1e-3)
        quintic_step(other_y, *up, 1e-3)
        np.testing.assert_array_equal((swing.x, swing.y), (other_x, other_y))


def test_a_swing_that_begins_at_once_is_slower_at_its_fastest():
    fastest = []
    for start in (0.0, 6.0):
        swing = Swing(SwingOptions(start=start, early=0.0), np.zeros(2), np.zeros(2))
        speeds = []
        for i in range(390):
            swing.advance(0.8, 0.4 - i * 1e-3)
            speeds.append(swing.x[1])
        fastest.append(max(speeds) / (0.8 / 0.4))
        assert swing.x[0] == pytest.approx(0.8, abs=1e-3)
    np.testing.assert_allclose(fastest, [1.875, 1.74], atol=0.01)


@pytest.mark.parametrize(("name", "shape"), [("g1", SOLE_SWING), ("talos", SLOW_SWING)])
def test_a_flat_foot_swings_by_how_fast_its_hip_is(name, shape):
    scale = Scale.of(template_for(load_floating_robot(name)))
    swings = Swings.of(load_floating_robot(name), scale)
    assert swings == (scaled(shape, scale),) * 2


def test_swing_clears_the_ground_and_lands_slowly():
    options = SwingOptions()
    swing = Swing(options, np.array([-0.6, 0.0]), np.zeros(2))
    heights, accelerations = [], []
    for i in range(400):
        swing.advance(0.6, 0.4 - i * 1e-3)
        heights.append(swing.y[0])
        accelerations.append(max(abs(swing.x[2]), abs(swing.y[2])))
    assert max(heights) == pytest.approx(options.clearance, abs=2e-3)
    late = heights[-1] / options.landing_speed
    assert 0.0 <= late < 0.025, "it coasts at the end"
    assert min(heights) > -2e-3
    assert swing.x[0] == pytest.approx(0.6, abs=2e-3)
    assert abs(swing.x[1]) < 0.05
    assert abs(swing.y[1]) <= options.landing_speed + 1e-9
    assert max(accelerations) < 80.0


@pytest.mark.parametrize("begun", [0.32, 0.35, 0.37])
def test_a_foot_that_is_due_later_does_not_come_down_sooner(begun):
    """A descent was planned for what was left of 0.4 s, and has 0.3 s more from ``begun`` on."""
    options = SwingOptions(rise=0.3)
    swing, soonest, strongest = Swing(options, np.zeros(2), np.zeros(2)), 0.0, 0.0
    for time in np.arange(0.0, 0.7, 1e-3):
        left = (0.4 if time < begun else 0.7) - time
        swing.advance(0.6, left)
        strongest = max(strongest, abs(swing.y[2]))
        if swing.y[0] <= 0.0 and not soonest:
            soonest = left
    assert soonest < options.horizon
    assert strongest < 40.0


@pytest.mark.parametrize("shape", [SwingOptions(), HIGH_SWING, SLOW_SWING])
@pytest.mark.parametrize(
    ("first", "begun", "more"), [(0.5, 0.44, 0.5), (0.4, 0.34, 0.4), (0.25, 0.2, 0.25)]
)
def test_no_foot_is_flung_up_where_its_touchdown_is_put_off(shape, first, begun, more):
    """Of 0.5 s in all, say, 0.44 are over when they become 0.94: 0.03 s are left to rise in."""
    swing, heights, soonest = Swing(shape, np.zeros(2), np.zeros(2)), [], 0.0
    for time in np.arange(0.0, begun + more, 1e-3):
        left = (first if time < begun else begun + more) - time
        swing.advance(0.6, left)
        heights.append(swing.y[0])
        if swing.y[0] <= 0.0 and not soonest:
            soonest = left
    assert max(heights) < 0.1
    assert soonest < 1.5 * shape.horizon


@pytest.mark.parametrize("landing_speed", [0.0, 0.2])
@pytest.mark.parametrize(("height", "speed"), [(1e-3, -0.3), (0.0, -0.3), (1e-3, -1e-9)])
def test_a_foot_that_lifts_off_on_its_way_down_rises(height, speed, landing_speed):
    """As its measured velocity may say."""
    options = SwingOptions(landing_speed=landing_speed)
    swing, heights = Swing(options, np.array([0.0, height]), np.array([0.0, speed])), []
    for left in np.arange(0.4, 0.0, -1e-3):
        swing.advance(0.6, left)
        heights.append(swing.y[0])
    assert max(heights) == pytest.approx(options.clearance, abs=6e-3)


@pytest.mark.parametrize(("foreseen", "brakes"), [(True, True), (False, False)])
def test_no_foot_brakes_for_a_guess(foreseen, brakes):
    """Nearly on the ground; by the gait alone, it would land 0.13 s from now."""
    swing = Swing(SwingOptions(), np.array([0.6, 0.011]), np.array([0.0, -0.6]), elapsed=0.27)
    quintic = swing.y.copy()
    quintic_step(quintic, 0.0, -SwingOptions().landing_speed, 0.13, 1e-3)
    swing.advance(0.6, 0.13, foreseen)
    assert np.array_equal(swing.y, quintic) != brakes


def test_swing_without_a_foothold_comes_down():
    swing = Swing(SwingOptions(), np.array([0.0, 0.05]), np.array([1.0, 0.0]))
    for _ in range(100):
        swing.advance(np.nan, 0.3)
    assert swing.y[0] == pytest.approx(0.05 - 0.02)
    assert swing.x[1] == 0.0


def test_swing_stays_within_reach_of_the_hip():
    x = furthest(0.97, (0.2, 0.85), 0.1, 0.2, 0.9)
    assert np.linalg.norm((x - 0.2, 0.75, 0.2)) == pytest.approx(0.97 * 0.9)
    assert furthest(0.97, (0.2, 1.2), 0.1, 0.0, 0.9) == 0.2, "nowhere but below the hip"


@pytest.mark.parametrize("foot", [0, 1])
@pytest.mark.parametrize("share", [-0.9, 0.9])
def test_a_sole_is_level_as_far_to_the_side_as_the_ankle_leans(foot, share):
    robot, names = load_floating_robot("g1"), ("left", "right")
    lean = share * robot.joint_range[robot.joint_names.index(f"{names[foot]}_ankle_roll_joint"), 1]
    q = robot.neutral()
    for joint, angle in (("hip_roll", lean), ("ankle_roll", -lean)):
        q[7 + robot.joint_names.index(f"{names[foot]}_{joint}_joint")] += angle
    robot.update(q, np.zeros(robot.nv))
    now = robot.data[0]
    place = now["contact_position"][foot]
    middle, reach = level_reach(now, foot, place[2])
    assert now["contact_axes"][foot, 2] == pytest.approx((0.0, 0.0, 1.0), abs=0.02)
    assert place[1] == pytest.approx(middle + np.sign(share) * reach, abs=0.01)


def test_swing_falls_to_ground_that_comes_late():
    options = SwingOptions(drop_acceleration=7.0)
    swing = Swing(options, np.array([0.6, 0.0]), np.array([0.1, -0.2]))
    for _ in range(50):
        drop(swing.data[0], 0, swing.x, swing.y, 1e-3)
    assert swing.y[0] == pytest.approx(-0.2 * 0.05 - 0.5 * options.drop_acceleration * 0.05**2)
    assert swing.x[0] == 0.6
    assert swing.x[1] == 0.0


def test_a_foot_is_high_while_it_travels():
    options = HIGH_SWING
    swing = Swing(options, np.array([-0.6, 0.0]), np.zeros(2))
    places, heights = [], []
    for i in range(400):
        swing.advance(0.6, 0.4 - i * 1e-3)
        places.append(swing.x[0])
        heights.append(swing.y[0])
    travels = (np.array(places) > -0.55) & (np.array(places) < 0.58)
    assert np.min(np.array(heights)[travels]) > 0.03


def test_a_foot_that_meets_a_wall_goes_up_along_it_and_on_above_it():
    options = SwingOptions(lift_speed=1.5, margin=0.03)
    swing = Swing(options, np.array([-0.6, 0.0]), np.zeros(2))
    for i in range(100):
        swing.advance(0.6, 0.4 - i * 1e-3)
    wall, below = np.array([-0.5, 0.07]), swing.y[0]
    for _ in range(20):
        meet(swing, wall, 0.6, 0.28)
    assert swing.x[0] == -0.5
    assert swing.x[1] == 0.0
    met = swing.y[0]
    assert met == pytest.approx(max(below, 0.07) + 20e-3 * options.lift_speed, abs=2e-3)
    for i in range(60):
        swing.advance(0.6, 0.28 - i * 1e-3)
    assert swing.x[0] > -0.45, "it goes on"
    assert swing.y[0] == pytest.approx(met + options.margin, abs=5e-3)


def test_a_foot_that_meets_a_wall_late_goes_down_before_it():
    swing = Swing(SwingOptions(), np.array([0.5, 0.03]), np.array([0.3, -0.5]))
    for _ in range(20):
        meet(swing, (0.5, 0.02), 0.6, 0.02)
    assert swing.x[0] == 0.5
    assert swing.y[0] < 0.03 - 0.5 * 0.02


@pytest.mark.parametrize(
    ("speed", "foothold", "rises"), [(-0.5, 0.53, False), (-0.5, 0.6, True), (0.5, 0.53, True)]
)
def test_a_foot_that_comes_down_and_is_nearly_there_is_set_down(speed, foothold, rises):
    """One that rises only begins its swing, and a short step ends near its beginning."""
    swing = Swing(SwingOptions(near=0.05), np.array([0.5, 0.03]), np.array([0.3, speed]))
    for _ in range(20):
        meet(swing, (0.5, 0.02), foothold, 0.07)
    assert (swing.y[0] > 0.03) == rises


@pytest.mark.parametrize("overdue", [False, True])
def test_an_overdue_foot_that_meets_a_wall_has_no_time_to_go_up(overdue):
    """The path of an overdue foot knows a later touchdown, of lower ground."""
    tick, robot, references = np.zeros(1, TICK), np.zeros(1, ROBOT_DATA), References()
    reference, start = references.foot[1], (np.array([0.57, -0.004]), np.array([0.0, -0.2]))
    begin_swing(tick["feet"], 1, SwingOptions(), reference, *start)
    now, (model,) = tick[0], robot
    now["feet"]["roles"], now["contacts"]["wall"][1] = (0, 1), 1.0
    now["mode"]["swings"], now["mode"]["swing_leg"][0] = 1, Leg.FRONT
    now["mode"]["next_touchdown_leg"] = Leg.FRONT
    now["path"]["without_touchdown"] = overdue
    now["path"]["landing_x"][1], now["path"]["landing_time"][1] = 0.7, 0.13
    model["foot_position"][1], model["hips"] = (0.57, 0.0, -0.006), (0.25, 0.0, 0.9)
    model["leg_length"] = 1.0
    for _ in range(10):
        move_swings(now, model, references.data[0], 1e-3)
    x, y = reference[:, 0]
    assert x == 0.57
    assert (y < -0.006) if overdue else (y > 0.0)


def test_a_foot_that_is_held_comes_down_late():
    options = SwingOptions(clearance=0.15, rise=0.4, descent=0.1, landing_speed=0.6)
    swing = Swing(options, np.array([-0.6, 0.0]), np.zeros(2))
    heights = []
    for i in range(400):
        swing.advance(0.6, 0.4 - i * 1e-3)
        heights.append(swing.y[0])
    np.testing.assert_allclose(heights[180:300], 0.15, atol=2e-3)
    assert heights[80] == pytest.approx(0.075, abs=5e-3), "half of the rise"
    assert heights[380] > 0.01
    assert 0.0 < heights[-1] < 0.01, "it coasts for the last moment"
    assert swing.y[1] == pytest.approx(-options.landing_speed, abs=1e-6)
