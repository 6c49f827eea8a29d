"""URDFs that are wrong, or unusual: loaded as meant, or refused in a line that names the link."""

import logging
import re

import numpy as np
import pytest

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.errors import RobotError
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.robot.library import load_floating_robot, load_robot, robot_path
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.template import default_gait
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.view.replay.robot_visuals import load_shapes

BOLT = {
    "feet": ("FL_FOOT", "FR_FOOT"),
    "sagittal_joints": ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE"),
    "foot_radius": 0.016,
}
TRUNK = '<link name="trunk">'
MESH = '<{0}><geometry><mesh filename="{1}"/></geometry></{0}>'
TETRAHEDRON = """solid t
{}
endsolid t
""".format(
    "\n".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {corner}\n" for corner in face)
        + "endloop\nendfacet"
        for face in (
            ("0 0 0", "0 1 0", "1 0 0"),
            ("0 0 0", "1 0 0", "0 0 1"),
            ("0 0 0", "0 0 1", "0 1 0"),
            ("1 0 0", "0 1 0", "0 0 1"),
        )
    )
)


@pytest.fixture
def five_link():
    return robot_path("five-link").read_text()


@pytest.fixture
def bolt():
    """Bolt in 3D, whose meshes are found nowhere: they are not needed."""
    return re.sub(r"<visual>.*?</visual>", "", robot_path("bolt").read_text(), flags=re.S)


@pytest.fixture
def load(tmp_path):
    """Loads a URDF from its text, into both engines."""

    def load(text, encoding="utf-8", **options):
        path = tmp_path / "robot.urdf"
        path.write_text(text, encoding=encoding)
        robot = PlanarBiped.from_urdf(path, **options)
        with BulletPlant(robot, PlantOptions()):
            return robot

    return load


def changed(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


# ---- meshes


@pytest.mark.parametrize("part", ["visual", "collision"])
@pytest.mark.parametrize(
    "name",
    ["parts/a.stl", "package://{0}/parts/a.stl", "package://robot/parts/a.stl", "file://{1}/parts/a.stl"],
)  # fmt: skip
def test_meshes_are_found_from_the_folder_of_the_urdf(
    load, tmp_path, monkeypatch, five_link, part, name
):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a.stl").write_text(TETRAHEDRON)
    monkeypatch.chdir("/")
    mesh = MESH.format(part, name.format(tmp_path.name, tmp_path))
    robot = load(changed(five_link, TRUNK, TRUNK + mesh))
    assert f'"{tmp_path}/parts/a.stl"' in robot.urdf
    assert robot.mass == pytest.approx(80.0)


def test_a_mesh_that_is_only_shown_may_be_missing_and_is_told_once(load, caplog, five_link):
    text = changed(five_link, TRUNK, TRUNK + MESH.format("visual", "none.stl"))
    with caplog.at_level(logging.WARNING, "template_control"):
        robots = [load(text) for _ in range(2)]
    (told,) = (record.getMessage() for record in caplog.records)
    assert "none.stl" in told
    assert "none.stl" not in robots[0].urdf


@pytest.mark.parametrize(("name", "content"), [("none.stl", None), ("empty.stl", "")])
def test_a_collision_mesh_that_cannot_be_had_is_refused(
    refused, tmp_path, five_link, name, content
):
    if content is not None:
        (tmp_path / name).write_text(content)
    path = tmp_path / "robot.urdf"
    path.write_text(changed(five_link, TRUNK, TRUNK + MESH.format("collision", name)))
    line = refused(["walk", "--robot", str(path), "--output", str(tmp_path / "out")])
    assert "collision mesh" in line
    assert "box, cylinder or sphere" in line


# ---- names


@pytest.mark.parametrize("name", ["world", "slide_x", "slide_z", "universe"])
def test_a_link_may_be_called_as_those_of_the_guide(load, bolt, name):
    assert load(bolt.replace("base_link", name), **BOLT).nv == 7


@pytest.mark.parametrize("name", ["base_x", "base_pitch"])
def test_a_joint_may_be_called_as_those_of_the_guide(load, bolt, name):
    assert load(bolt.replace('"FL_HAA"', f'"{name}"'), **BOLT).nv == 7


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (('name="right_shank"', 'name="left_shank"'), "two links 'left_shank'"),
        (('joint name="right_hip"', 'joint name="left_hip"'), "two joints 'left_hip'"),
        (('<child link="left_shank"/>', '<child link="shin"/>'), "no child link 'shin'"),
    ],
)
def test_names_that_do_not_fit_are_refused(load, five_link, change, told):
    with pytest.raises(RobotError, match=told):
        load(changed(five_link, *change))


