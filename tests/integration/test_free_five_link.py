"""Free five-link robots: what is written of a table, what is refused, and that they walk."""

import re
from dataclasses import replace

import numpy as np
import pytest
from places import DOCS

import template_control as tc
from template_control.embedding.options import FREE_PLANNER, EmbeddingOptions
from template_control.errors import RobotError
from template_control.plant.bullet import PlantOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.robot import (
    FloatingBaseBiped,
    HipBlock,
    JointLimits,
    Link,
    Pose,
    floating_state_in,
    load_floating_robot,
    robot_path,
)
from template_control.run.summary import summarise


def box(mass, depth, width, height):
    """About +y, and about +x and +z."""
    along = mass / 12.0 * (depth**2 + height**2)
    return along, (mass / 12.0 * (width**2 + height**2), mass / 12.0 * (depth**2 + width**2))


def rod(mass, radius, length):
    across = mass / 12.0 * (3.0 * radius**2 + length**2)
    return across, (across, 0.5 * mass * radius**2)


@pytest.fixture
def text():
    return robot_path("five-link-3d").read_text()


@pytest.fixture
def load(tmp_path):
    def load(text):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        return FloatingBaseBiped.from_urdf(path)

    return load


def changed(text, old, new, count=1):
    assert old in text
    return text.replace(old, new, count)


def table():
    """Of robots/README.md."""

    def solid(length, mass, com, moments):
        about_y, others = moments
        return Link(length, mass, com, about_y, others)

    return tc.FiveLink(
        "five_link_3d",
        trunk=solid(0.65, 61.6, 0.3461, box(61.6, 0.25, 0.45, 0.65)),
        thigh=solid(0.45, 4.8, 0.225, rod(4.8, 0.05, 0.45)),
        shank=solid(0.45, 2.4, 0.225, rod(2.4, 0.035, 0.45)),
        torque_limit=(350.0, 350.0),
        velocity_limit=20.0,
        hip_range=(-2.0, 1.5),
        knee_range=(0.0, 2.5),
        block=HipBlock(2.0, 0.06, torque_limit=200.0, velocity_limit=23.0),
    )


def test_the_shipped_one_is_written_of_its_table(load):
    shipped, made = load_floating_robot("five-link-3d"), load(table().urdf())
    assert made.joint_names == shipped.joint_names
    np.testing.assert_array_equal(made.torque_limit, shipped.torque_limit)
    np.testing.assert_array_equal(made.velocity_limit, shipped.velocity_limit)
    np.testing.assert_array_equal(made.joint_range, shipped.joint_range)
    for own, other in zip(made.model.inertias, shipped.model.inertias, strict=True):
        assert own.mass == pytest.approx(other.mass)
        np.testing.assert_allclose(own.lever, other.lever, atol=1e-9)
        np.testing.assert_allclose(own.inertia, other.inertia, rtol=4e-3, atol=1e-9)
    for own, other in zip(made.model.jointPlacements, shipped.model.jointPlacements, strict=True):
        assert own.isApprox(other)


def test_it_has_the_size_of_the_reference_template():
    robot = load_floating_robot("five-link-3d")
    template = tc.template_for(robot)
    assert robot.mass == pytest.approx(80.0)
    assert template.rest_length == pytest.approx(1.0, abs=1e-5)
    assert template.leg_stiffness == pytest.approx(16500.0, rel=1e-5)


