"""Template legs as groups of contacts: single ones are feet, of several the foot is their mean."""

import numpy as np
import pytest

from template_control.errors import RobotError
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import load_floating_robot, load_robot, robot_path

FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


@pytest.fixture(scope="module")
def go2():
    return load_floating_robot("go2")


def moved(robot, seed):
    """Update a robot to a random state near the upright."""
    rng = np.random.default_rng(seed)
    robot.update(
        robot.moved(robot.bent(), rng.normal(0.0, 0.2, robot.nv)), rng.normal(size=robot.nv)
    )


@pytest.mark.parametrize(
    "robot",
    [load_robot("five-link"), load_floating_robot("bolt"), load_floating_robot("five-link-3d")],
    ids=lambda robot: type(robot).__name__ + robot.name,
)
def test_a_contact_by_itself_is_the_foot_to_the_last_bit(robot):
    moved(robot, 1)
    sagittal = slice(None, None, robot.directions - 1)
    assert robot.groups == ((0,), (1,))
    np.testing.assert_array_equal(robot.foot_position, robot.contact_position[:, sagittal])
    np.testing.assert_array_equal(robot.foot_velocity, robot.contact_velocity[:, sagittal])
    assert np.shares_memory(robot.foot_jacobian, robot.contact_jacobian)
    assert np.shares_memory(robot.foot_bias, robot.contact_bias)
    assert not robot.spread.any()


def test_a_quadruped_s_foot_is_the_mean_of_a_diagonal_pair(go2):
    moved(go2, 2)
    assert go2.feet == FEET
    assert go2.groups == ((0, 3), (1, 2))
    for leg, (one, other) in enumerate(go2.groups):
        mean = 0.5 * (go2.contact_position[one] + go2.contact_position[other])
        np.testing.assert_allclose(go2.space.foot_position[leg], mean, atol=1e-15)
        np.testing.assert_allclose(go2.foot_position[leg], mean[[0, 2]], atol=1e-15)
    moving = (
        go2.foot_jacobian
        @ np.linalg.lstsq(
            go2.contact_jacobian.reshape(12, -1), go2.contact_velocity.ravel(), rcond=None
        )[0]
    )
    np.testing.assert_allclose(moving, go2.foot_velocity, atol=1e-12)


def test_the_contacts_are_spread_as_the_hips_are(go2):
    # Hips 0.1934 m ahead of the trunk's middle, thighs 0.0465 + 0.0955 m aside, in the URDF.
    corners = 0.1934 * np.array([1, 1, -1, -1]), 0.142 * np.array([1, -1, 1, -1])
    np.testing.assert_allclose(go2.spread, np.transpose(corners), atol=1e-12)


def test_the_knee_s_range_limits_the_leg(go2):
    # 0.213 m each; the calf's range ends at -0.83776 rad, so the leg is never straight.
    assert go2.leg_length == pytest.approx(2.0 * 0.213 * np.cos(0.5 * 0.83776))
    assert load_robot("five-link").leg_length == pytest.approx(0.9)


def test_limits_are_those_of_the_urdf(go2):
    np.testing.assert_allclose(go2.torque_limit, 4 * [23.7, 23.7, 45.43])
    assert go2.mass == pytest.approx(16.085, abs=1e-3)


def test_the_order_of_the_feet_does_not_matter():
    feet = ("RR_foot", "FR_foot", "FL_foot", "RL_foot")
    robot = FloatingBaseBiped.from_urdf(robot_path("go2"), feet, 0.022)
    assert robot.groups == ((0, 2), (1, 3))


def test_other_groups_are_given():
    robot = FloatingBaseBiped.from_urdf(robot_path("go2"), FEET, 0.022, groups=((0, 2), (1, 3)))
    assert robot.groups == ((0, 2), (1, 3))
    moved(robot, 3)
    left = robot.contact_position[[0, 2]].mean(axis=0)
    np.testing.assert_allclose(robot.space.foot_position[0], left, atol=1e-15)


@pytest.mark.parametrize(
    ("feet", "groups", "message"),
    [
        (FEET[:3], None, "3 feet were named .* a biped has two, a quadruped four"),
        ((*FEET[:3], "FL_foot"), None, "hang on the same leg"),
        (FEET, ((0, 1), (2,)), "give two of as many feet"),
        (FEET, ((0, 1), (1, 2)), "each foot once"),
    ],
)
def test_what_is_no_quadruped_is_refused(feet, groups, message):
    with pytest.raises(RobotError, match=message):
        FloatingBaseBiped.from_urdf(robot_path("go2"), feet, 0.022, groups=groups)


def test_a_quadruped_is_no_planar_biped():
    with pytest.raises(
        RobotError, match="'go2' has no planar model: load it with load_floating_robot"
    ):
        load_robot("go2")
