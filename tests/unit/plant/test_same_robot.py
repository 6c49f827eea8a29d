"""The robot that is simulated is that of the URDF: in every engine it falls as in Pinocchio."""

import re

import numpy as np
import pinocchio as pin
import pytest
from falling import DT, FREE, PLANAR, falls_as_pinocchio_says

from template_control.errors import RobotError
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.mujoco import MujocoOptions, MujocoPlant
from template_control.plant.world import moment
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import (
    FLOATING_ROBOTS,
    ROBOTS,
    load_floating_robot,
    load_robot,
    robot_path,
)
from template_control.robot.planar_biped import PlanarBiped

SAGITTAL = ("left_hip", "left_knee", "right_hip", "right_knee")
FIXED = (
    '<joint name="{0}_{1}" type="fixed"><origin xyz="{2}" rpy="{3}"/><parent link="{0}"/>'
    '<child link="{1}"/></joint>'
)
BACKPACK = (
    '<link name="backpack"><inertial><origin xyz="-0.1 0.02 0.05" rpy="0.4 0.3 -0.2"/>'
    '<mass value="7.5"/><inertia ixx="0.3" ixy="0.02" ixz="-0.01" iyy="0.2" iyz="0.03"'
    ' izz="0.25"/></inertial></link>'
)


def before_end(text, added):
    return text.replace("</robot>", added + "</robot>")


def on_footprint(text):
    joint = FIXED.format("base_footprint", "trunk", "0.02 0 0.95", "0 0 0")
    return before_end(text, '<link name="base_footprint"/>' + joint)


def on_two_links(text):
    """A trunk below two massless links, with another one's mass on its back."""
    chain = '<link name="base_footprint"/><link name="base_link"/>' + BACKPACK
    chain += FIXED.format("base_footprint", "base_link", "0 0 0.9", "0 0 0.3")
    chain += FIXED.format("base_link", "trunk", "0.01 0 0.05", "0 0 -0.3")
    chain += FIXED.format("trunk", "backpack", "-0.2 0.05 0.4", "0.1 -0.5 0.9")
    return before_end(text, chain)


def massless_thigh(text):
    """The thigh's mass is in a link that is fixed to it."""
    inertial = re.search(r'<link name="left_thigh">\s*(<inertial>.*?</inertial>)', text, re.S)[1]
    moved = f'<link name="motor">{inertial}</link>'
    moved += FIXED.format("left_thigh", "motor", "0 0 0", "0 0 0")
    return before_end(text.replace(inertial, "", 1), moved)


def floating(text):
    joint = '<joint name="j" type="floating"><parent link="world"/><child link="trunk"/></joint>'
    return before_end(text, '<link name="world"/>' + joint)


KINDS = {
    "footprint": on_footprint,
    "two links": on_two_links,
    "thigh": massless_thigh,
    "world": floating,
    "world and footprint": lambda text: floating(on_footprint(text)).replace(
        'type="floating"><parent link="world"/><child link="trunk"/>',
        'type="floating"><parent link="world"/><child link="base_footprint"/>',
    ),
}


@pytest.fixture
def written(tmp_path):
    def write(change):
        path = tmp_path / "robot.urdf"
        path.write_text(change(robot_path("five-link-3d").read_text()))
        return path

    return write


@pytest.mark.parametrize("engine", FREE)
@pytest.mark.parametrize("name", FLOATING_ROBOTS)
def test_a_shipped_free_robot_falls_as_its_model(name, engine):
    plant, options = FREE[engine]
    robot = load_floating_robot(name)
    falls_as_pinocchio_says(robot, plant(robot, options(time_step=DT)))


@pytest.mark.parametrize("engine", PLANAR)
@pytest.mark.parametrize("name", ROBOTS)
def test_a_shipped_planar_robot_falls_as_its_model(name, engine):
    plant, options = PLANAR[engine]
    robot = load_robot(name)
    falls_as_pinocchio_says(robot, plant(robot, options(time_step=DT)))


@pytest.mark.parametrize("engine", FREE)
@pytest.mark.parametrize("kind", KINDS)
def test_a_massless_root_link_falls_with_the_trunk(written, kind, engine):
    plant, options = FREE[engine]
    robot = FloatingBaseBiped.from_urdf(written(KINDS[kind]))
    falls_as_pinocchio_says(robot, plant(robot, options(time_step=DT)))