def test_held_in_its_plane_it_is_five_link():
    held, model = tc.load_robot("five-link-3d"), tc.load_robot("five-link")
    np.testing.assert_allclose(held.leg_length, model.leg_length)
    rng = np.random.default_rng(4)
    for _ in range(5):
        q = np.r_[0.3, 1.0, rng.uniform(-0.3, 0.3), rng.uniform(0.1, 1.0, 4)]
        v = rng.uniform(-1.0, 1.0, 7)
        terms = []
        for robot in (held, model):
            robot.update(q, v)
            mass_matrix = robot.mass_matrix.copy()
            mass_matrix[2, 2] = 0.0  # the trunk's moment: the hip blocks are below its centre
            terms.append((mass_matrix, robot.nonlinear_effects.copy()))
        for own, other in zip(*terms, strict=True):
            np.testing.assert_allclose(own, other, rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("name", ["mass", "radius", "torque_limit", "velocity_limit"])
def test_a_hip_block_of_no_body_is_refused(name, value):
    with pytest.raises(RobotError, match=f"HipBlock.{name}"):
        replace(table().block, **{name: value})


@pytest.mark.parametrize("moments", [(0.0, 0.1), (0.1, -0.1), (np.nan, 0.1), (0.1,), 0.1])
def test_moments_that_no_body_has_are_refused(moments):
    with pytest.raises(RobotError, match=r"Link\.side_inertia"):
        Link(0.4, 3.0, 0.2, 0.1, moments)


def test_moments_that_break_the_triangle_are_refused_where_they_are_loaded(load):
    made = table()
    trunk = replace(made.trunk, side_inertia=(10.0, 0.1))
    with pytest.raises(RobotError, match=r"link 'trunk'.*inertia"):
        load(replace(made, trunk=trunk).urdf())


@pytest.mark.parametrize("value", ["nan", "inf", "-2", "heavy", "", "${mass}"])
def test_a_mass_that_is_none_is_refused(load, text, value):
    with pytest.raises(RobotError, match="link 'left_block': mass has value"):
        load(changed(text, 'mass value="2"', f'mass value="{value}"'))


ABDUCTION = '<axis xyz="1 0 0"/><limit lower="-0.43" upper="0.43" effort="200" velocity="23"/>'


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('effort="200" velocity="23"', 'effort="200" velocity="0"', "'left_abduction' has velo"),
        ('effort="350"', 'effort="nan"', "limit has effort 'nan'"),
        (ABDUCTION, ABDUCTION.replace("1 0 0", "0 0 0"), "axis is 0 0 0"),
        ('<link name="left_foot">', '<link name="toe">', "no child link 'left_foot'"),
        ('joint name="right_hip"', 'joint name="left_hip"', "two joints 'left_hip'"),
        ('<sphere radius="0.01"', '<box size="1 1 1"', "one sphere"),
        ("</robot>", "", "no URDF that can be read"),
    ],
)
def test_a_urdf_that_is_wrong_is_told(load, text, old, new, told):
    with pytest.raises(RobotError, match=told):
        load(changed(text, old, new, 2 if "sphere" in old else 1))


# -- the messages that docs/guides/your_floating_robot.md explains ---------------------------------

PAGE = (DOCS / "guides" / "your_floating_robot.md").read_text()
HIP = 'name="left_hip" type="revolute"'
ARM = """<link name="arm"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1"
  iyz="0" izz="0.1"/></inertial></link><joint name="elbow" type="revolute"><parent link="trunk"/>
  <child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>
  </joint>
"""


def edited(old, new):
    return lambda load: load(changed(robot_path("five-link-3d").read_text(), old, new))


def start(robot, height=0.98):
    feet = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.05]])
    pose = Pose(
        np.array([0.0, 0.0, height]), np.zeros(3), feet, np.zeros((2, 3)), momentum_speed=True
    )
    floating_state_in(robot, pose)


def limited(ranges):
    path, limits = robot_path("five-link-3d"), JointLimits(200.0, 20.0, ranges)
    return FloatingBaseBiped.from_urdf(path, limits=limits)


MISTAKES = {
    "joints move foot … three or four are needed": edited(HIP, HIP.replace("revolute", "fixed")),
    "does not turn about the lateral axis y, as hip and knee must": edited(
        '<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>'
    ),
    "are in no leg: make them fixed": edited("</robot>", ARM + "</robot>"),
    "is JointModel… and must be revolute with limits": edited(
        HIP, HIP.replace("revolute", "continuous")
    ),
    "has effort … give its torque limit": edited('effort="350"', 'effort="0"'),
    "has lower … and upper … give a range that it can turn in": edited(
        'lower="0" upper="2.5"', 'lower="2.5" upper="0"'
    ),
    "ranges are given: give one for each joint of a leg": lambda _: limited(((-1.0, 1.0),)),
    "hang on the same leg: name one of each": lambda _: FloatingBaseBiped.from_urdf(
        robot_path("five-link")
    ),
    "has no model with a floating base": lambda _: load_floating_robot("human"),
    "the legs do not reach a CoM height of …": lambda _: start(
        load_floating_robot("five-link-3d"), 1.4
    ),
    "a start at height … needs joint … beyond its limits": lambda _: start(
        limited(((-0.5, 0.5), (-1.0, 1.0), (0.0, 0.3)))
    ),
}


