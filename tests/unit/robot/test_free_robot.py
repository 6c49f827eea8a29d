"""The free biped's model: agreement with PyBullet, its terms, its heading frame, its start."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from template_control.errors import ParameterError, RobotError
from template_control.plant.bullet import BulletPlant, PlantOptions, pybullet
from template_control.plant.mujoco import MujocoOptions, MujocoPlant
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import FLOATING_ROBOTS, load_floating_robot, robot_path
from template_control.robot.start import Pose, floating_state_in
from template_control.robot.urdf_edits import JointLimits


@pytest.fixture(scope="module")
def bolt():
    return load_floating_robot("bolt")


@pytest.fixture(scope="module", params=FLOATING_ROBOTS)
def free_robot(request):
    return load_floating_robot(request.param)


def states(robot, count=10):
    """Random configurations high above the ground, away from the joints' stops; velocities."""
    rng = np.random.default_rng(5)
    low, high = np.clip(robot.joint_range, -1.0, 1.0).T
    low, high = np.r_[-np.ones(3), low + 0.01], np.r_[np.ones(3), high - 0.01]
    for _ in range(count):
        step = np.concatenate(([0.0, 0.0, 5.0], rng.uniform(low, high)))
        yield pin.integrate(robot.model, robot.neutral(), step), rng.uniform(-2.0, 2.0, robot.nv)


def integrated(plant):
    """(3,) the point of the trunk whose velocity the engine integrates, in its frame [m]."""
    if isinstance(plant, MujocoPlant):
        return np.zeros(3)
    told = pybullet().getDynamicsInfo(plant.body, -1, physicsClientId=plant.client)
    return np.array(told[3])


def of_world(q, v, point):
    """Velocity of a point of the trunk and angular velocity in the world's axes; the joints'."""
    rotation = pin.Quaternion(q[3:7]).matrix()
    linear = rotation @ (v[:3] + np.cross(v[3:6], point))
    return np.concatenate((linear, rotation @ v[3:6], v[6:]))


def plant_acceleration(robot, plant, q, v, torque):
    """By one step of the plant, in the world's axes: its integration is semi-implicit."""
    after_q, after_v, point = np.zeros(robot.nq), np.zeros(robot.nv), integrated(plant)
    plant.reset(q, v)
    plant.step(torque)
    plant.read(after_q, after_v)
    return (of_world(after_q, after_v, point) - of_world(q, v, point)) / plant.time_step


def model_acceleration(robot, q, v, torque, point):
    generalised = np.concatenate((np.zeros(6), torque))
    a = pin.aba(robot.model, robot.model.createData(), q, v, generalised)
    rotation, spin = pin.Quaternion(q[3:7]).matrix(), v[3:6]
    away = np.cross(a[3:6], point) + np.cross(spin, np.cross(spin, point))
    linear = rotation @ (a[:3] + np.cross(spin, v[:3]) + away)
    return np.concatenate((linear, rotation @ a[3:6], a[6:]))


PLANTS = pytest.mark.parametrize(
    "plant_of",
    [
        lambda robot: BulletPlant(robot, PlantOptions()),
        lambda robot: MujocoPlant(robot, MujocoOptions()),
    ],
    ids=("pybullet", "mujoco"),
)


@PLANTS
def test_forward_dynamics_agree_with_the_plants(free_robot, plant_of):
    """Of torques, of gravity and of velocity."""
    rng = np.random.default_rng(6)
    with plant_of(free_robot) as plant:
        for q, v in states(free_robot):
            torque = rng.uniform(-0.5, 0.5, free_robot.nv - 6)
            found = plant_acceleration(free_robot, plant, q, v, torque)
            expected = model_acceleration(free_robot, q, v, torque, integrated(plant))
            np.testing.assert_allclose(found, expected, atol=1e-8)


@PLANTS
def test_mass_matrix_and_bias_forces_agree_with_the_plants(free_robot, plant_of):
    """M a + h = S' tau with the plant's accelerations; the torques' columns show M."""
    with plant_of(free_robot) as plant:
        for q, v in states(free_robot, 3):
            free_robot.update(q, v)
            rotation = pin.Quaternion(q[3:7]).matrix()
            joints = free_robot.nv - 6
            for torque in (np.zeros(joints), *(0.1 * np.eye(joints))):
                world = plant_acceleration(free_robot, plant, q, v, torque)
                spin, turning, point = v[3:6], rotation.T @ world[3:6], integrated(plant)
                away = np.cross(turning, point) + np.cross(spin, np.cross(spin, point))
                own = rotation.T @ world[:3] - np.cross(spin, v[:3]) - away
                a = np.concatenate((own, turning, world[6:]))
                left = free_robot.mass_matrix @ a + free_robot.nonlinear_effects
                np.testing.assert_allclose(left, [*np.zeros(6), *torque], atol=1e-8)


