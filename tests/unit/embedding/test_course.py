"""Where a floating-base robot is to go, and where its trunk is to face."""

from math import pi

import pytest

import template_control as tc
from template_control.embedding.free.motion import Course
from template_control.run.velocity import VelocityCommand, course_at


@pytest.fixture(scope="module")
def go2():
    return tc.load_floating_robot("go2")


@pytest.mark.parametrize(
    ("velocity", "facing"),
    [((0.5, 0.0), 0.0), ((0.0, 0.4), -0.5 * pi), ((-0.4, 0.0), -pi), ((0.3, -0.3), 0.25 * pi)],
)
def test_a_quadruped_goes_along_its_velocity(go2, velocity, facing):
    course = course_at(VelocityCommand(*velocity, 0.1), 0.0, go2)
    assert course == (0.0, 0.1, pytest.approx(facing))


def test_a_planar_robot_goes_forward_or_backward():
    robot = tc.load_robot("five-link")
    back = course_at(VelocityCommand(-0.4), 0.0, robot)
    assert back.turns_round(robot)
    robot.facing = back.facing
    assert not back.turns_round(robot)
    assert course_at(VelocityCommand(0.4), 0.0, robot).turns_round(robot)


def test_at_rest_it_faces_as_it_does(go2):
    course = course_at(VelocityCommand(0.0), 0.0, go2)
    go2.facing = 2.0
    assert course.away(go2) == 0.0
    assert not course.turns_round(go2)


def test_it_turns_the_shorter_way_and_stops_before_it_turns_round(go2):
    go2.facing = -3.0
    assert Course(facing=3.0).away(go2) == pytest.approx(6.0 - 2.0 * pi)
    assert not Course(facing=3.0).turns_round(go2)
    assert Course(facing=0.0).turns_round(go2)


def test_a_biped_places_its_feet_aside():
    bolt = tc.load_floating_robot("bolt")
    course = course_at(VelocityCommand(0.5, 0.05, 0.1), 0.0, bolt)
    assert course == pytest.approx((0.05, 0.1, 0.0))


def test_a_robot_on_soles_goes_backward_and_places_its_feet_to_the_side():
    g1 = tc.load_floating_robot("g1")
    course = course_at(VelocityCommand(-0.5, 0.05, 0.1), 0.0, g1)
    assert course == pytest.approx((-0.05, 0.1, pi))
    assert course.turns_round(g1)
    g1.facing = pi
    assert not course.turns_round(g1)
    assert course_at(VelocityCommand(0.5), 0.0, g1).turns_round(g1)
    assert not course_at(VelocityCommand(0.0), 0.0, g1).turns_round(g1)


def test_the_yaw_is_that_from_where_the_trunk_is_to_face(go2):
    q = go2.neutral()
    go2.facing = 0.4
    go2.face(-0.3, go2.origin.copy())
    go2.update(q, 0.0 * go2.jacobians.turning[0])
    assert tuple(go2.data["attitude"][0]) == pytest.approx((0.0, 0.0, -0.1), abs=1e-12)
