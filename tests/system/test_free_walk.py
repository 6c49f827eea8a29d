"""Bolt walks in space on the planar template: straight on, and in a circle."""

import json
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.cli.experiment_options import experiment_from
from template_control.cli.main import main
from template_control.cli.report import joint_table
from template_control.errors import ParameterError
from template_control.robot.library import load_floating_robot
from template_control.run.record import load_record
from template_control.run.summary import summarise
from template_control.run.tables import columns
from template_control.terminal import show

STEPS = 12


def walked(course=None, steps=STEPS):
    robot = load_floating_robot("bolt")
    gait = tc.gait_at(tc.template_for(robot), np.radians(68.0), 0.6)
    return tc.simulate(
        tc.Experiment(
            robot, planner=tc.LqrPlanner(gait), steps=steps, course=course or tc.HeadingCommand()
        )
    ), gait


@pytest.fixture(scope="session")
def straight():
    return walked()


@pytest.mark.slow(seconds=4)
def test_bolt_walks_free(straight):
    record, gait = straight
    assert not record.fell, record.fall_reason
    assert record.steps == STEPS
    figures = summarise(record, None)
    assert figures["qp_failures"] == 0
    assert figures["mean_speed"] == pytest.approx(gait.mean_speed, rel=0.05)
    assert figures["attitude_rms"]["roll"] < 0.02
    assert figures["attitude_rms"]["pitch"] < 0.02
    assert figures["turned"] == 0.0
    # Feet never cross, and the way does not drift aside.
    assert figures["step_width"]["least"] > 0.02
    assert abs(record.space_com[-1, 1]) < 0.2
    assert np.all(np.abs(record.torque) <= 2.7 + 1e-9)
    ranges = {"HAA": 1.0, "HFE": 1.9, "KFE": 3.4}
    for joint, (name, angle) in enumerate(figures["joint_angle"].items()):
        assert angle["least"] == pytest.approx(record.q[:, 7 + joint].min())
        assert angle["most"] == pytest.approx(record.q[:, 7 + joint].max())
        assert angle["upper"] == -angle["lower"] == ranges[name[-3:]]
        assert angle["lower"] < angle["least"] < angle["most"] < angle["upper"]


@pytest.mark.slow(seconds=4)
def test_bolt_walks_slowly_too():
    """It fell at step 18 while the search priced no controls, and trusted the closed form."""
    robot = load_floating_robot("bolt")
    gait = tc.gait_for_speed(tc.template_for(robot), 0.4)
    planner = tc.LqrPlanner(gait, tc.embedding.FREE_PLANNER)
    record = tc.simulate(
        tc.Experiment(robot, planner=planner, steps=28, course=tc.HeadingCommand())
    )
    assert (record.steps, record.fell) == (28, False)
    assert record.summary.qp_failures == 0
    last = record.section_state[-10:].mean(axis=0) - gait.vlo
    assert np.all(np.abs(last) < [0.008, 0.003, 0.02])


@pytest.mark.slow(seconds=1)
def test_the_planar_part_is_the_view_of_the_space(straight):
    record, _ = straight
    np.testing.assert_allclose(record.com, record.space_com[:, [0, 2]], atol=1e-12)
    np.testing.assert_allclose(record.foot, record.space_foot[:, :, [0, 2]], atol=1e-12)
    np.testing.assert_allclose(record.contact_force, record.space_force[:, :, [0, 2]], atol=1e-9)


@pytest.mark.slow(seconds=1)
def test_a_record_is_read_as_it_was_written(straight, tmp_path):
    record, _ = straight
    again = load_record(record.save(tmp_path / "run.npz"))
    assert isinstance(again, tc.run.FloatingRecord)
    for name in ("q", "space_com", "attitude", "sway", "side_reference"):
        np.testing.assert_array_equal(getattr(again, name), getattr(record, name))
    table = columns(again)
    np.testing.assert_array_equal(table["attitude_yaw"].values, record.attitude[:, 2])
    assert table["v_wx"].unit == "rad/s"
    assert table["q_FL_HAA"].unit == "rad"
    assert again.metadata == json.loads(json.dumps(record.metadata))


