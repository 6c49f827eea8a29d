"""Flat feet: soles found in spheres, boxes and meshes, or given, and robots that have none."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import template_control as tc
from template_control.errors import ParameterError, RobotError
from template_control.robot import floating_biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import FLOATING_ROBOTS, load_floating_robot, robot_path
from template_control.robot.sole import Sole
from template_control.robot.spec import RobotSpec
from template_control.robot.start import Pose, floating_state_in

G1_FEET = ("left_ankle_roll_link", "right_ankle_roll_link")
SHAPE = '<collision><origin xyz="0.03 {y} -0.02"/><geometry><%s/></geometry></collision>'
BOX, MESH = SHAPE % 'box size="0.2 0.08 0.03"', SHAPE % 'mesh filename="{file}" scale="1 1 0.5"'


@pytest.fixture(scope="module")
def g1():
    return load_floating_robot("g1")


def with_feet(tmp_path, shape):
    """G1's URDF without pictures, with other collision shapes in its feet."""
    text = robot_path("g1").read_text()
    text = re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL)
    for foot, y in zip(G1_FEET, (0.01, -0.01), strict=True):
        start = text.index(f'<link name="{foot}">')
        end = text.index("</link>", start)
        link = re.sub(r"<collision>.*?</collision>", "", text[start:end], flags=re.DOTALL)
        text = text[:start] + link + shape.replace("{y}", str(y)) + text[end:]
    path = tmp_path / "g1.urdf"
    path.write_text(text)
    return path


def box_mesh(path):
    """An OBJ file of a box of 0.2 m, 0.08 m and 0.06 m."""
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.04, 0.04) for z in (-0.03, 0.03)]
    faces = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2)]
    faces += [(3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines))


@pytest.fixture(scope="module")
def whole():
    return load_floating_robot("g1", upper_body=True)


def test_an_upper_body_that_moves_rests_where_it_would_be_locked(g1, whole):
    assert (len(whole.joint_names), whole.nv, len(whole.upper_body)) == (29, 35, 17)
    assert [angle for _, angle in whole.spare] == [0.0] * 17
    for name in ("mass", "leg_length", "ankle_height", "toe_ahead", "sway", "leg_mass"):
        assert getattr(whole, name) == pytest.approx(getattr(g1, name), rel=1e-9), name
    pose = Pose(
        com=np.array([0.0, 0.05, 0.6]),
        com_velocity=np.array([0.5, 0.1, 0.0]),
        feet=np.array([[0.0, 0.07, 0.0], [0.2, -0.07, 0.0]]),
        feet_velocity=np.zeros((2, 3)),
        rear=0,
        momentum_speed=True,
    )
    for ours, theirs in zip(
        floating_state_in(whole, pose), floating_state_in(g1, pose), strict=True
    ):
        np.testing.assert_allclose(ours[: len(theirs)], theirs, atol=1e-9)
        assert np.all(ours[len(theirs) :] == 0.0)
    np.testing.assert_allclose(whole.space.momentum, g1.space.momentum, atol=1e-9)


def test_joints_of_an_upper_body_may_stay_locked():
    spec = RobotSpec(str(robot_path("g1")), G1_FEET, free=True, flat_feet=True, upper_body=True)
    held = {"waist_roll_joint": 0.1, "waist_pitch_joint": -0.1}
    robot = RobotSpec.load(replace(spec, locked=held))
    assert len(robot.upper_body) == 15
    assert not set(held) & set(robot.joint_names)


def test_an_upper_body_of_too_many_joints_is_refused(monkeypatch):
    monkeypatch.setattr(floating_biped, "MOST_SPARE", 16)
    with pytest.raises(RobotError, match="17 joints are in no leg, and 16 may move: name others"):
        load_floating_robot("g1", upper_body=True)


@pytest.mark.parametrize("model", ["five-link", "bolt"])
def test_an_upper_body_goes_with_flat_feet(model):
    with pytest.raises(ParameterError, match=f"{model} has no upper body that moves"):
        RobotSpec(model, free=model == "bolt", upper_body=True).load()
    with pytest.raises(RobotError, match="upper_body is of a robot on flat feet"):
        FloatingBaseBiped.from_urdf(robot_path("five-link-3d"), upper_body=True)


def test_soles_of_spheres(g1):
    """G1 stands on four spheres a foot, whose lowest points are the corners of its sole."""
    for patch, place in zip(g1.patches, g1.contact_position, strict=True):
        np.testing.assert_allclose(patch.half_sides, [0.085, 0.03], atol=1e-12)
        # Ahead of the ankle by the CoM's lead over the hips, and on the ground.
        assert g1.toe_ahead == pytest.approx(0.035 - patch.centre[0], abs=1e-9)
        assert place[2] == pytest.approx(g1.contact_position[0, 2], abs=1e-12)
    assert g1.ankle_height == pytest.approx(0.017558 + 0.035, abs=1e-9)
    assert (g1.contact_rows, g1.foot_radius) == (6, 0.0)
    assert [g1.joint_names[j] for j in g1.hinges[0]] == [
        f"left_{name}_joint" for name in ("hip_pitch", "knee", "ankle_pitch")
    ]


@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_soles_of_boxes_and_meshes(tmp_path, kind):
    box_mesh(tmp_path / "sole.obj")
    shape = BOX if kind == "box" else MESH.replace("{file}", str(tmp_path / "sole.obj"))
    robot = FloatingBaseBiped.from_urdf(with_feet(tmp_path, shape), G1_FEET, flat_feet=True)
    for side, patch in zip((1.0, -1.0), robot.patches, strict=True):
        np.testing.assert_allclose(patch.half_sides, [0.1, 0.04], atol=1e-9)
        toe = patch.placement.translation
        np.testing.assert_allclose(toe[:2] + patch.centre, [0.03, side * 0.01], atol=1e-9)
        assert toe[2] == pytest.approx(-0.035)
    # Engines stand on a ball at each corner.
    assert robot.urdf.count("<sphere") == 8
    assert "<box" not in robot.urdf