@pytest.mark.parametrize(
    "joints", [("FL_HFE",) * 4, ("FL_HFE", "FL_KFE", "FR_HFE"), ("FL_HFE", "FL_KFE") * 2]
)
def test_sagittal_joints_are_four_different_ones(load, bolt, joints):
    with pytest.raises(RobotError, match="name 4 different hinges"):
        load(bolt, **{**BOLT, "sagittal_joints": joints})


def test_a_fixed_joint_is_no_knee(load, bolt):
    joints = (*BOLT["sagittal_joints"][:3], "FR_ANKLE")
    with pytest.raises(RobotError, match="joint 'FR_ANKLE' is fixed"):
        load(bolt, **{**BOLT, "sagittal_joints": joints})


@pytest.mark.parametrize(
    ("first", "says"),
    [("base_link", "'a' is the child of 2 joints: cut the loop"), (None, "one is to be the root")],
)
def test_links_in_a_loop_are_refused(load, bolt, first, says):
    """Pinocchio's reader of URDFs would end the process, or say that there is no model."""
    joint = '<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/></joint>'
    loop = joint.format("ab", "a", "b") + joint.format("ba", "b", "a")
    links = '<link name="a"/><link name="b"/>'
    if first is None:
        text = f'<robot name="ring">{links}{loop}</robot>'
    else:
        text = changed(
            bolt, "</robot>", links + loop + joint.format("to_a", first, "a") + "</robot>"
        )
    with pytest.raises(RobotError, match=says):
        load(text, **BOLT)


# ---- numbers


def of_shank(text, old, new):
    """The text with a change in the left shank."""
    before, name, after = text.partition('<link name="left_shank">')
    return before + name + changed(after, old, new)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "-2.4", "heavy", "", "${mass}"])
def test_a_mass_that_is_none_is_refused(load, five_link, value):
    with pytest.raises(RobotError, match="link 'left_shank': mass has value"):
        load(of_shank(five_link, 'mass value="2.4"', f'mass value="{value}"'))


@pytest.mark.parametrize("value", ["nan", "inf", "-0.04124", "100", "0"])
def test_an_inertia_that_no_body_has_is_refused(load, five_link, value):
    with pytest.raises(RobotError, match=r"link 'left_shank': (its )?inertia"):
        load(of_shank(five_link, 'iyy="0.04124"', f'iyy="{value}"'))


@pytest.mark.parametrize("value", ["0", "-0.01", "nan", "inf", "small"])
def test_a_foot_without_a_size_is_refused(load, five_link, value):
    text = re.sub(r'(<collision>\s*<geometry><sphere radius=)"0.01"', rf'\1"{value}"', five_link)
    with pytest.raises(
        RobotError, match=f"link 'left_foot': collision sphere has radius '{value}'"
    ):
        load(text)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (('xyz="0 0 -0.225"', 'xyz="0 nan -0.225"'), "inertial: origin has xyz"),
        (('xyz="0 0 -0.225"', 'xyz="0 -0.225"'), "give 3 finite numbers"),
        (('effort="350"', 'effort="nan"'), "limit has effort 'nan'"),
        (('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "axis is 0 0 0"),
        (
            ('lower="0" upper="2.5"', 'lower="0" upper="143"'),
            "from 0 to 143 rad, which look like deg",
        ),
    ],
)
def test_other_numbers_are_read_or_refused(load, five_link, change, told):
    with pytest.raises(RobotError, match=told):
        load(changed(five_link, *change))


