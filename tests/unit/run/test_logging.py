"""What the library tells to the logger ``template_control``."""

import logging
import subprocess
import sys

import numpy as np
import pytest

import template_control as tc


def test_nothing_is_printed_unless_somebody_listens():
    code = """
import logging
import template_control
logging.getLogger("template_control.run").warning("not seen")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


@pytest.fixture
def weak_walk(robot, default_gait, caplog):
    """Messages of a walk whose motors are too weak."""
    with caplog.at_level(logging.DEBUG, "template_control"):
        record = tc.simulate(
            tc.Experiment(
                robot,
                planner=tc.LqrPlanner(default_gait),
                steps=10,
                controller=tc.EmbeddingOptions(qp=tc.QpOptions(torque_scale=0.07)),
                world=tc.PlantOptions(),
            )
        )
    assert record.fell
    assert not np.all(record.solved)
    return record, caplog.records


def test_start_end_and_fall_are_told(weak_walk):
    record, messages = weak_walk
    ends = ("run.simulation", "run.live")
    told = [(m.levelname, m.getMessage()) for m in messages if m.name.endswith(ends)]
    assert told[0][0] == "INFO"
    assert "pybullet" in told[0][1]
    assert ("WARNING", f"{record.robot_name} fell: {record.fall_reason}") in told
    assert repr(record) in told[-1][1]


def test_failures_of_the_qp_in_a_row_are_told_once(weak_walk):
    record, messages = weak_walk
    told = [m for m in messages if "the last torques are kept" in m.getMessage()]
    failing = ~record.solved
    rows = int(failing[0]) + int(np.sum(failing[1:] & ~failing[:-1]))
    assert len(told) == rows
    assert all(m.levelno == logging.WARNING for m in told)


def told_of(impulse, robot, gait, caplog, catches=True):
    """What is told of a walk that is pushed, and its record."""
    pushes, embedding = (tc.Push(impulse, step=1),), tc.EmbeddingOptions(catches=catches)
    with caplog.at_level(logging.DEBUG, "template_control"):
        record = tc.simulate(
            tc.Experiment(
                robot, planner=tc.LqrPlanner(gait), steps=4, pushes=pushes, controller=embedding
            )
        )
    return record, caplog.records


@pytest.mark.slow(seconds=3)
def test_every_section_is_told(robot, default_gait, caplog):
    record, told = told_of(-35.0, robot, default_gait, caplog)
    texts = [m.getMessage() for m in told if m.levelno == logging.DEBUG]
    assert sum("wanted" in text for text in texts) == record.steps == 4
    # What a section decided; a plan between two sections may replace it in the record.
    left = [m for m in told if "left its own law" in m.getMessage()]
    assert len(left) >= 1
    assert all(m.levelno == logging.INFO for m in left)


@pytest.mark.slow(seconds=2)
def test_a_stride_that_the_template_cannot_make_is_told(robot, default_gait, caplog):
    _, told = told_of(120.0, robot, default_gait, caplog, catches=False)
    (refused,) = [m for m in told if "no stride of the template" in m.getMessage()]
    assert refused.levelno == logging.WARNING