@PLANTS
def test_the_plant_reads_the_state_it_was_given(bolt, plant_of):
    q, v = np.zeros(bolt.nq), np.zeros(bolt.nv)
    with plant_of(bolt) as plant:
        for wanted_q, wanted_v in states(bolt, 5):
            q[3:7] = wanted_q[3:7]
            plant.reset(wanted_q, wanted_v)
            plant.read(q, v)
            np.testing.assert_allclose(q, wanted_q, atol=1e-12)
            np.testing.assert_allclose(v, wanted_v, atol=1e-12)


def test_terms_match_finite_differences_in_the_heading_frame(free_robot):
    h = 1e-6
    free_robot.face(0.7, np.array([0.3, -0.2]))
    s = free_robot.space
    for q, v in states(free_robot, 5):

        def rate(read, q=q, v=v):
            values = []
            for step in (h, -h):
                free_robot.update(pin.integrate(free_robot.model, q, step * v), v)
                values.append(np.copy(read()))
            return (values[0] - values[1]) / (2.0 * h)

        com = rate(lambda: s.com)
        velocity, momentum = rate(lambda: s.com_velocity), rate(lambda: s.momentum)
        foot, turning = rate(lambda: free_robot.contact_velocity), rate(lambda: s.turning)
        free_robot.update(q, v)
        np.testing.assert_allclose(s.com_velocity, com, atol=1e-7)
        np.testing.assert_allclose(s.com_bias, velocity, atol=1e-6)
        np.testing.assert_allclose(s.momentum_bias, momentum, atol=1e-6)
        np.testing.assert_allclose(free_robot.contact_bias, foot, atol=1e-5)
        np.testing.assert_allclose(turning, 0.0, atol=1e-6)
        np.testing.assert_allclose(free_robot.jacobians.com @ v, s.com_velocity, atol=1e-12)
        np.testing.assert_allclose(free_robot.jacobians.momentum @ v, s.momentum, atol=1e-12)
        np.testing.assert_allclose(free_robot.jacobians.turning @ v, s.turning, atol=1e-12)
        np.testing.assert_allclose(free_robot.com, s.com[[0, 2]])
        assert free_robot.angular_momentum == s.momentum[1]
    free_robot.face(0.0, np.zeros(2))


def test_a_turn_keeps_its_pivot_and_turns_the_rest(bolt):
    q, v = next(states(bolt, 1))
    bolt.face(0.2, np.array([1.0, 2.0]))
    bolt.update(q, v)
    foot, com = bolt.space.foot_position.copy(), bolt.space.com.copy()
    world = bolt.to_world(com)
    bolt.turn(0.3, foot[0, :2])
    bolt.update(q, v)
    np.testing.assert_allclose(bolt.space.foot_position[0], foot[0], atol=1e-12)
    np.testing.assert_allclose(bolt.to_world(bolt.space.com), world, atol=1e-12)
    before, after = com - foot[0], bolt.space.com - foot[0]
    c, s = np.cos(0.3), np.sin(0.3)
    turned = [c * before[0] + s * before[1], c * before[1] - s * before[0], before[2]]
    np.testing.assert_allclose(after, turned, atol=1e-12)
    bolt.face(0.0, np.zeros(2))


def test_roll_pitch_and_yaw_are_those_of_the_heading_frame(bolt):
    for angles in ((0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.3)):
        q = bolt.neutral()
        turn = pin.exp3(np.array([0.0, 0.0, 0.5])) @ pin.exp3(np.array(angles))
        q[3:7] = pin.Quaternion(turn).coeffs()
        bolt.face(0.5, np.zeros(2))
        bolt.update(q, np.zeros(bolt.nv))
        np.testing.assert_allclose(bolt.data["attitude"][0], angles, atol=1e-12)
    bolt.face(0.0, np.zeros(2))


