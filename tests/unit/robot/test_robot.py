"""The robots' models: physics, agreement with PyBullet, and what is refused."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import template_control as tc
from template_control.errors import ParameterError, RobotError
from template_control.plant.bullet import BulletPlant, PlantOptions, pybullet
from template_control.robot.library import (
    ROBOTS,
    SHIPPED,
    load_floating_robot,
    load_robot,
    robot_path,
)
from template_control.robot.planar_biped import PlanarBiped


@pytest.mark.slow(seconds=1)
def test_robots_are_listed_and_called_by_the_names_that_load_them():
    listed = tc.robots()
    assert list(listed) == list(SHIPPED)
    assert "Unitree's humanoid" in listed["g1"]
    assert all(robot_path(name).is_file() for name in listed)
    for robot, name in ((load_robot("human"), "human"), (load_floating_robot("go2"), "go2")):
        assert robot.name == robot.changed(gravity=1.62).name == name
    assert load_robot("human").changed(masses={"trunk": 40.0}).name == "human"


@pytest.fixture(params=ROBOTS)
def any_robot(request):
    return load_robot(request.param)


def test_masses_and_limits_are_those_of_the_readme(robot):
    assert robot.mass == pytest.approx(80.0)
    assert robot.nv == 7
    np.testing.assert_array_equal(robot.torque_limit, 350.0)
    assert robot.legs == ((0, 1), (2, 3))
    assert robot.foot_radius == 0.01


def test_inertias_are_physically_valid(any_robot):
    for inertia in any_robot.model.inertias:
        if inertia.mass == 0.0:
            continue
        principal = np.linalg.eigvalsh(inertia.inertia)
        assert np.all(principal > 0.0)
        assert principal.sum() - 2 * principal.max() >= 0.0, "triangle inequality"


def differentiate(robot, read, q, v, h=1e-6):
    """Central difference along v of what ``read`` returns after an update at velocity v."""
    robot.update(q + h * v, v)
    ahead = np.copy(read())
    robot.update(q - h * v, v)
    return (ahead - np.copy(read())) / (2 * h)


def test_jacobians_and_biases_match_finite_differences(any_robot, random_states):
    for q, v in random_states:
        com_bias = differentiate(any_robot, lambda: any_robot.com_velocity, q, v)
        momentum_rate = differentiate(any_robot, lambda: any_robot.angular_momentum, q, v)
        com_velocity = differentiate(any_robot, lambda: any_robot.com, q, v)
        any_robot.update(q, v)
        np.testing.assert_allclose(any_robot.com_velocity, com_velocity, atol=1e-7)
        np.testing.assert_allclose(any_robot.com_jacobian @ v, any_robot.com_velocity, atol=1e-12)
        np.testing.assert_allclose(any_robot.com_bias, com_bias, atol=1e-6)
        assert any_robot.angular_momentum_bias == pytest.approx(momentum_rate, abs=1e-6)
        momentum = any_robot.angular_momentum_jacobian @ v
        assert momentum == pytest.approx(any_robot.angular_momentum, abs=1e-12)


def momentum_row(robot, height):
    """Row and bias of s = dx/dt + L / (m y): the rate of s at acceleration a is row @ a + bias.

    y is ``height``, of the CoM over ground at rest [m].
    """
    weight = robot.mass * height
    row = robot.com_jacobian[0] + robot.angular_momentum_jacobian / weight
    sinking = robot.angular_momentum * robot.com_velocity[1] / height
    return row, robot.com_bias[0] + (robot.angular_momentum_bias - sinking) / weight


@pytest.mark.parametrize("ground", [0.0, -0.03])
def test_momentum_row_and_bias_match_finite_differences(any_robot, random_states, ground):
    """The momentum about the foot over m y, along short motions with an acceleration."""
    rng, h = np.random.default_rng(11), 1e-6

    def speed(q, v):
        any_robot.update(q, v)
        height = any_robot.com[1] - ground
        about_com = any_robot.angular_momentum / (any_robot.mass * height)
        return any_robot.com_velocity[0] + about_com

    for q, v in random_states:
        a = rng.normal(0.0, 20.0, any_robot.nv)
        ahead, behind = (speed(q + t * v + 0.5 * t**2 * a, v + t * a) for t in (h, -h))
        now = speed(q, v)
        row, bias = momentum_row(any_robot, any_robot.com[1] - ground)
        assert row @ v == pytest.approx(now, abs=1e-12)
        assert row @ a + bias == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-6, abs=1e-5)


def test_foot_rows_are_those_of_a_rolling_sphere(any_robot, random_states):
    for q, v in random_states:
        foot = differentiate(any_robot, lambda: any_robot.foot_velocity, q, v)
        lowest = differentiate(any_robot, lambda: any_robot.foot_position, q, v)
        any_robot.update(q, v)
        np.testing.assert_allclose(any_robot.foot_bias, foot, atol=1e-5)
        for i, leg in enumerate(any_robot.legs):
            pitch_rate = v[2] + sum(v[3 + j] for j in leg)
            rolling = lowest[i] - [any_robot.foot_radius * pitch_rate, 0.0]
            np.testing.assert_allclose(any_robot.foot_velocity[i], rolling, atol=1e-7)


def test_mass_matrix_and_bias_forces_agree_with_pybullet(any_robot, random_states):
    with BulletPlant(any_robot, PlantOptions()) as plant:
        client, body, joints = plant.client, plant.body, plant.joints
        order = np.argsort(joints)  # PyBullet speaks the file's order
        for q, v in random_states:
            any_robot.update(q, v)
            file_q, file_v = q[order].tolist(), v[order].tolist()
            mass = pybullet().calculateMassMatrix(body, file_q, physicsClientId=client)
            bias = pybullet().calculateInverseDynamics(
                body, file_q, file_v, [0.0] * 7, physicsClientId=client
            )
            np.testing.assert_allclose(
                np.array(mass), any_robot.mass_matrix[np.ix_(order, order)], atol=1e-8
            )
            np.testing.assert_allclose(bias, any_robot.nonlinear_effects[order], atol=1e-8)


FLIGHT_Q = np.array([0.0, 3.0, 0.1, -0.5, 0.8, 0.2, 0.9])
FLIGHT_V = np.array([1.0, 2.0, 0.5, -1.0, 1.5, 1.0, -1.2])


def fly(robot, dt, duration=0.2):
    """Final (q, v) in PyBullet and by semi-implicit Euler on Pinocchio's ABA, no torques."""
    model, data = robot.model, robot.model.createData()
    torque, q, v = np.zeros(4), np.zeros(7), np.zeros(7)
    euler_q, euler_v = FLIGHT_Q.copy(), FLIGHT_V.copy()
    with BulletPlant(robot, PlantOptions(time_step=dt)) as plant:
        plant.reset(FLIGHT_Q, FLIGHT_V)
        for _ in range(round(duration / dt)):
            plant.step(torque)
            euler_v += dt * pin.aba(model, data, euler_q, euler_v, np.zeros(7))
            euler_q += dt * euler_v
        plant.read(q, v)
    return (q, v), (euler_q, euler_v)