def without_inertial(text, link):
    return re.sub(rf'(<link name="{link}">)\s*<inertial>.*?</inertial>', r"\1", text, flags=re.S)


def test_a_shank_that_weighs_nothing_is_named(refused, tmp_path, five_link):
    path = tmp_path / "robot.urdf"
    path.write_text(without_inertial(five_link, "left_shank"))
    line = refused(["walk", "--robot", str(path), "--output", str(tmp_path / "out")])
    assert "link 'left_shank' weighs nothing" in line
    assert "give it an <inertial>" in line


def test_a_frame_without_inertial_weighs_nothing_in_both_engines(load, five_link):
    assert load(without_inertial(five_link, "left_foot")).mass == pytest.approx(80.0)


def test_the_engines_masses_are_compared():
    robot = load_robot("five-link")
    text = without_inertial(robot.urdf, "left_shank")
    other = PlanarBiped(robot.path, text, robot.model, robot.feet, robot.foot_radius)
    with pytest.raises(RobotError, match=r"link 'left_shank' weighs 1 kg in PyBullet and 0 kg"):
        BulletPlant(other, PlantOptions())


# ---- texts


@pytest.mark.parametrize("encoding", ["utf-8", "iso-8859-1", "utf-16"])
def test_a_urdf_is_read_in_its_own_encoding(load, five_link, encoding):
    text = changed(
        five_link, '<?xml version="1.0"?>', f'<?xml version="1.0" encoding="{encoding}"?>'
    )
    assert load(changed(text, '"five-link"', '"fünf"'), encoding).name == "fünf"


@pytest.mark.slow(seconds=4)
def test_a_urdf_in_utf_8_walks_where_the_locale_is_ascii(command, tmp_path, five_link):
    path = tmp_path / "robot.urdf"
    path.write_text(changed(five_link, '"five-link"', '"fünf"'), encoding="utf-8")
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = ["walk", "--robot", str(path), "--steps", "1", "--no-figures"]
    table = tmp_path / "table.txt"
    with table.open("w") as out:
        status, told = command(*words, "--output", str(tmp_path), stdout=out, **ascii_only)
    assert status == 0, told
    assert "f?nf" in table.read_text()


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_dtd_is_read(load, five_link, bolt, dimension):
    text, options = (five_link, {}) if dimension == 2 else (bolt, BOLT)
    text = re.sub("<robot", '<!DOCTYPE robot [<!ENTITY m "0.5">]>\n<robot', text, count=1)
    text = re.sub(r'(<mass\s+value=)"[^"]+"', r'\1"&m;"', text.replace('"0"', '"0.0"'))
    assert load(text, **options).mass > 2.0


def test_an_entity_that_is_nowhere_is_refused(load, bolt):
    text = re.sub("<robot", "<!DOCTYPE robot [ ]>\n<robot", bolt, count=1)
    with pytest.raises(RobotError, match="no URDF that can be read"):
        load(re.sub(r'<mass\s+value="[^"]+"', '<mass value="&m;"', text, count=1), **BOLT)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"<sdf/>", b"<robot>", b"junk"])
def test_what_is_no_urdf_is_one_line(tmp_path, refused, content):
    path = tmp_path / "robot.urdf"
    path.write_bytes(content)
    line = refused(["walk", "--robot", str(path), "--output", str(tmp_path / "out")])
    assert "no URDF" in line


def test_a_foot_radius_without_sagittal_joints_is_refused(tmp_path, refused, five_link):
    path = tmp_path / "robot.urdf"
    path.write_text(five_link)
    line = refused(["walk", "--robot", str(path), "--foot-radius", "0.5"])
    assert "foot_radius is for a 3D URDF, and no sagittal_joints are named" in line
    with pytest.raises(RobotError, match="foot_radius is for a 3D URDF"):
        PlanarBiped.from_urdf(path, foot_radius=0.5)
    with pytest.raises(RobotError, match="locked is for a 3D URDF"):
        PlanarBiped.from_urdf(path, locked={"left_hip": 0.1})


