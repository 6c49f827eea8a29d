"""Damping and friction of joints: alike in every engine, known to the controller, left out."""

import logging
import re

import numpy as np
import pinocchio as pin
import pytest
from falling import FREE, PLANAR, falls_as_pinocchio_says

import template_control as tc
from template_control.errors import ParameterError, RobotError
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import robot_path
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.spec import RobotSpec

DT = 1e-3  # [s]


@pytest.fixture
def written(tmp_path):
    """A shipped robot whose joints have a ``<dynamics>``: by name, or the same in all."""

    def write(name, dynamics, joints=r"\w*(?:hip|knee|abduction)", tag="robot"):
        pattern = rf'(<joint name="{joints}" type="revolute">)'
        text, count = re.subn(pattern, rf"\1<dynamics {dynamics}/>", robot_path(name).read_text())
        assert count
        path = tmp_path / f"{tag}.urdf"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("engine", PLANAR)
@pytest.mark.parametrize("damping", [0.5, 5.0])
@pytest.mark.parametrize("name", ["five-link", "human"])
def test_damping_is_the_same_in_every_engine(written, name, damping, engine):
    plant, options = PLANAR[engine]
    robot = PlanarBiped.from_urdf(written(name, f'damping="{damping}"'))
    falls_as_pinocchio_says(robot, plant(robot, options(time_step=1e-4)))


@pytest.mark.parametrize("engine", FREE)
@pytest.mark.parametrize("damping", [0.5, 5.0])
def test_damping_is_the_same_in_every_engine_in_space(written, damping, engine):
    plant, options = FREE[engine]
    robot = FloatingBaseBiped.from_urdf(written("five-link-3d", f'damping="{damping}"'))
    falls_as_pinocchio_says(robot, plant(robot, options(time_step=1e-4)))


def slid(robot, plant, torque, speed=0.0, duration=0.05):
    """Speeds (nu,) of the joints of a robot in the air, off their stops, after a torque."""
    nu = len(robot.joint_names)
    q, v = robot.neutral(), np.zeros(robot.nv)
    q[1 if robot.base_dof == 3 else 2] = 5.0
    q[-nu:], v[-nu:] = np.clip(0.6, *0.8 * robot.joint_range.T), speed
    with plant as world:
        world.reset(q, v)
        for _ in range(round(duration / DT)):
            world.step(np.full(nu, torque))
        world.read(q, v)
    return v[-nu:]


@pytest.mark.parametrize("engine", [*PLANAR, *(f"free {name}" for name in FREE)])
def test_friction_holds_what_is_less_and_slows_what_is_more(written, engine):
    plant, options = PLANAR.get(engine) or FREE[engine.removeprefix("free ")]
    if engine.startswith("free"):
        load, name = FloatingBaseBiped.from_urdf, "five-link-3d"
    else:
        load, name = PlanarBiped.from_urdf, "five-link"
    dry = load(written(name, 'friction="3"'))
    free = load(written(name, 'friction="3"'), lossless=True)

    def speeds(robot, torque, **more):
        return slid(robot, plant(robot, options(time_step=DT)), torque, **more)

    assert np.abs(speeds(free, 2.5)).max() > 0.3
    np.testing.assert_allclose(speeds(dry, 2.5), 0.0, atol=1e-3)
    np.testing.assert_allclose(speeds(dry, -2.5), 0.0, atol=1e-3)
    # Where all joints turn forward, friction is a torque of 3 N m against them.
    np.testing.assert_allclose(speeds(dry, 5.0, speed=1.0), speeds(free, 2.0, speed=1.0), atol=2e-3)
    np.testing.assert_allclose(speeds(dry, 0.0, speed=0.02), 0.0, atol=1e-3)


def test_the_model_knows_the_damping(written):
    damped = PlanarBiped.from_urdf(written("five-link", 'damping="4"', joints=r"\w*knee"))
    plain = tc.load_robot("five-link")
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, v = rng.uniform(-1.0, 1.0, 7), rng.uniform(-3.0, 3.0, 7)
        damped.update(q, v)
        plain.update(q, v)
        extra = np.array([0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 4.0]) * v
        np.testing.assert_allclose(damped.nonlinear_effects - plain.nonlinear_effects, extra)
        for name in ("com_bias", "angular_momentum_bias", "foot_bias", "mass_matrix"):
            np.testing.assert_array_equal(getattr(damped, name), getattr(plain, name))


