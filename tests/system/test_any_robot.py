"""Robots of all kinds: shipped ones, 3D ones held in their plane, and ones never seen before."""

import json
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

from template_control.cli.main import main
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.running import RunningPlanner
from template_control.errors import RobotError
from template_control.robot.five_link import FiveLink, Link
from template_control.robot.library import ROBOTS, SHIPPED, load_robot, robot_path
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.template import default_gait, paper_gait, template_for
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale

BOLT_FEET = ("FL_FOOT", "FR_FOOT")
BOLT_JOINTS = ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE")


def random_five_link(seed, mass=None, leg=None):
    """A five-link robot of 5 to 120 kg and 0.3 to 1.1 m leg, its proportions varied too."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(5.0, 120.0) if mass is None else mass
    leg = rng.uniform(0.3, 1.1) if leg is None else leg
    thigh, share = leg * rng.uniform(0.45, 0.55), rng.uniform(0.78, 0.86)
    trunk = 0.72 * leg * rng.uniform(0.85, 1.15)
    trunk_mass = share * mass
    thigh_mass = 0.5 * (mass - trunk_mass) * rng.uniform(0.6, 0.73)
    shank_mass = 0.5 * (mass - trunk_mass) - thigh_mass

    def rod(length, mass):
        return Link(length, mass, 0.5 * length, mass * length**2 / 12.0)

    limit = 350.0 * (mass / 80.0) * (leg / 0.9)
    return FiveLink(
        f"unseen-{seed}",
        rod(trunk, trunk_mass),
        rod(thigh, thigh_mass),
        rod(leg - thigh, shank_mass),
        torque_limit=(limit, limit),
        velocity_limit=20.0 * np.sqrt(0.9 / leg),
        hip_width=0.2 * leg,
        foot_radius=0.011 * leg,
    )


def walk(robot, steps):
    gait = default_gait(robot)
    record = simulate(Experiment(robot, planner=LqrPlanner(gait), steps=steps, record_every=5))
    return record, gait


def check(record, gait, steps):
    """Walked as long as wanted and within its limits; after twenty steps it is on its gait."""
    assert not record.fell, record.fall_reason
    assert record.steps == steps
    for torque in record.summary.joint_torque.values():
        assert torque.peak <= torque.limit * (1 + 1e-9)
    assert record.summary.qp_failures == 0
    if steps >= 20:
        scale = Scale.of(gait.parameters)
        error = np.abs(record.section_state[-5:].mean(axis=0) - gait.vlo)
        assert np.all(
            error < np.array([0.03 * scale.speed, 0.01 * scale.length, 0.05 * scale.speed])
        )


# The five-link robot's first steps are those of test_walk.py.
@pytest.mark.parametrize("name", [name for name in ROBOTS if name != "five-link"])
def test_shipped_robots_walk(name):
    record, gait = walk(load_robot(name), 4)
    check(record, gait, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_robots_walk_twenty_steps(name):
    record, gait = walk(load_robot(name), 20)
    check(record, gait, 20)
    if name == "bolt":
        torques = record.summary.joint_torque.values()
        # [N m], of the real robot's motors; the URDF's limits are placeholders.
        assert max(torque.peak for torque in torques) < 2.7


CORNERS = [(1, 5.0, 0.3), (2, 120.0, 0.3), (3, 5.0, 1.1), (4, 120.0, 1.1)]
UNSEEN = [*CORNERS, *((seed, None, None) for seed in range(5, 9))]


def walk_unseen(tmp_path, build, steps):
    path = tmp_path / "unseen.urdf"
    path.write_text(random_five_link(*build).urdf())
    record, gait = walk(PlanarBiped.from_urdf(path), steps)
    check(record, gait, steps)


@pytest.mark.slow(seconds=5)
def test_a_robot_never_seen_runs_sixty_steps(tmp_path):
    path = tmp_path / "unseen.urdf"
    path.write_text(random_five_link(*CORNERS[0]).urdf())
    robot = PlanarBiped.from_urdf(path)
    template = template_for(robot)
    gait = running_gait(template, 2.0 * np.sqrt(template.rest_length * template.gravity / 9.81))
    record = simulate(Experiment(robot, planner=RunningPlanner(gait), steps=60, record_every=5))
    assert record.fall_reason == ""
    assert record.section_state[-20:, 0].mean() == pytest.approx(gait.apex[0], rel=0.01)
    assert record.summary.qp_failures == 0


def test_a_robot_never_seen_walks(tmp_path):
    walk_unseen(tmp_path, CORNERS[0], 4)


@pytest.mark.slow
@pytest.mark.parametrize("build", UNSEEN)
def test_robots_never_seen_walk_on(tmp_path, build):
    walk_unseen(tmp_path, build, 12)


@pytest.mark.slow(seconds=2)
def test_similar_robots_walk_similarly(tmp_path):
    # Mass times 1/8 and lengths times 1/2: the same robot in other units.
    records = []
    for mass, leg in ((80.0, 0.9), (10.0, 0.45)):
        path = tmp_path / f"{mass:g}.urdf"
        path.write_text(random_five_link(3, mass, leg).urdf())
        records.append(walk(PlanarBiped.from_urdf(path), 3))
    (large, gait), (small, small_gait) = records
    ratio = Scale.of(small_gait.parameters).length / Scale.of(gait.parameters).length
    assert ratio == pytest.approx(0.5)
    scaled = small.section_state / [ratio**0.5, ratio, ratio**0.5]
    # The physics step is not scaled, so not quite.
    np.testing.assert_allclose(scaled, large.section_state, atol=0.03)


def test_template_scales_with_the_robot():
    robot = load_robot("five-link")
    p = template_for(robot)
    reference = SlipParameters()
    assert p.rest_length == pytest.approx(1.0, abs=1e-9)
    assert p.leg_stiffness == pytest.approx(reference.leg_stiffness, rel=1e-9)
    assert paper_gait(p).energy == pytest.approx(826.0)
    for name in ROBOTS:
        q = template_for(load_robot(name))
        relative = q.leg_stiffness * q.rest_length / (q.mass * q.gravity)
        assert relative == pytest.approx(16500.0 / (80.0 * 9.81))


def test_human_has_the_masses_and_lengths_of_the_issue():
    robot = load_robot("human")
    masses = [float(inertia.mass) for inertia in robot.model.inertias]
    np.testing.assert_allclose(masses[3:], [54.24, 8.0, 4.88, 8.0, 4.88])
    assert robot.mass == pytest.approx(80.0)
    assert robot.leg_length == pytest.approx(0.441 + 0.513)


def test_runner_is_built_as_five_link_is():
    robot, model = load_robot("runner"), load_robot("five-link").model
    assert robot.mass == pytest.approx(65.0)
    for own, other in zip(robot.model.inertias, model.inertias, strict=True):
        assert own.mass == pytest.approx(65.0 / 80.0 * other.mass)
        np.testing.assert_allclose(own.lever, other.lever)
        assert own.inertia[1, 1] == pytest.approx(65.0 / 80.0 * other.inertia[1, 1], rel=1e-4)
    assert robot.leg_length == pytest.approx(0.9)
    np.testing.assert_array_equal(robot.torque_limit, 400.0)
    np.testing.assert_array_equal(robot.velocity_limit, 23.0)


def test_rabbit_has_its_published_mass():
    robot = load_robot("rabbit")
    assert robot.mass == pytest.approx(32.0)
    np.testing.assert_array_equal(robot.torque_limit, 150.0)


# -- 3D robots held in their plane --------------------------------------------------------


def test_planar_bolt_has_the_sagittal_dynamics_of_the_3d_one():
    planar = load_robot("bolt")
    full = pin.buildModelFromUrdf(str(robot_path("bolt")), pin.JointModelFreeFlyer())
    data = full.createData()
    rng = np.random.default_rng(3)
    hips = 0.0386  # of the planar model's origin, below the base's
    for _ in range(10):
        pitch, rate = rng.uniform(-0.5, 0.5), rng.normal()
        joints, rates = rng.uniform(-1.0, 1.0, 4), rng.normal(size=4)
        q = np.array([0.3, 0.6, pitch, *joints])
        v = np.array([rng.normal(), rng.normal(), rate, *rates])
        planar.update(q, v)
        # The base moves with the planar model's origin, and about it.
        up = np.array([np.sin(pitch), 0.0, np.cos(pitch)])
        full_q = pin.neutral(full)
        full_q[:3] = np.array([q[0], 0.0, q[1]]) + hips * up
        full_q[3:7] = 0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2)
        full_v = np.zeros(full.nv)
        forward = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
        velocity = np.array([v[0], 0.0, v[1]]) + hips * rate * forward
        rotation = pin.Quaternion(full_q[3:7]).toRotationMatrix()
        full_v[:3], full_v[4] = rotation.T @ velocity, rate
        for name, angle, speed in zip(planar.joint_names, joints, rates, strict=True):
            joint = full.joints[full.getJointId(name)]
            full_q[joint.idx_q], full_v[joint.idx_v] = angle, speed
        kinetic = pin.computeKineticEnergy(full, data, full_q, full_v)
        assert 0.5 * v @ planar.mass_matrix @ v == pytest.approx(kinetic, rel=1e-9)
        com = pin.centerOfMass(full, data, full_q)
        np.testing.assert_allclose(planar.com, com[[0, 2]], atol=1e-12)
        pin.framesForwardKinematics(full, data, full_q)
        for i, foot in enumerate(BOLT_FEET):
            place = data.oMf[full.getFrameId(foot)].translation
            np.testing.assert_allclose(planar.foot_position[i] + [0, 0.016], place[[0, 2]])


@pytest.mark.parametrize(
    ("feet", "joints", "locked", "message"),
    [
        (BOLT_FEET, (), None, "name the hips and knees as sagittal_joints"),
        (BOLT_FEET, (*BOLT_JOINTS[:3], "KFE"), None, "no joint 'KFE'"),
        (BOLT_FEET, (*BOLT_JOINTS[:3], "FR_HAA"), None, "'FR_HAA' turns about"),
        (BOLT_FEET, BOLT_JOINTS, {"FL_HAA": 0.3}, "'FL_HFE' turns about"),
        (("FL_FOOT", "toe"), BOLT_JOINTS, None, "no foot link 'toe'"),
        (BOLT_FEET, BOLT_JOINTS[:3], None, "a hip and a knee each"),
    ],
)
def test_unusable_3d_robots_are_named(feet, joints, locked, message):
    with pytest.raises(RobotError, match=message):
        PlanarBiped.from_urdf(robot_path("bolt"), feet, joints, locked, foot_radius=0.016)


def test_feet_without_spheres_are_named():
    with pytest.raises(RobotError, match="one sphere"):
        PlanarBiped.from_urdf(robot_path("bolt"), BOLT_FEET, BOLT_JOINTS)


@pytest.mark.slow(seconds=3)
def test_a_joint_that_turns_the_other_way_walks_the_same(tmp_path, short_walk):
    # Turn one knee's axis about and with it its range: the same robot, another convention.
    tree = ET.parse(robot_path("five-link"))
    knee = next(j for j in tree.getroot().findall("joint") if j.get("name") == "left_knee")
    knee.find("axis").set("xyz", "0 -1 0")
    limit = knee.find("limit")
    limit.set("lower", "-2.5")
    limit.set("upper", "0")
    path = tmp_path / "turned.urdf"
    tree.write(path)
    turned, _ = walk(PlanarBiped.from_urdf(path), 3)
    np.testing.assert_allclose(turned.section_state, short_walk.section_state[:4], atol=1e-6)


def test_links_without_mass_are_refused():
    with pytest.raises(RobotError, match=r"Link\.mass is 0: give a positive number"):
        Link(0.4, 0.0, 0.2, 0.01)


# -- commands -----------------------------------------------------------------------------


@pytest.mark.slow(seconds=1)
def test_robots_command_lists_them(capsys):
    assert main(["robots", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["robot"] for row in rows] == list(SHIPPED)
    assert rows[0]["template"]["rest_length"] == pytest.approx(1.0)
    assert main(["robots"]) == 0
    assert "62 % of its mass" in capsys.readouterr().out


def test_walk_takes_a_3d_urdf(tmp_path, capsys):
    arguments = ["walk", "--robot", str(robot_path("bolt")), "--steps", "2", "--no-figures"]
    arguments += ["--feet", *BOLT_FEET, "--sagittal-joints", *BOLT_JOINTS]
    arguments += ["--foot-radius", "0.016", "--output", str(tmp_path), "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["robot"] == "bolt"


def test_options_of_a_urdf_do_not_go_with_a_shipped_robot(tmp_path, capsys):
    assert main(["walk", "--foot-radius", "0.01", "--output", str(tmp_path)]) == 2
    assert "foot radius go with a URDF" in capsys.readouterr().err