@pytest.mark.parametrize("axis", ["0 0 0", "0 5 0", "nan 0 0"])
def test_a_fixed_joint_s_axis_and_limits_mean_nothing(load, five_link, axis):
    ankle = '<joint name="left_ankle" type="fixed">'
    odd = f'{ankle}<axis xyz="{axis}"/><limit lower="2" upper="1"/><mimic joint="left_knee"/>'
    assert load(five_link.replace(ankle, odd)).leg_length == pytest.approx(0.9)


@pytest.mark.slow(seconds=1)
def test_links_and_joints_may_share_names_in_every_engine(tmp_path, five_link):
    text = five_link
    for joint, link in (
        ("left_ankle", "left_foot"),
        ("right_ankle", "right_foot"),
        ("left_knee", "left_shank"),
        ("right_hip", "right_thigh"),
        ("base_pitch", "trunk"),
    ):
        text = text.replace(f'name="{joint}"', f'name="{link}"')
    path = tmp_path / "same.urdf"
    path.write_text(text)
    options = {"ideal": IdealOptions(), "pybullet": PlantOptions(), "mujoco": MujocoOptions()}
    for plant in options.values():
        own, same = (
            simulate(Experiment(r, planner=LqrPlanner(default_gait(r)), steps=1, world=plant))
            for r in (load_robot("five-link"), load_robot(path))
        )
        assert not own.fell
        np.testing.assert_array_equal(own.q, same.q)
    assert load_shapes(same)[1].ngeoms == load_shapes(own)[1].ngeoms > 0


def same_body(own, other):
    """The models are equal."""
    for mine, theirs in zip(own.model.jointPlacements, other.model.jointPlacements, strict=True):
        np.testing.assert_allclose(mine.homogeneous, theirs.homogeneous, atol=1e-12)
    for mine, theirs in zip(own.model.inertias, other.model.inertias, strict=True):
        np.testing.assert_allclose(mine.matrix(), theirs.matrix(), atol=1e-12)


def test_an_axis_s_length_does_not_stretch_a_locked_angle(load, bolt):
    locked = {"locked": {"FL_HAA": 0.0, "FR_HAA": 0.0, "NECK": 0.4}}
    neck = """<link name="head"><inertial><origin xyz="0.1 0 0.1"/><mass value="0.2"/>
    <inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial></link><joint name="NECK" type="revolute">
    <parent link="base_link"/><child link="head"/><axis xyz="{}"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    own, other = (
        load(bolt.replace("</robot>", neck.format(axis)), **BOLT, **locked)
        for axis in ("0 0.6 0.8", "0 3 4")
    )
    same_body(own, other)


ARM = """<link name="{0}"><inertial><origin xyz="0.1 0 0.1"/><mass value="0.2"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial></link><joint name="{0}_joint" type="{1}">
<parent link="base_link"/><child link="{0}"/><axis xyz="0 1 0"/>{2}
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""


def armed(bolt, kind, mimic):
    arms = ARM.format("leader", kind, "") + ARM.format("follower", kind, mimic)
    return bolt.replace("</robot>", arms + "</robot>")


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_locked_joint_that_mimics_another_is_locked_at_its_multiple(load, bolt, kind):
    mimic = '<mimic joint="leader_joint" multiplier="-2" offset="0.1"/>'
    led = load(armed(bolt, kind, mimic), **BOLT, locked={"leader_joint": 0.3})
    both = {"leader_joint": 0.3, "follower_joint": -0.5}
    same_body(led, load(armed(bolt, kind, ""), **BOLT, locked=both))
    # A locked slide is moved, not turned.
    turned = (
        led.model.inertias[3].lever - load(armed(bolt, kind, ""), **BOLT).model.inertias[3].lever
    )
    assert (abs(turned[1]) > 1e-6) == (kind == "prismatic")


