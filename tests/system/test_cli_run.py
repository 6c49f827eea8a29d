"""``template-control run`` as a user meets it, and what is told of a run."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from places import EXAMPLES

import template_control as tc
from template_control.cli.main import main
from template_control.run.record import Record
from template_control.run.summary import summarise
from template_control.slip.gaits.gait import flight_share
from template_control.slip.gaits.running_gait import running_gait
from template_control.view.figures import FIGURES, figures_of, save_figures

KEYS = {
    "robot", "gait", "steps", "fell", "fall_reason", "duration", "mean_speed", "apex_target",
    "apex_mean_last_50", "com_error_rms", "com_error_max", "joint_torque", "joint_speed",
    "saturated_share", "qp_failures", "flight_share", "duty_factor", "cost_of_transport",
    "control_tick_seconds", "qp_solve_seconds", "real_time_factor", "record",
}  # fmt: skip
STEPS = 3
SPEEDS = str(EXAMPLES / "walk_speeds.toml")


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Folder of a run of a few steps at 2.5 m/s."""
    folder = tmp_path_factory.mktemp("run")
    words = ["run", "--speed", "2.5", "--steps", str(STEPS), "--no-figures", "--output"]
    assert main([*words, str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def record(ran):
    return Record.load(ran / "run.npz")


def test_json_has_what_it_promises(tmp_path, capfd):
    words = ["run", "--steps", "2", "--json", "--no-figures", "--output", str(tmp_path)]
    assert main(words) == 0
    figures = json.loads(capfd.readouterr().out)
    assert set(figures) >= KEYS
    assert figures["gait"] == "run"
    assert figures["steps"] == 2
    assert not figures["fell"]
    assert set(figures["apex_target"]) == set(figures["apex_mean_last_50"]) == {"speed", "height"}
    assert figures["apex_target"]["speed"] == pytest.approx(3.0)
    assert set(figures["flight_share"]) == {"robot", "template"}
    for joint in figures["joint_torque"]:
        assert set(figures["joint_speed"][joint]) == {"peak", "limit"}


def test_the_table_tells_of_flight_and_joint_speeds(tmp_path, capfd):
    assert main(["run", "--steps", "1", "--no-figures", "--output", str(tmp_path)]) == 0
    out = capfd.readouterr().out
    for text in ("flight", "duty factor", "cost of transport", "speed [rad/s]", "apex, last"):
        assert text in out


@pytest.mark.parametrize("gait", ["walk", "run", "go"])
def test_a_joint_speed_past_its_limit_is_marked(tmp_path, capfd, gait, monkeypatch):
    """Limits that only the record knows: the torques of the run are as they were."""

    def narrowed(record, path):
        figures = summarise(record, path)
        fast = next(iter(figures["joint_speed"].values()))
        fast["limit"] = 0.9 * fast["peak"]
        return figures

    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr("template_control.cli.motion.summarise", narrowed)
    words = [gait, *([SPEEDS] if gait == "go" else [])]
    steps = ["--steps", "1", "--no-figures", "--output", str(tmp_path)]
    assert main([*words, *steps]) == 0
    rows = [row.split("│") for row in capfd.readouterr().out.splitlines() if ".." in row]
    past = ["past its limit" in speed for *_, speed, _, _ in rows]
    assert past == [True, False, False, False]


def test_apex_and_speed_are_those_asked_for(tmp_path):
    words = ["--speed", "2.2", "--apex", "0.985", "--steps", "1", "--no-figures", "--output"]
    assert main(["run", *words, str(tmp_path)]) == 0
    target = Record.load(tmp_path / "run.npz").section_target[0]
    np.testing.assert_allclose(target, [2.2, 0.985, 0.0])


def test_a_wrong_apex_is_named_as_the_option_is(tmp_path, refused):
    told = refused(["run", "--apex", "nan", "--output", str(tmp_path / "out")])
    assert "--apex is nan: give a number" in told


def test_a_run_is_repeated_by_its_file(ran, record, tmp_path):
    words = ["run", "--config", str(ran / "run.toml"), "--no-figures", "--output", str(tmp_path)]
    assert main(words) == 0
    again = Record.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.section_state, record.section_state)
    np.testing.assert_array_equal(again.torque, record.torque)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--speed", "9"], "no running gait has 9 m/s at its apex: give a speed from 1.2 to 5 m/s"),
        (["--speed", "0.8"], "no running gait has 0.8 m/s at its apex"),
        (["--speed", "9", "--robot", "bolt"], "give a speed from 0.72 to 2.99 m/s"),
        (
            ["--speed", "2", "--apex", "3"],
            "five-link cannot run at 2 m/s with its apex at 3 m: give",
        ),
        (["--apex", "0.9"], "with its apex at 0.9 m: give a height from 0.9"),
        (["--apex", "0.97", "--torque-scale", "0.3"], "its motors are too weak"),
        (["--config", "missing.toml"], "cannot read missing.toml"),
        (["--steps", "0"], "--steps"),
        (["--output", "/proc/none"], "/proc/none"),
    ],
)
def test_bad_input_is_one_line(arguments, told, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    assert told in refused(["run", *arguments])


def test_a_fall_exits_with_one_and_keeps_the_run(tmp_path, capfd):
    words = ["--torque-scale", "0.2", "--steps", "10", "--json", "--no-figures"]
    assert main(["run", *words, "--output", str(tmp_path)]) == 1
    figures = json.loads(capfd.readouterr().out)
    assert figures["fell"]
    assert set(figures) >= KEYS - {"apex_target", "apex_mean_last_50"}
    assert Record.load(tmp_path / "run.npz").fell


def test_ctrl_c_keeps_what_was_run(tmp_path, capfd, interrupted):
    words = ["run", "--steps", "100000", "--no-figures", "--output", str(tmp_path)]
    assert main(words) == 130
    told = capfd.readouterr()
    assert "flight" in told.out
    assert f"interrupted: the run up to here is in {tmp_path / 'run.npz'}" in told.err
    assert Record.load(tmp_path / "run.npz").steps == 2


def test_what_is_told_of_a_run_is_in_its_record(record):
    figures = summarise(record, None)
    joints = record.joints
    speed = record.v[:, -len(joints) :]
    for i, name in enumerate(joints):
        told = figures["joint_speed"][name]
        assert told["peak"] == pytest.approx(np.abs(speed[:, i]).max())
        assert told["limit"] == record.velocity_limit[i] == 20.0
        assert figures["joint_torque"][name]["peak"] == pytest.approx(
            np.abs(record.torque[:, i]).max()
        )
    # Each tick's power acted for the time since the one before.
    power = np.abs(record.torque * speed).sum(axis=1)
    work = float(np.sum(power[1:] * np.diff(record.time)))
    way = record.com[-1, 0] - record.com[0, 0]
    assert figures["cost_of_transport"] == pytest.approx(work / (80.0 * 9.81 * way), rel=1e-6)
    assert 0.3 < figures["cost_of_transport"] < 1.0

    stands = record.contact_force[:, :, 1] > 0.0
    flies = ~stands[:, 0] & ~stands[:, 1]
    assert figures["flight_share"]["robot"] == pytest.approx(np.count_nonzero(flies) / len(flies))
    template = flight_share(running_gait(tc.template_for(tc.load_robot("five-link")), 2.5))
    assert figures["flight_share"]["template"] == pytest.approx(template)
    # No foot stands for the flight's share; in a run never both do.
    one_foot = (1.0 - figures["flight_share"]["robot"]) / 2.0
    assert figures["duty_factor"] == pytest.approx(one_foot, abs=2e-3)
    assert figures["duty_factor"] == pytest.approx(stands.mean())


def test_what_is_told_of_a_walk(short_walk):
    figures = summarise(short_walk, None)
    assert figures["flight_share"] == {"robot": pytest.approx(0.0, abs=5e-3), "template": 0.0}
    assert 0.5 < figures["duty_factor"] < 0.7
    assert 0.05 < figures["cost_of_transport"] < 0.6


def test_a_run_has_a_figure_of_its_apexes_and_a_walk_has_none(record, short_walk):
    assert figures_of(record) == FIGURES
    assert set(FIGURES) - set(figures_of(short_walk)) == {"apex_return"}
    first = replace(record, **{n: getattr(record, n)[:1] for n in vars(record) if "section" in n})
    assert "apex_return" not in figures_of(first), "two apexes must follow each other"


@pytest.mark.slow(seconds=4)
def test_figures_of_a_run_are_not_empty(record, tmp_path):
    for path in save_figures(record, tmp_path):
        picture = imread(path)[..., :3]
        assert np.mean(picture.min(axis=2) < 0.8) > 0.005, f"{path} is empty"


def test_the_figures_show_limits_apexes_and_the_trunk(record):
    speeds = record.plot("joint_speeds")
    for axes, leg in zip(speeds.axes, record.legs, strict=True):
        levels = {float(line.get_ydata()[0]) for line in axes.lines}
        near = np.abs(record.v[:, 3:][:, list(leg)]).max() > 20.0 / 1.6
        assert near == ({20.0, -20.0} <= levels)
        assert near == (axes.get_title("right") != "limit ±20 rad/s, outside")
    speed, height = record.plot("apex_return").axes[:2]
    for axes, column in ((speed, 0), (height, 1)):
        (points,) = axes.collections
        z = record.section_state[:, column]
        np.testing.assert_allclose(points.get_offsets(), np.stack((z[:-1], z[1:]), axis=1))
    pitch, momentum = record.plot("turning").axes
    np.testing.assert_allclose(pitch.lines[0].get_ydata(), np.degrees(record.q[:, 2]))
    np.testing.assert_array_equal(momentum.lines[0].get_ydata(), record.angular_momentum)