def test_a_start_is_in_the_pose(bolt):
    pose = Pose(
        com=np.array([0.0, 0.01, 0.35]),
        com_velocity=np.array([0.6, -0.1, 0.02]),
        feet=np.array([[0.0, 0.05, 0.0], [0.02, -0.06, 0.02]]),
        feet_velocity=np.array([[0.0, 0.0, 0.0], [1.2, 0.1, 0.0]]),
        rear=1,
        momentum_speed=True,
    )
    q, v = floating_state_in(bolt, pose)
    bolt.update(q, v)
    s = bolt.space
    np.testing.assert_allclose(s.com, pose.com, atol=1e-11)
    np.testing.assert_allclose(s.foot_position[[1, 0]], pose.feet, atol=1e-11)
    np.testing.assert_allclose(bolt.contact_velocity[[1, 0]], pose.feet_velocity, atol=1e-11)
    np.testing.assert_allclose(s.turning, 0.0, atol=1e-11)
    weight = bolt.mass * 0.35
    about = s.com_velocity + [s.momentum[1] / weight, -s.momentum[0] / weight, 0.0]
    np.testing.assert_allclose(about, pose.com_velocity, atol=1e-11)
    with pytest.raises(RobotError, match="do not reach"):
        floating_state_in(bolt, replace(pose, com=np.array([0.0, 0.0, 0.8])))
    with pytest.raises(ParameterError, match="give 3 each"):
        floating_state_in(bolt, replace(pose, com=np.array([0.0, 0.3])))


def test_the_limits_are_those_of_the_actuators(bolt):
    np.testing.assert_allclose(bolt.joint_range[:, 1], 2 * [1.0, 1.9, 3.4])
    np.testing.assert_allclose(bolt.joint_range[:, 0], -bolt.joint_range[:, 1])
    np.testing.assert_allclose(bolt.torque_limit, 2.7)
    np.testing.assert_allclose(bolt.velocity_limit, 83.8, atol=0.05)
    assert bolt.legs == ((0, 1, 2), (3, 4, 5))


@pytest.mark.parametrize(
    ("feet", "message"),
    [
        (("FL_FOOT", "nowhere"), "no foot link 'nowhere'"),
        (("FL_FOOT", "FL_FOOT"), "the same leg"),
        (("FL_FOOT",), "1 feet were named"),
    ],
)
def test_what_is_no_free_biped_is_refused(feet, message):
    with pytest.raises(RobotError, match=message):
        FloatingBaseBiped.from_urdf(robot_path("bolt"), feet, 0.016)


def test_ranges_are_given_for_every_joint_of_a_leg():
    limits = JointLimits(torque=2.0, velocity=80.0, ranges=((-1.0, 1.0), (-2.0, 2.0)))
    with pytest.raises(RobotError, match="3 joints move foot 'FL_FOOT', and 2 ranges"):
        FloatingBaseBiped.from_urdf(
            robot_path("bolt"), ("FL_FOOT", "FR_FOOT"), 0.016, limits=limits
        )


def test_a_planar_robot_is_not_free():
    with pytest.raises(RobotError, match="'five-link' has no model with a floating base"):
        load_floating_robot("five-link")
    with pytest.raises(RobotError, match="the same leg"):
        FloatingBaseBiped.from_urdf(robot_path("five-link"))


@pytest.mark.parametrize("length", [1.0 + 5e-4, 1.0 - 5e-4])
def test_a_quaternion_with_few_digits_is_made_as_long_as_1(bolt, length):
    rng = np.random.default_rng(3)
    q = bolt.moved(bolt.neutral(), rng.uniform(-0.3, 0.3, bolt.nv))
    v = rng.uniform(-1.0, 1.0, bolt.nv)
    bolt.update(q, v)
    names = ("mass_matrix", "nonlinear_effects", "com", "contact_jacobian", "foot_position")
    own = {name: np.array(getattr(bolt, name)) for name in names}
    longer = q.copy()
    longer[3:7] *= length
    bolt.update(longer, v)
    for name, value in own.items():
        np.testing.assert_allclose(getattr(bolt, name), value, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("length", [0.0, 0.5, 0.998, 1.002, 3.0])
def test_another_length_of_a_quaternion_is_refused(bolt, length):
    q = bolt.neutral()
    q[3:7] *= length
    with pytest.raises(ParameterError, match="give x, y, z, w of length 1"):
        bolt.update(q, np.zeros(bolt.nv))
