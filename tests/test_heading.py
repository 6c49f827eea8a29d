"""The frame in which a robot walks straight on."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.slip import Heading

ANGLES = st.floats(-4.0, 4.0)
PLACES = st.tuples(*[st.floats(-5.0, 5.0)] * 2).map(np.array)


@settings(deadline=None, max_examples=50)
@given(ANGLES, PLACES, PLACES, ANGLES)
def test_there_and_back(angle, pivot, point, by):
    heading = Heading(angle, (1.0, -2.0)).turned(by, pivot)
    np.testing.assert_allclose(heading.world_position(heading.position(point)), point, atol=1e-12)
    np.testing.assert_allclose(heading.world_vector(heading.vector(point)), point, atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(ANGLES, PLACES, ANGLES)
def test_what_it_turns_about_keeps_its_place(angle, pivot, by):
    before = Heading(angle, (0.3, 0.1), (2.0, -1.0))
    after = before.turned(by, pivot)
    np.testing.assert_allclose(after.position(pivot), before.position(pivot), atol=1e-12)
    assert after.angle == before.angle + by


def test_velocities_are_derivatives_of_positions():
    heading = Heading(0.7, (1.0, 2.0), (3.0, 0.0))
    start, velocity = np.array([0.2, -0.4, 0.9]), np.array([0.5, 0.1, -0.2])
    there = heading.position(start + velocity) - heading.position(start)
    np.testing.assert_allclose(there, heading.vector(velocity), atol=1e-14)


def test_after_a_turn_to_the_left_the_old_way_points_to_the_right():
    turned = Heading().turned(np.pi / 2, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(turned.vector(np.array([1.0, 0.0, 3.0])), [0, -1, 3], atol=1e-15)
    np.testing.assert_allclose(turned.position(np.array([1.0, 2.0, 5.0])), [3, 0, 5], atol=1e-15)


def test_rows_are_turned_one_by_one():
    heading = Heading(0.4, (1.0, 0.0), (0.0, 1.0))
    rows = np.arange(6.0).reshape(2, 3)
    np.testing.assert_allclose(heading.position(rows), [heading.position(r) for r in rows])


def test_yaw_is_told_from_the_heading_in_half_turns():
    assert np.isclose(Heading(0.3).yaw(0.5), 0.2)
    assert np.isclose(Heading(6.3 * np.pi).yaw(0.5 * np.pi), 0.2 * np.pi)