def test_every_explained_message_is_provoked_here():
    section = PAGE.split("## 4.")[1]
    assert re.findall(r"^\| `(.*?)`", section, flags=re.MULTILINE) == list(MISTAKES)


@pytest.mark.parametrize("message", MISTAKES)
def test_a_mistake_gives_its_message(message, load):
    pattern = ".*".join(re.escape(part) for part in message.split("…"))
    with pytest.raises(RobotError, match=pattern):
        MISTAKES[message](load)


@pytest.mark.slow(seconds=4)
def test_it_walks_within_all_its_limits():
    robot = load_floating_robot("five-link-3d")
    gait = tc.robot_gait_for_speed(robot, 1.0)
    planner = tc.LqrPlanner(gait, tc.embedding.FREE_PLANNER)
    record = tc.simulate(tc.Experiment(robot, planner=planner, steps=20))
    assert not record.fell, record.fall_reason
    assert record.steps == 20
    figures = summarise(record, None)
    assert figures["qp_failures"] == 0
    assert figures["saturated_share"] == 0.0
    assert figures["mean_speed"] == pytest.approx(gait.mean_speed, rel=0.02)
    assert figures["attitude_rms"]["roll"] < 0.02
    assert figures["attitude_rms"]["pitch"] < 0.02
    for angle in figures["joint_angle"].values():
        assert angle["lower"] < angle["least"] < angle["most"] < angle["upper"]
    for speed in figures["joint_speed"].values():
        assert speed["peak"] < speed["limit"]


YAW = """<link name="{side}_yaw_link"><inertial><mass value="0.5"/><inertia ixx="0.001"
iyy="0.001" izz="0.001"/></inertial></link><joint name="{side}_yaw" type="revolute">
<parent link="{parent}"/><child link="{side}_yaw_link"/>{origin}<axis xyz="0 0 1"/>
<limit lower="-0.5" upper="0.5" effort="200" velocity="20"/></joint></robot>"""


def with_yaw(text, above):
    """Legs of four hinges: the one about the vertical is above the ab-/adduction, or below it."""
    for side, y in (("left", "0.1"), ("right", "-0.1")):
        joint = "abduction" if above else "hip"
        start = text.index(f'<joint name="{side}_{joint}"')
        end = text.index("</joint>", start)
        old = text[start:end]
        parent = re.search('<parent link="(.*?)"', old)[1]
        origin = f'<origin xyz="0 {y} 0"/>' if above else ""
        new = old.replace(f'<parent link="{parent}"', f'<parent link="{side}_yaw_link"')
        text = text.replace(old, new.replace(f'xyz="0 {y} 0"', 'xyz="0 0 0"'))
        yaw = YAW.format(side=side, parent=parent, origin=origin)
        text = changed(text, "</robot>", yaw)
    return text


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize("plant", [PlantOptions(), MujocoOptions()])
def test_legs_of_four_hinges_walk(load, text, above, plant):
    robot = load(with_yaw(text, above))
    assert [len(leg) for leg in robot.legs] == [4, 4]
    record = tc.simulate(
        tc.Experiment(
            robot,
            planner=tc.LqrPlanner(tc.default_gait(robot), FREE_PLANNER),
            steps=8,
            controller=EmbeddingOptions.of_kind("free"),
            world=plant,
        )
    )
    assert not record.fell, record.fall_reason
    yaw = [i for i, name in enumerate(robot.joint_names) if name.endswith("yaw")]
    assert [joint for joint, _ in robot.spare] == yaw
    assert np.abs(record.q[:, [7 + i for i in yaw]]).max() < 0.01
    assert record.summary.qp_failures == 0


def test_the_start_of_a_leg_of_four_hinges_moves_its_feet_as_wanted(load, text):
    robot = load(with_yaw(text, above=True))
    velocity = np.array([[0.0, 0.0, 0.0], [2.0, 0.1, -0.2]])
    pose = Pose(
        com=np.array([0.0, 0.02, 0.96]),
        com_velocity=np.array([1.1, 0.1, 0.0]),
        feet=np.array([[0.0, 0.1, 0.0], [0.1, -0.12, 0.05]]),
        feet_velocity=velocity,
        momentum_speed=True,
    )
    q, v = floating_state_in(robot, pose)
    robot.update(q, v)
    np.testing.assert_allclose(robot.space.foot_position, pose.feet, atol=1e-9)
    np.testing.assert_allclose(robot.contact_velocity, velocity, atol=1e-9)