def test_a_given_sole_is_mirrored(tmp_path):
    sole = Sole(np.array([0.02, 0.01, -0.04]), (0.09, 0.035))
    robot = FloatingBaseBiped.from_urdf(with_feet(tmp_path, ""), G1_FEET, sole=sole)
    middles = [p.placement.translation[:2] + p.centre for p in robot.patches]
    np.testing.assert_allclose(middles, [[0.02, 0.01], [0.02, -0.01]], atol=1e-9)
    lighter = robot.changed(masses={"pelvis": 3.0})
    np.testing.assert_allclose(lighter.patches[0].half_sides, (0.09, 0.035))
    assert lighter.mass < robot.mass


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("", "has no collision shape that a sole could be found from: give `sole`"),
        (
            '<collision><geometry><sphere radius="0.02"/></geometry></collision>',
            "are no rectangle to stand on, of 0 m times 0 m",
        ),
    ],
)
def test_feet_without_a_sole_are_refused(tmp_path, shape, message):
    with pytest.raises(RobotError, match=message):
        FloatingBaseBiped.from_urdf(with_feet(tmp_path, shape), G1_FEET, flat_feet=True)


def test_legs_that_cannot_turn_a_sole_are_refused():
    with pytest.raises(RobotError, match="2 joints move flat foot"):
        RobotSpec(
            str(robot_path("talos")),
            feet=("leg_left_2_link", "leg_right_2_link"),
            free=True,
            flat_feet=True,
        ).load()


def test_talos_has_its_joints_in_another_order():
    talos = load_floating_robot("talos")
    names = [talos.joint_names[j] for j in talos.hinges[1]]
    assert names == [f"leg_right_{number}_joint" for number in (3, 4, 5)]
    np.testing.assert_allclose(talos.patches[0].half_sides, [0.102, 0.062], atol=1e-3)
    assert 0.85 < talos.sway < 0.9


@pytest.mark.parametrize("name", ["g1", "talos"])
def test_a_knee_stops_where_its_leg_is_longest(name):
    robot = load_floating_robot(name)
    model, data, q = robot.model, robot.model.createData(), robot.neutral()
    for hip, knee, ankle in robot.hinges:
        stop, bent = robot.joint_stops[knee]
        urdf = robot.joint_range[knee]
        assert urdf[0] <= stop < bent == urdf[1]

        def length(angle, hip=hip, knee=knee, ankle=ankle):
            q[robot.nq - len(robot.joint_names) + knee] = angle
            pin.forwardKinematics(model, data, q)
            ends = [data.oMi[2 + joint].translation for joint in (hip, ankle)]
            return np.linalg.norm(np.subtract(*ends))

        assert length(stop) == pytest.approx(max(map(length, np.linspace(*urdf, 2001))), abs=1e-6)


def test_the_sway_ratio_is_that_of_a_sway(g1):
    """Soles and attitude of the trunk rest, and the CoM moves to the left."""
    q = g1.bent()
    g1.update(q, np.zeros(g1.nv))
    height = g1.space.com[2] - g1.contact_position[0, 2]
    feet = g1.contact_jacobian.reshape(-1, g1.nv)
    rows = np.vstack((g1.jacobians.turning, feet))
    v = np.linalg.svd(rows)[2][len(rows) :].T  # what leaves them at rest
    v = v @ np.linalg.lstsq(g1.jacobians.com @ v, np.array([0.0, 0.1, 0.0]), rcond=None)[0]
    g1.update(q, v)
    assert g1.space.com_velocity[1] == pytest.approx(0.1)
    speed = 0.1 - g1.space.momentum[0] / (g1.mass * height)
    assert g1.sway == pytest.approx(0.1 / speed, rel=1e-6)


def test_a_start_puts_level_soles_on_the_ground(g1):
    pose = Pose(
        com=np.array([0.02, 0.01, 0.62]),
        com_velocity=np.array([0.4, 0.1, 0.0]),
        feet=np.array([[0.0, 0.08, 0.0], [0.1, -0.08, 0.03]]),
        feet_velocity=np.array([[0.0, 0.0, 0.0], [0.8, 0.0, 0.1]]),
        pitch=0.05,
        momentum_speed=True,
    )
    floating_state_in(g1, pose)
    now, s = g1.data[0], g1.space
    np.testing.assert_allclose(s.com, pose.com, atol=1e-9)
    np.testing.assert_allclose(g1.contact_position, pose.feet, atol=1e-9)
    np.testing.assert_allclose(now["contact_axes"][:2], [np.eye(3)] * 2, atol=1e-9)
    np.testing.assert_allclose(now["contact_velocity"][1], [0.8, 0.0, 0.1, 0, 0, 0], atol=1e-9)
    sway = s.com_velocity[1] - s.momentum[0] / (g1.mass * pose.com[2])
    assert g1.sway * sway == pytest.approx(0.1)
    assert pin.log3(g1.rotation)[1] == pytest.approx(0.05)


@pytest.mark.parametrize("name", FLOATING_ROBOTS)
def test_a_robot_walks_by_default_at_a_speed_of_its_range(name):
    robot = load_floating_robot(name)
    slowest, fastest = tc.walking_speeds(robot)
    assert slowest <= tc.default_gait(robot).mean_speed <= fastest
