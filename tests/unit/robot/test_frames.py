"""Frames of links and zeros of angles are words: the robot is the same whatever they are."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from other_frames import rewritten

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.errors import RobotError
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.plant.mujoco import MujocoOptions, MujocoPlant
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import robot_path
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import Pose, floating_state_in, state_at_vlo
from template_control.robot.template import default_gait, template_for
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate

BASE = ("base_x", "base_z", "base_pitch")
SAME = 1e-9
SEEDS = range(12)
PLANAR = ("five-link", "human", "rabbit", "runner")
PLANTS = {
    "ideal": (IdealPlant, IdealOptions()),
    "pybullet": (BulletPlant, PlantOptions()),
    "mujoco": (MujocoPlant, MujocoOptions()),
}
FREE_PLANTS = {name: PLANTS[name] for name in ("pybullet", "mujoco")}


class Words:
    """A robot in its own words and in others, and the map between their coordinates."""

    def __init__(self, kind, path, seed, folder, **drawn):
        self.own = kind.from_urdf(path)
        words = rewritten(path.read_text(), seed, **drawn)
        file = folder / "other.urdf"
        file.write_text(words.text)
        self.other = kind.from_urdf(file)
        names = self.own.joint_names
        assert self.other.joint_names == names
        self.zero = np.array([words.zero[name] for name in names])
        self.sign = np.array([words.sign[name] for name in names])
        # From the other velocity to the own one.
        self.turn = np.diag([*np.ones(self.own.base_dof), *self.sign])

    def q(self, own):
        """The other configuration."""
        q = own.copy()
        q[..., -len(self.zero) :] = self.sign * (q[..., -len(self.zero) :] - self.zero)
        return q

    def v(self, own):
        """The other velocity."""
        return own @ self.turn


def assert_same_model(words, rng):
    own, other = words.own, words.other
    assert other.leg_length == pytest.approx(own.leg_length, abs=SAME)
    assert other.trunk_com == pytest.approx(own.trunk_com, abs=SAME)
    assert other.leg_mass == pytest.approx(own.leg_mass, abs=SAME)
    np.testing.assert_allclose(other.neutral(), words.q(own.neutral()), atol=SAME)
    mine, theirs = template_for(own), template_for(other)
    assert theirs.rest_length == pytest.approx(mine.rest_length, abs=SAME)
    assert theirs.leg_stiffness == pytest.approx(mine.leg_stiffness, rel=SAME)
    for _ in range(3):
        q = own.moved(own.neutral(), rng.uniform(-0.5, 0.5, own.nv))
        v = rng.uniform(-1.0, 1.0, own.nv)
        own.update(q, v)
        other.update(words.q(q), words.v(v))
        turn = words.turn
        np.testing.assert_allclose(turn @ other.mass_matrix @ turn, own.mass_matrix, atol=SAME)
        for name in ("nonlinear_effects", "com_jacobian", "contact_jacobian"):
            np.testing.assert_allclose(
                getattr(other, name) @ turn, getattr(own, name), atol=SAME * own.mass, err_msg=name
            )
        for name in ("com", "com_bias", "foot_position", "foot_velocity", "contact_bias"):
            np.testing.assert_allclose(
                getattr(other, name), getattr(own, name), atol=SAME, err_msg=name
            )
        assert other.hip_height(words.q(q)) == pytest.approx(own.hip_height(q), abs=SAME)
        np.testing.assert_allclose(other.hips, own.hips)
        assert other.hip_speed == pytest.approx(own.hip_speed, abs=SAME)


def assert_same_fall(words, plant, options, q, v):
    """From the air to the ground and on, with torques."""
    torques = np.random.default_rng(5).uniform(-5.0, 5.0, (150, len(words.zero)))
    ends = []
    for robot, place in (
        (words.own, (q, v)),
        (words.other, (words.q(q), words.v(v))),
    ):
        sign = np.ones_like(words.sign) if robot is words.own else words.sign
        with plant(robot, options) as world:
            world.reset(*place)
            for torque in torques:
                world.step(sign * torque)
            end_q, end_v = np.empty(robot.nq), np.empty(robot.nv)
            world.read(end_q, end_v)
            ends.append((end_q, end_v))
    (own_q, own_v), (other_q, other_v) = ends
    assert np.abs(own_v).max() > 0.1
    np.testing.assert_allclose(other_q, words.q(own_q), atol=SAME)
    np.testing.assert_allclose(other_v, words.v(own_v), atol=100 * SAME)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_planar_robot_in_other_words_is_the_same(seed, tmp_path):
    path = robot_path(PLANAR[seed % len(PLANAR)])
    words = Words(PlanarBiped, path, seed, tmp_path, keep=BASE)
    assert_same_model(words, np.random.default_rng(seed))
    gait = default_gait(words.own)
    start = gait.vlo, seed % 2, np.array([0.05, 0.03]), np.array([2.0, 0.1]), 0.05
    (q, v), (other_q, other_v) = (state_at_vlo(robot, *start) for robot in (words.own, words.other))
    np.testing.assert_allclose(other_q, words.q(q), atol=SAME)
    np.testing.assert_allclose(other_v, words.v(v), atol=SAME)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_free_robot_in_other_words_is_the_same(seed, tmp_path):
    words = Words(FloatingBaseBiped, robot_path("five-link-3d"), seed, tmp_path)
    assert_same_model(words, np.random.default_rng(seed))
    pose = Pose(
        com=np.array([0.0, 0.05, 0.97]),
        com_velocity=np.array([1.0, 0.1, 0.0]),
        feet=np.array([[0.0, -0.1, 0.0], [0.1, 0.1, 0.04]]),
        feet_velocity=np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.1]]),
        rear=1,
        pitch=0.05,
        momentum_speed=True,
    )
    (q, v), (other_q, other_v) = (floating_state_in(r, pose) for r in (words.own, words.other))
    np.testing.assert_allclose(other_q, words.q(q), atol=SAME)
    np.testing.assert_allclose(other_v, words.v(v), atol=SAME)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("seed", range(3))
def test_a_planar_robot_in_other_words_falls_as_it_does(plant, seed, tmp_path):
    words = Words(PlanarBiped, robot_path("five-link"), seed, tmp_path, keep=BASE)
    q = np.array([0.0, 0.85, 0.1, -0.5, 0.6, -0.2, 0.9])
    assert_same_fall(words, *PLANTS[plant], q, np.linspace(-0.5, 0.5, 7))


@pytest.mark.parametrize("plant", FREE_PLANTS)
@pytest.mark.parametrize("seed", range(3))
def test_a_free_robot_in_other_words_falls_as_it_does(plant, seed, tmp_path):
    words = Words(FloatingBaseBiped, robot_path("five-link-3d"), seed, tmp_path)
    q = words.own.neutral()
    # At a stop PyBullet's iterations depend on which end of a range comes first.
    q[2], q[7:] = 0.93, (0.1, -0.3, 0.6, -0.1, -0.2, 0.4)
    assert_same_fall(words, *FREE_PLANTS[plant], q, np.linspace(-0.1, 0.1, 12))


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("plant", ["ideal", "pybullet"])
@pytest.mark.parametrize("seed", range(2))
def test_a_planar_robot_in_other_words_walks_the_same_steps(plant, seed, tmp_path):
    words = Words(PlanarBiped, robot_path("five-link"), seed, tmp_path, keep=BASE)
    own, other = (
        simulate(
            Experiment(
                robot, planner=LqrPlanner(default_gait(robot)), steps=1, world=PLANTS[plant][1]
            )
        )
        for robot in (words.own, words.other)
    )
    assert not own.fell
    assert not other.fell
    np.testing.assert_allclose(other.section_time, own.section_time, atol=SAME)
    # The controller rounds its torques to 2^-24 of their limits in every tick.
    np.testing.assert_allclose(other.section_state, own.section_state, atol=5 * SAME)
    np.testing.assert_allclose(other.section_controls, own.section_controls, rtol=1e-6)


def test_legs_that_point_up_or_fold_with_all_angles_at_zero_hang_down(tmp_path):
    text = robot_path("five-link").read_text()
    own = PlanarBiped.from_urdf(robot_path("five-link"))
    for hip, knee in ((np.pi, 0.0), (0.0, np.pi), (1.0, -2.0)):
        robot = ET.fromstring(text)
        for joint in robot.findall("joint"):
            zero = {"hip": hip, "knee": knee}.get(joint.get("name").partition("_")[2])
            if zero is not None:
                joint.find("origin").set("rpy", f"0 {zero!r} 0")
                joint.find("limit").attrib.update(lower=repr(-2.5 - zero), upper=repr(2.5 - zero))
        path = tmp_path / "other.urdf"
        path.write_text(ET.tostring(robot, encoding="unicode"))
        other = PlanarBiped.from_urdf(path)
        angles = np.tile((-hip, -knee), 2)
        np.testing.assert_allclose(other.neutral()[3:], angles, atol=SAME)
        assert template_for(other).rest_length == pytest.approx(template_for(own).rest_length)
        q, _ = state_at_vlo(
            other, np.array([1.1, 0.97, 0.0]), 0, np.array([0.05, 0.03]), np.array([2.0, 0.1])
        )
        assert np.all(q[[4, 6]] + knee > 0.0)  # knees ahead, as nothing says otherwise


def test_a_knee_that_bends_backward_alone_is_found(tmp_path):
    text = (
        robot_path("five-link")
        .read_text()
        .replace('lower="0" upper="2.5"', 'lower="-2.5" upper="0.6"')
    )
    path = tmp_path / "bird.urdf"
    path.write_text(text)
    robot = PlanarBiped.from_urdf(path)
    q, _ = state_at_vlo(
        robot, np.array([1.1, 0.97, 0.0]), 0, np.array([0.05, 0.03]), np.array([2.0, 0.1])
    )
    assert np.all(q[[4, 6]] < 0.0)


def test_a_start_that_is_out_of_reach_says_what_was_tried():
    robot = PlanarBiped.from_urdf(robot_path("five-link"))
    with pytest.raises(RobotError, match=r"knees bent forward or backward .* left_knee = 0"):
        state_at_vlo(robot, np.array([1.1, 1.4, 0.0]), 0, np.zeros(2), np.zeros(2))


@pytest.mark.parametrize(
    ("slide", "origin", "message"),
    [
        ("base_x", '<origin rpy="0 0 3.14159265"/>', "is not planar: its first joints are"),
        ("base_z", '<origin xyz="0 0 1"/>', "give the base's joints no offset"),
    ],
)
def test_a_base_that_slides_another_way_is_refused(slide, origin, message, tmp_path):
    path = tmp_path / "base.urdf"
    joint = f'<joint name="{slide}" type="prismatic">'
    path.write_text(robot_path("five-link").read_text().replace(joint, joint + origin))
    with pytest.raises(RobotError, match=message):
        PlanarBiped.from_urdf(path)


def test_a_sphere_elsewhere_in_its_link_is_the_foot(tmp_path):
    text = robot_path("five-link").read_text()
    own = PlanarBiped.from_urdf(robot_path("five-link"))
    sphere = '<collision>\n      <geometry><sphere radius="0.01"/>'
    lower = sphere.replace("<geometry>", '<origin xyz="0 0 -0.05"/><geometry>')
    path = tmp_path / "lower.urdf"
    path.write_text(text.replace(sphere, lower))
    robot = PlanarBiped.from_urdf(path)
    assert robot.leg_length == pytest.approx(own.leg_length + 0.05)
    # It stands on its stance foot in every engine, and sinks as in the ideal one.
    z, swing = np.array([0.0, 1.0, 0.0]), np.array([0.2, 0.1])
    q, v = state_at_vlo(robot, z, 0, swing, np.zeros(2))
    forces = {}
    for name, (plant, options) in PLANTS.items():
        with plant(robot, options) as world:
            world.reset(q, v)
            force = forces[name] = np.empty((2, 2))
            for _ in range(15):
                world.step(np.zeros(4))
                world.contact_forces(force)
    assert forces["ideal"][0, 1] > 10.0
    for force in forces.values():
        np.testing.assert_allclose(force, forces["ideal"], atol=1.0)
