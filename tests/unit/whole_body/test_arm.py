"""Whole-body control alone, on a robot that is no biped."""

import re
import runpy

import numpy as np
import pinocchio as pin
import pytest
from places import ROOT

from template_control.errors import DivergedError, ParameterError, RobotError
from template_control.robot import FixedBaseRobot, load_floating_robot
from template_control.whole_body import (
    ComTask,
    FrameTask,
    JointTask,
    References,
    Rows,
    TaskStack,
    WholeBodyQp,
)

HAND = "effector_body"
RNG = np.random.default_rng(4)


def arm(limit=60.0):
    model = pin.buildSampleModelManipulator()
    model.name, model.effortLimit[:] = "manipulator", limit
    return FixedBaseRobot(model)


def rows_of(task, robot):
    stack = TaskStack([task], robot.nv)
    stack.write(robot, None)
    table = stack.table
    return Rows(table[:, : robot.nv], table[:, -3], table[:, -2], table[:, -1], table)


def test_the_arm_of_the_example_draws_its_circle(capsys):
    runpy.run_path(str(ROOT / "examples" / "arm.py"), run_name="__main__")
    told = re.findall(r"at most (\S+) mm off, (\S+) N m", capsys.readouterr().out)
    assert len(told) == 4
    assert all(float(away) < 1.0 for away, _ in told[1:])
    assert all(float(torque) <= 60.0 for _, torque in told)


@pytest.mark.parametrize("robot", [arm(), load_floating_robot("bolt")], ids=["arm", "bolt"])
def test_a_frame_and_its_bias_are_the_derivatives_of_its_place(robot):
    frame = HAND if robot.base_dof == 0 else robot.feet[0]
    q = pin.integrate(robot.model, pin.neutral(robot.model), 0.3 * RNG.normal(size=robot.nv))
    v, step = RNG.normal(size=robot.nv), 1e-6

    def at(time):
        robot.update(pin.integrate(robot.model, q, time * v), v)
        return robot.frame(frame)

    ahead, behind, now = at(step), at(-step), at(0.0)
    moved = (ahead.position - behind.position) / (2.0 * step)
    assert now.velocity == pytest.approx(moved, abs=1e-6)
    assert now.jacobian @ v == pytest.approx(now.velocity, abs=1e-12)
    sped = (ahead.velocity - behind.velocity) / (2.0 * step)  # v stays: no acceleration
    assert now.bias == pytest.approx(sped, abs=1e-5)


def test_without_limits_the_frame_accelerates_as_its_task_asks():
    robot = arm(1e4)
    q, v = RNG.uniform(-0.5, 0.5, robot.nq) + 0.6, 0.3 * RNG.normal(size=robot.nv)
    robot.update(q, v)
    task = FrameTask(HAND, gains=(64.0, 16.0))
    target = robot.frame(HAND).position + (0.02, -0.01, 0.03)
    task.set_target(target, (0.1, 0.0, -0.1), (0.0, 0.5, 0.0))
    stack = TaskStack([task, JointTask(q, weight=1e-9)], robot.nv)
    stack.write(robot)
    solution = WholeBodyQp(robot).solve(stack)
    a = pin.aba(robot.model, robot.model.createData(), q, v, solution.torque)
    assert solution.acceleration == pytest.approx(a, rel=1e-6, abs=1e-6)
    now = robot.frame(HAND)
    pull = 64.0 * (target - now.position) + 16.0 * ((0.1, 0.0, -0.1) - now.velocity)
    assert now.jacobian @ a + now.bias == pytest.approx(pull + (0.0, 0.5, 0.0), abs=2e-3)


def test_torques_stay_within_their_limits():
    robot = arm(5.0)
    robot.update(np.full(robot.nq, 0.5), np.zeros(robot.nv))
    stack = TaskStack([JointTask(np.full(robot.nq, 2.0))], robot.nv)
    stack.write(robot)
    solution = WholeBodyQp(robot).solve(stack)
    assert solution.solved
    assert np.abs(solution.torque).max() == pytest.approx(5.0)


def test_a_joint_task_asks_for_its_joints_alone():
    robot = arm()
    q, v = RNG.normal(size=robot.nq), RNG.normal(size=robot.nv)
    robot.update(q, v)
    task = JointTask(np.zeros(robot.nq), gains=(9.0, 6.0))
    task.set_target(np.ones(robot.nq), np.full(robot.nv, 0.5))
    rows = rows_of(task, robot)
    assert np.array_equal(rows.jacobian, np.eye(robot.nv))
    assert rows.desired == pytest.approx(9.0 * (1.0 - q) + 6.0 * (0.5 - v))


@pytest.mark.parametrize(
    ("task", "text"),
    [
        (FrameTask(HAND), f"the FrameTask of '{HAND}' has no target: call set_target"),
        (JointTask(np.zeros(2)), "the JointTask has 2 angles and manipulator has 6 joints"),
        (ComTask(), "manipulator is no biped, and a ComTask asks for one"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_task_that_does_not_fit_says_so(task, text):
    robot = arm()
    robot.update(np.zeros(robot.nq), np.zeros(robot.nv))
    with pytest.raises(ParameterError, match=re.escape(text)):
        TaskStack([task], robot.nv).write(robot, References())


def test_wrong_names_and_sizes_are_refused():
    robot, task = arm(), JointTask(np.zeros(6))
    with pytest.raises(RobotError, match="no frame 'hand': its frames are"):
        robot.frame("hand")
    with pytest.raises(ParameterError, match="set_target: position"):
        FrameTask(HAND).set_target((0.0, 1.0))
    with pytest.raises(ParameterError, match="the JointTask's target has 5 numbers: give 6"):
        task.set_target(np.zeros(5))
    with pytest.raises(ParameterError, match="the JointTask's target's velocity has 1 numbers"):
        task.set_target(np.zeros(6), np.zeros(1))
    with pytest.raises(DivergedError, match="not finite"):
        robot.update(np.full(6, np.nan), np.zeros(6))
    with pytest.raises(RobotError, match="several degrees of freedom"):
        FixedBaseRobot(pin.buildSampleModelHumanoid())


def test_the_tasks_of_a_biped_need_references():
    robot = load_floating_robot("bolt")
    with pytest.raises(ParameterError, match="follows References, and none are given"):
        TaskStack([ComTask()], robot.nv).write(robot)
