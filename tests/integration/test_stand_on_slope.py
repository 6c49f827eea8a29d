"""Standing, and starting to walk, on ground that is not level."""

from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.planners.planner import Context
from template_control.embedding.standing.curves import BetweenFeet, StandingOptions, standing_pose
from template_control.embedding.standing.planners import standing_planners
from template_control.errors import ParameterError
from template_control.estimation.slope import SlopeEstimate
from template_control.robot.template import startable_slopes
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.path import leg_forces

P = tc.SlipParameters()
TOES = (0.0, 0.3)


def sloping(degrees):
    """A slope that goes on behind the robot."""
    rise = np.tan(np.radians(degrees))
    return tc.Terrain(((-50.0, -50.0 * rise), (100.0, 100.0 * rise)))


def walked(plant, degrees, steps=12, robot="five-link"):
    """A record of a walk from a stand."""
    walk, world = tc.run.GaitSpec(from_stand=True), plant(terrain=sloping(degrees))
    return tc.simulate(tc.Experiment(robot, walk, steps=steps, world=world))


@pytest.mark.parametrize("degrees", [-5.0, -2.0, 0.0, 1.0, 4.0])
def test_who_rests_is_over_the_middle_of_the_feet(degrees):
    """The weight's line through the CoM meets the ground there, and both legs bear half."""
    slope = np.radians(degrees)
    feet = BetweenFeet(TOES, replace(P, slope=slope), StandingOptions())
    com = feet.at_rest(0.15)
    assert com[0, 0] - com[1, 0] * np.tan(slope) == pytest.approx(0.15)
    body = np.array([P.mass, *feet.parameters.gravity_parts, P.rest_length, 0.0])
    forces = np.empty((2, 2))
    row = np.array([0.0, 1.0, 0.0, *TOES, np.nan, np.nan])
    leg_forces(row, 0.0, com.T.ravel(), body, forces)
    np.testing.assert_allclose(forces[:, 1], 0.5 * P.mass * P.gravity * np.cos(slope))
    # What the legs push along the ground is what gravity pulls.
    assert forces[:, 0].sum() == pytest.approx(P.mass * P.gravity * np.sin(slope))


@pytest.mark.parametrize("degrees", [-5.0, -2.0, 0.0, 1.0, 3.0])
def test_a_start_comes_over_the_front_foot(degrees):
    """At VLO the CoM is fast enough to pass the vertical over the foot, which lies uphill."""
    planner = standing_planners(P)["sw"]
    ground = planner.on_slope(np.radians(degrees))
    rest = BetweenFeet(TOES, ground, StandingOptions()).at_rest(0.15)
    decision = planner.decide(Context(rest[:, 0], np.array([1.1, 0.978, 0.0])))
    decision, stride = planner.curve(AUTOMATON.start("sw").name, rest, TOES, decision)
    assert stride.outcome is Outcome.SECTION
    x, y, speed, _ = stride.state
    along = np.tan(np.radians(degrees)) * y  # from over the foot to where it is highest
    assert x == pytest.approx(TOES[1])
    assert speed**2 > P.gravity / y * max(along, 0.0) ** 2


def test_planners_are_level_again_after_a_reset():
    for kind, planner in standing_planners(P).items():
        there = planner.on_slope(0.05)
        if kind in ("sf", "sb"):
            assert there is None, "a step knows level ground only"
            continue
        assert there.slope == 0.05
        planner.reset()
        assert planner.on_slope(0.0) == P


@pytest.mark.parametrize("degrees", [-6.0, -1.0, 0.0, 4.0])
def test_a_robot_stands_with_both_feet_on_the_ground(degrees):
    ground = sloping(degrees)
    pose = standing_pose(P, ground=ground.height_at)
    for x, height in pose.feet:
        assert height == pytest.approx(ground.height_at(x))
    middle = pose.feet.mean(axis=0)
    assert pose.com[0] == pytest.approx(middle[0])
    away = (pose.com[1] - middle[1]) * np.cos(np.radians(degrees))
    assert away == pytest.approx(standing_pose(P).com[1])


@pytest.mark.parametrize("slope", [-0.2, -0.05, 0.003, 0.07, 0.2])
def test_two_feet_that_stand_tell_the_slope(slope):
    estimate = SlopeEstimate(1.0)
    estimate.begin((0.3, 0.3 * np.tan(slope)))
    estimate.stand((0.0, 0.0), (0.3, 0.3 * np.tan(slope)))
    believed = 0.0 if abs(slope) < 0.004 else np.clip(slope, -0.12, 0.12)
    assert estimate.slope == pytest.approx(believed)
    if 0.004 < abs(slope) < 0.12:
        estimate.land((0.9, 0.9 * np.tan(slope)), (0.3, 0.3 * np.tan(slope)))
        assert estimate.slope == pytest.approx(believed)


# Whole degrees, of 30 steps each: what lies beyond fell, or is refused to be safe.
STEEPEST = {
    "five-link": (-6, 4),
    "runner": (-6, 4),
    "human": (-4, 3),
    "bolt": (-4, 4),
    "rabbit": (0, 0),
}
ENDS = [(robot, degrees) for robot, ends in STEEPEST.items() for degrees in sorted(set(ends))]


@pytest.mark.parametrize(
    ("robot", "degrees"),
    [
        *((robot, down - 1) for robot, (down, _) in STEEPEST.items()),
        *((robot, up + 1) for robot, (_, up) in STEEPEST.items()),
        ("five-link", -10),
        ("five-link", 8),
    ],
)
def test_a_stand_on_ground_too_steep_for_the_robot_is_refused(robot, degrees):
    with pytest.raises(ParameterError, match=f"stands on ground of {degrees:.1f} degrees"):
        walked(tc.PlantOptions, degrees, robot=robot)


def test_a_urdf_of_ones_own_starts_where_its_like_does(tmp_path):
    five = tc.load_robot("five-link")
    own = tmp_path / "own.urdf"
    own.write_text(five.urdf)
    assert startable_slopes(tc.load_robot(own)) == startable_slopes(five)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("robot", "degrees"), ENDS)
def test_a_walk_starts_on_the_steepest_ground_of_its_robot(robot, degrees):
    check(walked(tc.PlantOptions, degrees, steps=16, robot=robot), degrees)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("plant", "degrees"), [(tc.MujocoOptions, -2.0), (tc.IdealOptions, 3.0)])
def test_a_walk_starts_from_a_stand_on_a_slope(plant, degrees):
    check(walked(plant, degrees), degrees)


def check(record, degrees):
    """Stood on the ground, and walks on its gait in the end."""
    assert not record.fell, record.fall_reason
    assert abs(record.section_state[-1, 0] - record.section_target[-1, 0]) < 0.1
    on_ground = record.foot[0, :, 1] - [sloping(degrees).height_at(x) for x in record.foot[0, :, 0]]
    np.testing.assert_allclose(on_ground, 0.0, atol=1e-4)