@pytest.mark.slow(seconds=4)
def test_bolt_turns():
    """The heading turns at each section, and the path with it."""
    record, gait = walked(tc.HeadingCommand(turning_rate=0.25))
    assert not record.fell, record.fall_reason
    per_step = 0.25 * gait.step_duration
    assert record.heading[-1] == pytest.approx(STEPS * per_step, abs=1.01 * per_step)
    a, b = record.space_com[-400, :2], record.space_com[-1, :2]
    direction = np.arctan2(*(b - a)[::-1])
    assert direction == pytest.approx(record.heading[-1], abs=0.15)


def test_a_course_turns_at_its_times():
    course = tc.HeadingCommand(turning_rate=0.3, turns=((2.0, -0.2), (5.0, 0.0)))
    assert [course.rate(t) for t in (0.0, 1.9, 2.0, 4.9, 5.0)] == [0.3, 0.3, -0.2, -0.2, 0.0]
    with pytest.raises(ParameterError, match="rising"):
        tc.HeadingCommand(turns=((2.0, 0.1), (1.0, 0.2)))


def test_the_command_line_tells_a_course(refused, understood):
    line = "template-control walk --robot bolt --free --turn 0.3 --turn -0.2@2 --turn 0@5"
    wanted = experiment_from(understood(line), tc.Experiment()).course
    assert wanted == tc.HeadingCommand(turning_rate=0.3, turns=((2.0, -0.2), (5.0, 0.0)))
    told = refused(["walk", "--robot", "bolt", "--free", "--turn", "left", "--steps", "1"])
    assert "--turn left: rate is 'left': give a number" in told


@pytest.mark.slow(seconds=4)
def test_bolt_changes_its_speed_on_command():
    robot = load_floating_robot("bolt")
    command = tc.SpeedProfile(times=(0.0, 1.0, 4.0), speeds=(0.5, 0.5, 0.65))
    route = tc.SpeedRoute(tc.template_for(robot), command)
    record = tc.simulate(tc.Experiment(robot, route, steps=20))
    assert not record.fell, record.fall_reason
    gait = tc.gait_for_speed(tc.template_for(robot), 0.65)
    assert record.section_state[-3:, 0].mean() == pytest.approx(gait.vlo[0], rel=0.05)
    assert np.abs(record.attitude[:, :2]).max() < 0.02


@pytest.mark.slow(seconds=4)
def test_the_command_walks_free(tmp_path, capfd):
    words = ["walk", "--robot", "bolt", "--free", "--steps", "4", "--turn", "0.2", "--json"]
    assert main([*words, "--output", str(tmp_path / "run")]) == 0
    figures = json.loads(capfd.readouterr().out)
    assert figures["steps"] == 4
    assert figures["turned"] > 0.1
    assert {"from_above.png", "lateral_portrait.png", "attitude.png", "run.toml"} <= {
        path.name for path in (tmp_path / "run").iterdir()
    }


def test_a_joint_past_its_limit_is_told(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    joints = ("hip", "knee")
    figures = {
        "joint_torque": {joint: {"peak": 1.0, "rms": 0.5, "limit": 2.0} for joint in joints},
        "joint_speed": {joint: {"peak": 3.0, "limit": 4.0} for joint in joints},
        "joint_angle": {
            "hip": {"least": -0.5, "most": 0.2, "lower": -0.4, "upper": 0.4},
            "knee": {"least": 0.1, "most": 1.0, "lower": 0.0, "upper": 2.0},
        },
    }
    show(joint_table(figures))
    *_, hip, knee, _ = capsys.readouterr().out.splitlines()
    assert hip.split("│")[-2].strip() == "-0.50..0.20 of -0.40..0.40, past its limit"
    assert knee.split("│")[-2].strip() == "0.10..1.00 of 0.00..2.00"


def test_what_a_free_robot_cannot_do_is_refused(refused):
    assert "five-link" in refused(["walk", "--free", "--steps", "2"])
    assert "course" in refused(["walk", "--turn", "0.2", "--steps", "2"])
    robot = load_floating_robot("bolt")
    planner = tc.LqrPlanner(tc.default_gait(robot))
    for options, culprit in (
        (tc.Experiment(world=tc.IdealOptions()), "ideal"),
        (tc.Experiment(controller=tc.EmbeddingOptions(trunk_pitch=0.1)), r"of_kind\('free'\)"),
    ):
        with pytest.raises(ParameterError, match=culprit):
            tc.simulate(replace(options, robot=robot, planner=planner))