@pytest.mark.slow(seconds=5)
def test_a_damped_walk_is_the_undamped_one_by_other_torques(written):
    """Damping of 20 N m s/rad takes up to 160 N m, and the CoM stays where it was."""
    records = []
    for lossless in (True, False):
        robot = PlanarBiped.from_urdf(written("five-link", 'damping="20"'), lossless=lossless)
        planner = tc.LqrPlanner(tc.default_gait(robot))
        records.append(
            tc.simulate(tc.Experiment(robot, planner=planner, steps=8, world=tc.IdealOptions()))
        )
    plain, damped = records
    assert not damped.fell
    np.testing.assert_allclose(damped.section_state[-3:], plain.section_state[-3:], atol=0.01)
    count = min(len(plain.torque), len(damped.torque)) // 2
    assert np.abs(damped.torque[:count] - plain.torque[:count]).max() > 50.0


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("options", [tc.PlantOptions(), tc.MujocoOptions(), tc.IdealOptions()])
def test_losses_change_a_run_and_lossless_leaves_them_out_to_the_last_bit(written, options):
    path = written("five-link", 'damping="5" friction="2"', joints=r"\w*knee")
    robots = tc.load_robot("five-link"), PlanarBiped.from_urdf(path, lossless=True)
    runs = [
        tc.simulate(
            tc.Experiment(
                robot, planner=tc.LqrPlanner(tc.default_gait(robot)), steps=2, world=options
            )
        )
        for robot in (*robots, PlanarBiped.from_urdf(path))
    ]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    count = min(len(run.q) for run in runs)
    assert np.abs(runs[0].q[:count] - runs[2].q[:count]).max() > 1e-4


def test_the_option_of_the_command_leaves_them_out(written):
    path = str(written("five-link", 'damping="5" friction="2"'))
    assert RobotSpec(path).load().joint_damping.tolist() == [5.0] * 4
    assert RobotSpec(path).load().joint_friction.tolist() == [2.0] * 4
    robot = RobotSpec(path, lossless=True).load()
    assert not robot.joint_damping.any()
    assert not robot.joint_friction.any()
    with pytest.raises(ParameterError, match="lossless go with a URDF"):
        RobotSpec(lossless=True).load()


@pytest.mark.parametrize("value", ["-1", "nan", "inf", "much", ""])
@pytest.mark.parametrize("name", ["damping", "friction"])
def test_losses_that_are_none_are_refused(written, name, value):
    path = written("five-link", f'{name}="{value}"', joints="left_knee")
    with pytest.raises(RobotError, match=f"joint 'left_knee': dynamics has {name} '{value}'"):
        PlanarBiped.from_urdf(path)


@pytest.mark.parametrize(
    ("plant", "options"), [(BulletPlant, PlantOptions), (IdealPlant, IdealOptions)]
)
def test_damping_that_the_time_step_cannot_follow_is_refused(written, plant, options):
    robot = PlanarBiped.from_urdf(written("five-link", 'damping="300"', joints="left_knee"))
    with pytest.raises(RobotError, match="'left_knee' has a damping of 300") as told:
        plant(robot, options())
    better = float(re.search(r"take (\S+) s", str(told.value))[1])
    with plant(robot, options(time_step=better)):
        pass


def test_a_guide_with_friction_is_refused(written):
    text = robot_path("five-link").read_text()
    assert '<joint name="base_x" type="prismatic">' in text
    path = written("five-link", 'damping="0"', joints="left_knee")
    path.write_text(text.replace(
        '<joint name="base_x" type="prismatic">',
        '<joint name="base_x" type="prismatic"><dynamics damping="2" friction="0"/>'))  # fmt: skip
    with pytest.raises(RobotError, match="base joint 'base_x' has damping or friction"):
        PlanarBiped.from_urdf(path)


@pytest.mark.parametrize("dynamics", ['armature="0.1"', 'damping="1" rotor_inertia="0.1"', 'D="1"'])
def test_a_rotor_inertia_is_ignored_and_the_log_says_so_once(written, caplog, dynamics):
    with caplog.at_level(logging.WARNING, "template_control"):
        for _ in range(2):
            robot = PlanarBiped.from_urdf(written("five-link", dynamics, joints="left_hip"))
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == ("D=" not in dynamics)
    assert all("rotor inertia of 'left_hip' is ignored" in line for line in told)
    assert not np.any(robot.model.armature)


def test_locked_joints_lose_nothing(written):
    path = written("five-link-3d", 'damping="2" friction="1"')
    sagittal = ("left_hip", "left_knee", "right_hip", "right_knee")
    robot = PlanarBiped.from_urdf(path, sagittal_joints=sagittal)
    assert robot.joint_damping.tolist() == [2.0] * 4
    assert pin.computeTotalMass(robot.model) == pytest.approx(80.0)
