"""A run whose QP has no solution says so, and the causes that were the library's own are gone."""

import json
import logging
import warnings
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.cli.report import failures_text
from template_control.robustness.severity_sweep import trial
from template_control.run.live import QpFailures
from template_control.run.summary import summarise
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.lateral.path import lateral_path


def _weak(scale):
    """A walk whose motors are much too weak."""
    controller = tc.EmbeddingOptions(qp=tc.QpOptions(torque_scale=scale))
    return tc.Experiment(steps=10, controller=controller, world=tc.PlantOptions())


@pytest.mark.slow(seconds=1)
@pytest.mark.parametrize(("scale", "fails"), [(0.05, True), (1.0, False)])
def test_a_run_in_which_the_qp_fails_says_so_at_once(robot, default_gait, caplog, scale, fails):
    options = _weak(scale)
    with caplog.at_level(logging.WARNING, "template_control.run.live"):
        record = tc.simulate(replace(options, robot=robot, planner=tc.LqrPlanner(default_gait)))
    share = float(np.mean(~record.solved))
    assert (share > 0.5) is fails
    told = [m for m in caplog.records if m.name.endswith("live.failures")]
    assert len(told) == fails
    assert summarise(record, None)["qp_failed_share"] == pytest.approx(share)
    if fails:
        assert "five-link at 0." in told[0].getMessage()
        assert "no solution in 101 of the last" in told[0].getMessage()


@pytest.mark.skipif(find_spec("pybullet") is None, reason="in MuJoCo the QP is solved to the fall")
@pytest.mark.parametrize("json_too", [False, True])
def test_the_command_line_says_so_at_once_and_in_table_and_json(tmp_path, capsys, json_too):
    words = ["walk", "--steps", "3", "--torque-scale", "0.05", "--no-figures"]
    assert main([*words, "--output", str(tmp_path), *["--json"] * json_too]) == 1
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if "the QP had no solution in" in line]
    assert len(lines) == 1
    assert lines[0].startswith("template-control: five-link at 0.")
    if json_too:
        assert json.loads(out)["qp_failed_share"] > 0.5
    else:
        assert "no controlled" in out


def test_few_failures_are_no_warning(caplog):
    counted = QpFailures("robot")
    with caplog.at_level(logging.WARNING):
        for tick in range(2000):
            counted.tick(tick % 200 >= 100, 1e-3 * tick)
        assert not caplog.records
        for tick in range(2000):
            counted.tick(tick % 200 >= 101, 1e-3 * tick)
    assert len(caplog.records) == 1
    assert failures_text({"qp_failures": 3, "qp_failed_share": 3e-4}) == "3, 0.03 % of the ticks"


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.slow(seconds=6)
def test_a_swing_without_a_touchdown_in_sight_holds_its_foot(number):
    """Its reference was NaN, and no QP was solved from then on until the robot lay."""
    found = trial({"robot": {"model": "bolt", "free": True}}, "noise", 0.02, number)
    assert not found["fell"]
    assert found["steps"] == 20


def test_a_path_below_the_ground_leads_nowhere_and_warns_of_nothing(gait):
    start = (0.0, gait.vlo[1], gait.vlo[0], gait.vlo[2])
    stride = simulate_stride(gait.parameters, STRIDE_START["w"], start, gait.controls)
    assert np.isfinite(lateral_path([stride], 9.81).section)
    sunk = stride.cy.copy()
    sunk[0, 0] = -0.1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        below = lateral_path([replace(stride, cy=sunk)], 9.81)
    assert np.isinf(below.section)