def test_plant_is_the_model_in_free_flight(robot):
    bullet, euler = fly(robot, 1e-4)
    np.testing.assert_allclose(bullet, euler, atol=1e-10)


def invariants(robot, q, v):
    """Horizontal and angular momentum over mass, and mechanical energy over mass."""
    data = robot.model.createData()
    robot.update(q, v)
    energy = pin.computeMechanicalEnergy(robot.model, data, q, v)
    return np.array([robot.com_velocity[0], robot.angular_momentum / 80.0, energy / 80.0])


def test_free_flight_conserves_energy_and_momentum(robot):
    start = invariants(robot, FLIGHT_Q, FLIGHT_V)
    drift = [np.abs(invariants(robot, *fly(robot, dt)[0]) - start) for dt in (2e-4, 1e-4)]
    assert np.all(drift[1] < [1e-5, 1e-5, 2e-3])  # m/s, m^2/s, J/kg
    # What is left is the first-order integrator's: it halves with the step.
    np.testing.assert_allclose(drift[0] / drift[1], 2.0, atol=0.1)


def test_update_refuses_nan(robot):
    with pytest.raises(ParameterError, match="not finite"):
        robot.update(np.full(7, np.nan), np.zeros(7))


def edited(tmp_path, *replacements):
    text = robot_path("five-link").read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "edited.urdf"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"base_x" type="prismatic"', '"base_x" type="revolute"', "not planar.*base_x"),
        ('"left_knee" type="revolute"', '"left_knee" type="continuous"', "left_knee"),
        ('effort="350"', 'effort="0"', "effort 0.0"),
        ('velocity="20"', 'velocity="0"', "'left_hip' has velocity 0.0: give the speed"),
        (' velocity="20"', "", "'left_hip': limit has no velocity: give the joint's"),
        ('effort="350" ', "", "'left_hip': limit has no effort: give the joint's"),
        ("left_foot", "left_toe", "no foot link 'left_foot'"),
        ("<robot", "<rowboat", "no URDF"),
    ],
)
def test_unusable_urdf_is_named(tmp_path, old, new, message):
    with pytest.raises(RobotError, match=message):
        PlanarBiped.from_urdf(edited(tmp_path, (old, new)))


def test_missing_urdf_and_unknown_robot_are_named():
    with pytest.raises(RobotError, match=r"no URDF at /nowhere/x\.urdf"):
        load_robot("/nowhere/x.urdf")
    with pytest.raises(RobotError, match=r"no robot 'hexapod'.*five-link"):
        load_robot("hexapod")


def test_one_urdf_serves_both_engines(robot):
    assert Path(robot.path) == robot_path("five-link")