REFUSED = {
    "'left_knee' mimics joint 'left_hip', which is not simulated": (
        '<joint name="left_knee" type="revolute">',
        '<joint name="left_knee" type="revolute"><mimic joint="left_hip"/>',
    ),
    "'left_knee' has lower 2.5 and upper 0: give a range": (
        'lower="0" upper="2.5"', 'lower="2.5" upper="0"'
    ),
    "'left_knee': limit has no lower and no upper: give the range": ('lower="0" upper="2.5"', ""),
    "is a xacro file: run xacro first": (
        "</robot>", '<xacro:leg xmlns:xacro="http://www.ros.org/wiki/xacro"/></robot>'
    ),
    "give a finite number; run xacro first": ('value="4.8"', 'value="${thigh_mass}"'),
    "a mass of 1.3e+06 kg and legs of 0.9 m do not fit": ('value="4.8"', 'value="1.3e6"'),
}  # fmt: skip


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_no_robot_is_refused_by_name(load, five_link, message):
    with pytest.raises(RobotError, match=re.escape(message)):
        load(changed(five_link, *REFUSED[message]))


def test_a_robot_in_millimetres_is_refused(load, five_link):
    def longer(match):
        return f'{match[1]}="{" ".join(str(1000 * float(x)) for x in match[2].split())}"'

    text = re.sub(r'(xyz|radius|length|size)="([-.\d ]+)"', longer, five_link)
    text = text.replace('xyz="0.0 1000.0 0.0"', 'xyz="0 1 0"')
    with pytest.raises(RobotError, match="a mass of 80 kg and legs of 900 m do not fit each other"):
        load(text)


def test_the_text_of_a_urdf_is_no_name(five_link):
    for load_it in (load_robot, load_floating_robot):
        with pytest.raises(RobotError, match="not the URDF's text") as error:
            load_it(five_link)
        assert len(str(error.value)) < 200


@pytest.mark.parametrize("root", ["{0}", "{0}/robot_parts"])
def test_meshes_are_found_in_the_packages_of_the_environment(
    load, tmp_path, tmp_path_factory, monkeypatch, five_link, root
):
    packages = tmp_path_factory.mktemp("packages")
    mesh = packages / "robot_parts" / "meshes" / "a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_text(TETRAHEDRON)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/none:{root.format(packages)}")
    name = "package://robot_parts/meshes/a.stl"
    robot = load(changed(five_link, TRUNK, TRUNK + MESH.format("visual", name)))
    assert str(mesh) in robot.urdf


def test_moments_that_are_not_written_are_zero(load, five_link):
    short = re.sub(r' (ixy|ixz|iyz)="0"', "", five_link)
    assert short != five_link
    same_body(load(five_link), load(short))


IMPOSSIBLE = ('ixx="1e-3" iyy="1e-3" izz="1e-3"', 'ixx="1e-3" iyy="1e-3" izz="5e-3"')


def test_an_impossible_inertia_on_the_trunk_is_a_point_and_told_once(load, bolt, caplog):
    text = armed(bolt, "revolute", "")
    with caplog.at_level(logging.WARNING, "template_control"):
        robots = [load(text.replace(*IMPOSSIBLE), **BOLT) for _ in range(2)]
    (told,) = (r.getMessage() for r in caplog.records if "inertia" in r.getMessage())
    assert "leader, follower" in told or "follower, leader" in told
    own = load(text.replace(IMPOSSIBLE[0], 'ixx="0" iyy="0" izz="0"'), **BOLT)
    same_body(robots[0], own)


def test_an_impossible_inertia_in_a_leg_is_refused(load, bolt):
    shank = re.search('<link name="FL_LOWER_LEG">.*?</link>', bolt, flags=re.S)[0]
    odd = re.sub('izz="[^"]*"', 'izz="5"', shank)
    assert odd != shank
    with pytest.raises(RobotError, match="link 'FL_LOWER_LEG': its inertia is no body's"):
        load(bolt.replace(shank, odd), **BOLT)
