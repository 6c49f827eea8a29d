"""The messages that docs/guides/your_robot.md explains are the ones a user gets."""

import re

import numpy as np
import pytest
from places import DOCS

import template_control as tc
from template_control.plant.bullet import BulletPlant, pybullet
from template_control.robot.library import robot_path

PAGE = (DOCS / "guides" / "your_robot.md").read_text()
BOLT_FEET = ("FL_FOOT", "FR_FOOT")
BOLT_JOINTS = ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE")


def explained():
    """First column of the table of messages, ``…`` standing for anything."""
    section = PAGE.split("## 5.")[1].split("## 6.")[0]
    return re.findall(r"^\| `(.*?)`", section, flags=re.MULTILINE)


def changed(old, new, count=-1):
    """The five-link robot loaded from a URDF with ``old`` replaced."""

    def load(folder):
        text = robot_path("five-link").read_text()
        assert old in text
        path = folder / "changed.urdf"
        path.write_text(text.replace(old, new, count))
        return tc.PlanarBiped.from_urdf(path)

    return load


def feet(*names):
    return lambda _: tc.PlanarBiped.from_urdf(robot_path("five-link"), names)


def bolt(joints=BOLT_JOINTS, radius=0.016):
    return lambda _: tc.PlanarBiped.from_urdf(
        robot_path("bolt"), BOLT_FEET, joints, foot_radius=radius
    )


def walk(robot, start=None):
    planner = tc.LqrPlanner(tc.default_gait(robot))
    tc.simulate(
        tc.Experiment(robot, planner=planner, steps=1, start=start, world=tc.PlantOptions())
    )


def linked(folder):
    good, bad = tc.Link(0.4, 1.0, 0.2, 0.01), tc.Link(0.4, 0.0, 0.2, 0.01)
    return tc.FiveLink("x", good, good, bad, (1.0, 1.0))


def massless(link):
    """A link's element in the five-link robot's URDF; the same without ``<inertial>``."""
    text = robot_path("five-link").read_text()
    (element,) = re.findall(rf'<link name="{link}">.*?</link>', text, flags=re.DOTALL)
    return element, re.sub("<inertial>.*?</inertial>", "", element, flags=re.DOTALL)


SPHERE = '<collision>\n      <geometry><sphere radius="0.01"/>'
MESH = '<collision>\n      <geometry><mesh filename="none.stl"/>'
KNEE_LIMIT = '<limit lower="0" upper="2.5" effort="350" velocity="20"/>'
HIP = '<joint name="left_hip" type="revolute">'


def losing(joint, losses):
    return changed(joint, f"{joint}<dynamics {losses}/>")


MISTAKES = {
    "there is no URDF at …": lambda folder: tc.load_robot(folder / "none.urdf"),
    "there is no robot …": lambda _: tc.load_robot("none"),
    "is no URDF that can be read": changed("</robot>", ""),
    "is no URDF that Pinocchio reads": changed(KNEE_LIMIT, ""),
    "has … give a finite number": changed('mass value="2.4"', 'mass value="nan"'),
    "its inertia is no body's": changed('iyy="0.04124"', 'iyy="4.124"'),
    "weighs nothing, and so does what is fixed to it": changed(*massless("left_shank")),
    "its collision mesh … is missing": changed(SPHERE, MESH),
    "is not planar: its first joints are …": bolt(joints=()),
    "and must be revolute about y": changed(HIP, HIP.replace("revolute", "continuous")),
    "hinges in its legs: a hip and a knee each": bolt(BOLT_JOINTS[:3]),
    "from the base's pitch joint: place the trunk's origin between the hips": changed(
        '<origin xyz="0 0.1 0"', '<origin xyz="0.02 0.1 0"'
    ),
    "has effort … give its torque limit": changed('effort="350"', 'effort="0"'),
    "dynamics has … give a finite number, not below zero": losing(HIP, 'damping="-1"'),
    "has a damping of …, too much for a time step": lambda folder: walk(
        losing(HIP, 'damping="1e6"')(folder), (1.1, 0.97, 0.0)
    ),
    "base joint … has damping or friction": losing(
        '<joint name="base_x" type="prismatic">', 'friction="1"'
    ),
    "has no foot link …": feet("left_foot", "toe"),
    "feet were named for … a biped has two": feet("left_foot"),
    "must have one sphere as collision shape": bolt(radius=None),
    "the feet have different radii": changed(SPHERE, SPHERE.replace("0.01", "0.02"), 1),
    "has no joint …": bolt((*BOLT_JOINTS[:3], "KFE")),
    "turns about … and not about the lateral axis y": bolt((*BOLT_JOINTS[:3], "FR_HAA")),
    "the legs do not reach a CoM height of …": lambda _: walk(
        tc.load_robot("five-link"), (1.1, 1.3, 0.0)
    ),
    "a start at height … needs joint … beyond its limits": lambda folder: walk(
        changed('lower="0" upper="2.5"', 'lower="0" upper="0.3"')(folder)
    ),
    "… is …: give a positive number": linked,
    "no walking gait with touchdown angle …": lambda _: tc.gait_at(
        tc.SlipParameters(), np.radians(66.0), 3.0
    ),
}


def test_every_explained_message_is_provoked_here():
    assert explained() == list(MISTAKES)


@pytest.mark.parametrize("message", MISTAKES)
def test_a_mistake_gives_its_message(message, tmp_path):
    pattern = ".*".join(re.escape(part) for part in message.split("…"))
    kind = tc.errors.GaitError if "gait" in message else tc.errors.RobotError
    with pytest.raises(kind, match=pattern):
        MISTAKES[message](tmp_path)


def test_a_frame_without_inertial_weighs_nothing_in_pybullet_too(tmp_path):
    # PyBullet alone would take it for a kilogram.
    path = tmp_path / "light.urdf"
    path.write_text(robot_path("five-link").read_text().replace(*massless("left_foot")))
    robot = tc.load_robot(path)
    assert robot.mass == pytest.approx(80.0)
    with BulletPlant(robot, tc.PlantOptions()) as plant:
        links = range(-1, pybullet().getNumJoints(plant.body, physicsClientId=plant.client))
        mass = sum(
            pybullet().getDynamicsInfo(plant.body, link, physicsClientId=plant.client)[0]
            for link in links
        )
    assert mass == pytest.approx(80.0)
