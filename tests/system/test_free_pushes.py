"""Pushes on a free robot: in any direction, from its heading, in either engine."""

from math import cos, radians, sin

import numpy as np
import pinocchio as pin
import pytest

import template_control as tc
from template_control.cli.experiment_options import experiment_from
from template_control.errors import ParameterError
from template_control.plant.bullet import BulletPlant
from template_control.plant.mujoco import MujocoPlant
from template_control.run.hand import plant_force

FORCE = (8.0, -5.0)  # [N] along x and y


@pytest.fixture(scope="module")
def bolt():
    return tc.load_floating_robot("bolt")


@pytest.mark.parametrize(
    "plant_of",
    [
        lambda robot: BulletPlant(robot, tc.PlantOptions()),
        lambda robot: MujocoPlant(robot, tc.MujocoOptions()),
    ],
    ids=("pybullet", "mujoco"),
)
def test_a_push_gives_its_impulse_to_the_whole_robot(bolt, plant_of):
    q, v = bolt.neutral(), np.zeros(bolt.nv)
    q[2] = 5.0
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.1, 0.2, 0.7]))).coeffs()
    nothing = np.zeros(len(bolt.joint_names))
    bolt.face(0.0, np.zeros(2))
    with plant_of(bolt) as plant:
        plant.reset(q, v)
        for _ in range(20):
            plant.step(nothing, *FORCE)
        for _ in range(5):
            plant.step(nothing)  # a push ends when it ends
        plant.read(q, v)
    bolt.update(q, v)
    gained = bolt.mass * bolt.space.com_velocity[:2]
    np.testing.assert_allclose(gained, 20e-3 * np.array(FORCE), rtol=1e-3)


def test_forward_is_the_heading(bolt):
    bolt.face(radians(30.0), np.zeros(2))
    forward, left = plant_force(bolt, 1.0, 0.0), plant_force(bolt, 0.0, 1.0)
    np.testing.assert_allclose(forward, (cos(radians(30.0)), sin(radians(30.0))))
    np.testing.assert_allclose(left, (-sin(radians(30.0)), cos(radians(30.0))))
    bolt.face(0.0, np.zeros(2))
    assert plant_force(tc.load_robot("five-link"), 3.0, 0.0) == (3.0,)


def test_the_command_line_tells_a_direction(understood, refused):
    line = "template-control walk --robot bolt --free --push 0.1@2:0.5:90 --push -0.1@3"
    pushes = experiment_from(understood(line), tc.Experiment()).pushes
    assert pushes == (tc.Push(0.1, 2, 0.5, direction=radians(90.0)), tc.Push(-0.1, 3))
    words = ["walk", "--robot", "bolt", "--free", "--steps", "4", "--push"]
    assert "direction is 'left': give a number from -360" in refused([*words, "0.1@2:0.5:left"])


def test_a_planar_robot_is_not_pushed_aside(refused, robot, gait):
    assert "take a floating-base robot" in refused(["walk", "--steps", "3", "--push", "5@1:0:90"])
    with pytest.raises(ParameterError, match="a push has a direction"):
        tc.simulate(
            tc.Experiment(
                robot,
                planner=tc.LqrPlanner(gait),
                steps=2,
                pushes=(tc.Push(5.0, 1, direction=0.5),),
            )
        )


@pytest.mark.slow(seconds=4)
def test_a_push_aside_is_taken_and_recorded(bolt):
    """10 N s to the left at 80 kg: the robot steps there, and walks on beside its old path."""
    planner = tc.LqrPlanner(tc.robot_gait_for_speed(bolt, 0.55), tc.embedding.FREE_PLANNER)
    push = tc.Push(0.094, 2, 0.25, 0.06, direction=radians(90.0))
    record = tc.simulate(tc.Experiment(bolt, planner=planner, steps=10, pushes=(push,)))
    assert not record.fell, record.fall_reason
    pushed = record.push != 0.0
    assert record.push[pushed] == pytest.approx(0.094 / 0.06)
    gained = np.diff(record.sway[pushed][[0, -1], 1])
    undisturbed = tc.simulate(tc.Experiment(bolt, planner=planner, steps=3))
    gained -= np.diff(undisturbed.sway[: len(pushed)][pushed[: len(undisturbed.sway)]][[0, -1], 1])
    assert gained == pytest.approx(0.094 / bolt.mass, rel=0.3)
