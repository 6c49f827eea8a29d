"""The bipeds of the package example-robot-data: each walks, or is refused for a true reason."""

import importlib.metadata
import xml.etree.ElementTree as ET

import pytest

import template_control as tc
from template_control.errors import RobotError
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import robot_path
from template_control.robot.planar_biped import PlanarBiped

TALOS_LEGS = ("leg_left_3_joint", "leg_left_4_joint", "leg_right_3_joint", "leg_right_4_joint")
TALOS = {"feet": ("left_sole_link", "right_sole_link"), "sagittal_joints": TALOS_LEGS}
ROMEO = {
    "feet": ("l_sole", "r_sole"),
    "sagittal_joints": ("LHipPitch", "LKneePitch", "RHipPitch", "RKneePitch"),
}
G1 = {
    "feet": ("left_ankle_roll_link", "right_ankle_roll_link"),
    "sagittal_joints": (
        "left_hip_pitch_joint", "left_knee_joint", "right_hip_pitch_joint", "right_knee_joint"
    ),
    "foot_offset": (0.035, 0.0, -0.015),  # the sole's spheres are at x = -0.05 and 0.12 m
}  # fmt: skip
ICUB = {
    "feet": ("l_sole", "r_sole"),
    "sagittal_joints": ("l_hip_pitch", "l_knee", "r_hip_pitch", "r_knee"),
}
HUMANOID = {
    "feet": ("l_ankle", "r_ankle"),
    "sagittal_joints": ("LLEG_HIP_P", "LLEG_KNEE", "RLEG_HIP_P", "RLEG_KNEE"),
}
ALEXANDER = {
    "feet": ("LEFT_FOOT", "RIGHT_FOOT"),
    "sagittal_joints": ("LEFT_HIP_Y", "LEFT_KNEE_Y", "RIGHT_HIP_Y", "RIGHT_KNEE_Y"),
}
ROBOTS = {
    "g1_29dof_rev_1_0.urdf": G1,
    "g1_29dof_with_hand_rev_1_0.urdf": G1,
    "talos_reduced.urdf": TALOS,
    "talos_reduced_box.urdf": TALOS,
    "talos_reduced_corrected.urdf": TALOS,
    "talos_full_v2.urdf": TALOS,
    "talos_full_v2_box.urdf": TALOS,
    "romeo.urdf": ROMEO,
    "romeo_small.urdf": ROMEO,
    "icub.urdf": ICUB,
    "icub_reduced.urdf": ICUB,
    "romeo_laas_small.urdf": {
        "feet": ("l_sole", "r_sole"),
        "sagittal_joints": tuple(f"{name}_joint" for name in ROMEO["sagittal_joints"]),
    },
    "human.urdf": {
        "feet": ("left_foot", "right_foot"),
        "sagittal_joints": ("left_hip_Y", "left_knee_Z", "right_hip_Y", "right_knee_Z"),
    },
    "simple_humanoid.urdf": HUMANOID,
    "simple_humanoid_classical.urdf": HUMANOID,
    "alexander_v1.lowerBodyOnly.urdf": ALEXANDER,
}  # fmt: skip


def path_of(name):
    files = importlib.metadata.files("example-robot-data")
    return next(str(file.locate()) for file in files if file.name == name)


def load(name):
    return PlanarBiped.from_urdf(path_of(name), foot_radius=0.02, **ROBOTS[name])


WALK = {
    "g1_29dof_rev_1_0.urdf": 0.7,
    "g1_29dof_with_hand_rev_1_0.urdf": 0.7,
    "talos_reduced.urdf": 0.6,
    "talos_reduced_box.urdf": 0.6,
    "talos_reduced_corrected.urdf": 0.6,
    "talos_full_v2.urdf": 0.6,
    "talos_full_v2_box.urdf": 0.6,
    "alexander_v1.lowerBodyOnly.urdf": 0.65,
}
"""Mean speeds [m/s], about the middle of what each robot walks."""
AT_NO_SPEED = (
    "romeo.urdf", "romeo_small.urdf", "simple_humanoid.urdf", "simple_humanoid_classical.urdf"
)  # fmt: skip
REFUSED = {
    "icub.urdf": "'l_ankle_2': its inertia has a negative principal",
    "icub_reduced.urdf": "'l_ankle_2': its inertia has a negative principal",
    "romeo_laas_small.urdf": "'LHipPitch_link': its inertia has a negative principal",
    "human.urdf": "'left_knee_Z' turns about .* and not about the lateral axis",
}


def test_each_robot_has_its_outcome():
    assert sorted((*WALK, *AT_NO_SPEED, *REFUSED)) == sorted(ROBOTS)


@pytest.mark.slow(seconds=6)
@pytest.mark.parametrize("name", WALK)
def test_it_walks(name):
    robot = load(name)
    gait = tc.robot_gait_for_speed(robot, WALK[name])
    record = tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=10))
    assert not record.fell, record.fall_reason
    assert record.summary.qp_failures == 0


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize("name", AT_NO_SPEED)
def test_it_is_too_weak_or_too_slow(name):
    """Romeo's hips turn at 2.1 rad/s at most; the humanoid of 131 kg has the motors of TALOS."""
    with pytest.raises(tc.errors.GaitError, match="its legs are too heavy or its motors too weak"):
        tc.walking_speeds(load(name))


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_for_what_it_is(name):
    with pytest.raises(RobotError, match=REFUSED[name]):
        load(name)


def test_a_free_robot_s_soles_are_below_its_ankles():
    bolt = path_of("bolt.urdf")
    feet = ("FL_FOOT", "FR_FOOT")
    own = FloatingBaseBiped.from_urdf(bolt, feet, 0.016)
    lower = FloatingBaseBiped.from_urdf(bolt, feet, 0.016, foot_offset=(0.0, 0.0, -0.02))
    assert lower.leg_length == pytest.approx(own.leg_length + 0.02)
    with pytest.raises(RobotError, match="foot_offset places the spheres of foot_radius"):
        FloatingBaseBiped.from_urdf(robot_path("five-link-3d"), foot_offset=(0.0, 0.0, -0.02))


def test_joints_of_a_free_robot_are_locked():
    path = path_of("talos_reduced.urdf")
    joints = ET.parse(path).getroot().findall("joint")
    names = [j.get("name") for j in joints if j.get("type") not in ("fixed", "floating")]
    with pytest.raises(RobotError, match="6 joints move foot 'left_sole_link'"):
        FloatingBaseBiped.from_urdf(path, TALOS["feet"], 0.02)
    with pytest.raises(RobotError, match="has no joint 'ankle'"):
        FloatingBaseBiped.from_urdf(path, TALOS["feet"], 0.02, locked={"ankle": 0.0})
    held = [n for n in names if n[:-7] not in ("leg_left_", "leg_right_") or n[-7] in "56"]
    ankles = [n for n in held if n.startswith("leg")]
    with pytest.raises(RobotError, match="make them fixed, or name them in `locked`"):
        FloatingBaseBiped.from_urdf(path, TALOS["feet"], 0.02, locked=dict.fromkeys(ankles, 0.0))
    robot = FloatingBaseBiped.from_urdf(path, TALOS["feet"], 0.02, locked=dict.fromkeys(held, 0.0))
    assert [len(leg) for leg in robot.legs] == [4, 4]
    assert robot.leg_length == pytest.approx(load("talos_reduced.urdf").leg_length)
    assert robot.mass == pytest.approx(load("talos_reduced.urdf").mass)