@pytest.mark.parametrize("engine", PLANAR)
@pytest.mark.parametrize("kind", KINDS)
def test_a_massless_root_link_falls_with_the_trunk_in_its_plane(written, kind, engine):
    plant, options = PLANAR[engine]
    robot = PlanarBiped.from_urdf(written(KINDS[kind]), sagittal_joints=SAGITTAL)
    falls_as_pinocchio_says(robot, plant(robot, options(time_step=DT)))


@pytest.mark.parametrize("kind", ["footprint", "two links"])
def test_a_push_acts_on_the_whole_trunk(written, kind):
    robot = PlanarBiped.from_urdf(written(KINDS[kind]), sagittal_joints=SAGITTAL)
    ends = []
    for plant, options in PLANAR.values():
        q, v = robot.neutral(), np.zeros(robot.nv)
        q[1], q[4], q[6] = 5.0, 0.5, 0.5  # off the knees' stops
        with plant(robot, options(time_step=DT)) as world:
            world.reset(q, v)
            for _ in range(200):
                world.step(np.zeros(4), 500.0)
            world.read(q, v)
        ends.append(v)
    assert abs(ends[0][2]) > 0.02
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, atol=2e-3)


@pytest.mark.parametrize("engine", FREE)
@pytest.mark.parametrize("floats", [False, True])
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_no_knee_goes_through_its_stops(engine, floats, way):
    """In free fall, with a fiftieth of the torque that it can have."""
    robot = load_floating_robot("five-link-3d") if floats else load_robot("five-link")
    plant, options = (FREE if floats else PLANAR)[engine]
    knee = robot.joint_names.index("left_knee")
    q, v, torque = robot.neutral(), np.zeros(robot.nv), np.zeros(len(robot.joint_names))
    q[2 if floats else 1] = 5.0
    q[knee - len(torque)], torque[knee] = 1.2, 0.02 * way * robot.torque_limit[knee]
    stop, angles = robot.joint_range[knee, 0 if way < 0.0 else 1], []
    with plant(robot, options()) as world:
        world.reset(q, v)
        for _ in range(1000):
            world.step(torque)
            world.read(q, v)
            angles.append(way * (q[knee - len(torque)] - stop))
    assert -0.01 < max(angles) < 0.03


@pytest.mark.parametrize("kind", KINDS)
def test_masses_and_centre_are_those_of_the_file(written, kind):
    made = FloatingBaseBiped.from_urdf(written(KINDS[kind]))
    model = pin.buildModelFromXML(KINDS[kind](robot_path("five-link-3d").read_text()).replace(
        "floating", "fixed"), pin.JointModelFreeFlyer())  # fmt: skip
    q = pin.neutral(model)
    assert made.mass == pytest.approx(pin.computeTotalMass(model), rel=1e-12)
    np.testing.assert_allclose(
        made.space.com, pin.centerOfMass(model, model.createData(), q), atol=1e-12
    )
    assert made.feet == ("left_foot", "right_foot")


def test_a_trunk_that_weighs_nothing_at_all_is_refused(written):
    def empty(text):
        return re.sub(r'(<link name="trunk">)\s*<inertial>.*?</inertial>', r"\1", text, flags=re.S)

    with pytest.raises(RobotError, match="the root link weighs nothing"):
        FloatingBaseBiped.from_urdf(written(empty))


@pytest.mark.parametrize("plant", [BulletPlant, MujocoPlant])
def test_another_robot_in_the_engine_is_refused(monkeypatch, plant):
    """The engine is given another shank: longer by 1 mm in the text, or in the model."""
    robot, other = load_robot("five-link"), load_robot("five-link")
    text = robot.urdf.replace('0 0 -0.45"', '0 0 -0.451"', 1)
    assert text != robot.urdf
    robot.urdf = text
    monkeypatch.setattr("template_control.plant.mujoco.mjcf", lambda *_: changed_mjcf(other))
    options = PlantOptions() if plant is BulletPlant else MujocoOptions()
    with pytest.raises(RobotError, match="another mass matrix than the model at"):
        plant(robot, options)


def changed_mjcf(robot):
    from template_control.plant.mjcf import mjcf

    return mjcf(robot, MujocoOptions(), 4e-3).replace("-0.45", "-0.451", 1)


def test_a_moment_is_numpy_s_cross_product():
    for place, force in np.random.default_rng(0).normal(size=(50, 2, 3)):
        found = moment(place.tolist(), force.tolist())
        np.testing.assert_array_equal(found, np.cross(place, force))
