"""``template-control walk`` as a user meets it."""

import json
import subprocess
import sys

import numpy as np
import pytest
from places import EXAMPLES
from printed import WALK_SPEEDS, go

from template_control.cli.main import main
from template_control.errors import RecordError
from template_control.robot.library import robot_path
from template_control.run.experiment import Experiment
from template_control.run.record import Record
from template_control.view.figures import FIGURES, save_figures

KEYS = {
    "robot", "gait", "steps", "fell", "fall_reason", "duration", "mean_speed", "vlo_target",
    "vlo_mean_last_50", "com_error_rms", "com_error_max", "joint_torque", "saturated_share",
    "qp_failures", "control_tick_seconds", "qp_solve_seconds", "real_time_factor", "record",
}  # fmt: skip


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "template_control.cli.main", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.mark.slow
def test_json_is_all_there_is_on_stdout(tmp_path):
    done = command("walk", "--steps", "3", "--json", "--output", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert set(figures) >= KEYS
    assert figures["steps"] == 3
    assert Record.load(figures["record"]).steps == 3
    assert {p.stem for p in (tmp_path / "out").glob("*.png")} == set(FIGURES) - {"apex_return"}


def test_table_and_no_figures(tmp_path, capfd):
    assert main(["walk", "--steps", "2", "--no-figures", "--output", str(tmp_path)]) == 0
    out = capfd.readouterr().out
    texts = ("steps", "falls", "mean speed", "CoM error", "left_knee", "real-time factor")
    for text in (*texts, "VLO, last 2 steps"):
        assert text in out
    assert not list(tmp_path.glob("*.png"))


SCENARIO = """
start = [1.1, 0.978, 0.0]
[[segment]]
gait = "walk"
speed = 1.1
steps = 2
[[segment]]
gait = "walk"
acceleration = -0.1
duration = 1.0
"""


@pytest.mark.slow(seconds=2)
def test_a_scenario_that_walks_is_walked(tmp_path, capfd):
    path = tmp_path / "slower.toml"
    path.write_text(SCENARIO)
    arguments = ["walk", "--scenario", str(path), "--json", "--no-figures"]
    assert main([*arguments, "--output", str(tmp_path)]) == 0
    figures = json.loads(capfd.readouterr().out)
    assert not figures["fell"]
    record = Record.load(figures["record"])
    # Two steps at the first speed; then steps of about half a second until the time is over.
    assert record.steps in (4, 5)
    target = record.section_target[:, 0]
    np.testing.assert_allclose(target[:2], 1.1)
    assert np.all(np.diff(target[1:-1]) < -0.02)
    assert figures["speed_error_rms"] < 0.08


@pytest.mark.slow
def test_the_example_walks_at_several_speeds_as_the_readme_prints_it(tmp_path, monkeypatch):
    record = go(WALK_SPEEDS, tmp_path, monkeypatch)
    assert record.summary.qp_failures == 0
    speed = record.section_state[:, 0]
    assert speed.min() < 0.97
    assert speed[-1] > 1.05
    example = str(EXAMPLES / "walk_speeds.toml")
    assert main(["slip", example, "--json", "--no-figures", "--output", str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("start = [1.1", "start = [0.03"), "the start has 0.03 m/s at VLO"),
        (("speed = 1.1", "sped = 1.1"), "unknown key segment[0].sped"),
    ],
)
def test_a_scenario_that_no_robot_walks_is_refused(refused, tmp_path, change, told):
    path = tmp_path / "scenario.toml"
    path.write_text(SCENARIO.replace(*change))
    assert told in refused(["walk", "--scenario", str(path), "--output", str(tmp_path)])


@pytest.mark.parametrize("other", [("--speed", "1"), ("--gait", "paper"), ("--seed", "1")])
def test_a_scenario_goes_alone(refused, tmp_path, other):
    path = tmp_path / "scenario.toml"
    path.write_text(SCENARIO)
    line = refused(["walk", "--scenario", str(path), *other, "--output", str(tmp_path)])
    assert f"{other[0].lstrip('-')} does not go with a scenario" in line


def test_a_fall_exits_with_one_and_keeps_the_run(tmp_path, capfd):
    arguments = ["walk", "--steps", "10", "--torque-scale", "0.2", "--json", "--no-figures"]
    assert main([*arguments, "--output", str(tmp_path)]) == 1
    figures = json.loads(capfd.readouterr().out)
    assert set(figures) >= KEYS
    assert figures["fell"]
    assert "step" in figures["fall_reason"]
    assert Record.load(tmp_path / "run.npz").fell


def test_ctrl_c_keeps_what_was_walked(tmp_path, capfd, interrupted):
    arguments = ["walk", "--steps", "100000", "--no-figures", "--output", str(tmp_path)]
    assert main(arguments) == 130
    told = capfd.readouterr()
    assert "mean speed" in told.out
    assert f"interrupted: the run up to here is in {tmp_path / 'run.npz'}" in told.err
    record = Record.load(tmp_path / "run.npz")
    assert record.steps == 2
    assert record.interrupted


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["--robot", "/nowhere/robot.urdf"], "/nowhere/robot.urdf"),
        (["--robot", "hexapod"], "hexapod"),
        (["--friction", "-0.1"], "--friction"),
        (["--friction", "nan"], "--friction"),
        (["--mass-scale", "7"], "--mass-scale"),
        (["--steps", "0"], "--steps"),
        (["--torque-scale", "0"], "--torque-scale"),
        (["--speed", "5"], "5 m/s"),
        (["--speed", "1", "--gait", "paper"], "speed does not go with gait paper"),
        (["--map", "paper"], "--map does not go with planner lqr"),
        (["--output", "/proc/none"], "/proc/none"),
        (["--seed", "-1"], "--seed"),
    ],
)
def test_bad_input_is_one_line(arguments, culprit, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    line = refused(["walk", *arguments])
    assert culprit in line


def test_a_robot_that_is_not_planar_is_one_line(tmp_path, capfd):
    text = robot_path("five-link").read_text()
    path = tmp_path / "bent.urdf"
    path.write_text(text.replace('"left_knee" type="revolute"', '"left_knee" type="continuous"'))
    assert main(["walk", "--robot", str(path), "--output", str(tmp_path)]) == 2
    assert "left_knee" in capfd.readouterr().err


def test_a_seed_moves_the_start(tmp_path):
    for seed in ("1", "2"):
        out = str(tmp_path / seed)
        assert main(["walk", "--steps", "1", "--seed", seed, "--no-figures", "--output", out]) == 0
    starts = [Record.load(tmp_path / s / "run.npz").section_state[0] for s in ("1", "2")]
    assert not np.allclose(starts[0], starts[1])


def test_a_file_that_is_no_run_is_refused(tmp_path):
    junk = tmp_path / "junk.npz"
    junk.write_bytes(b"not a zip file")
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    for path in (junk, other):
        with pytest.raises(RecordError, match="no recorded run"):
            Record.load(path)
    with pytest.raises(RecordError, match="there is no run"):
        Record.load(tmp_path / "missing.npz")
    old = tmp_path / "old.npz"
    for number in (1, 4):
        np.savez(old, metadata=np.array(f'{{"format": "template-control run {number}"}}'))
        with pytest.raises(RecordError, match=rf"another version .*run {number}'"):
            Record.load(old)


def test_figures_need_samples(tmp_path):
    main(["walk", "--steps", "1", "--no-figures", "--output", str(tmp_path)])
    record = Record.load(tmp_path / "run.npz")
    with pytest.raises(RecordError, match="cannot write"):
        save_figures(record, tmp_path / "missing")


def test_help_explains_every_option(capfd):
    with pytest.raises(SystemExit):
        main(["walk", "--help"])
    out = capfd.readouterr().out
    options = (
        "--robot --steps --speed --friction --torque-scale --seed --output --json --no-figures"
    )
    for option in options.split(" "):
        assert option in out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "kind"), [(("--noise", "1e-4"), "state"), (("--estimate",), "imu")]
)
def test_the_command_takes_wrong_flags_with_every_kind_of_sensors(tmp_path, capfd, words, kind):
    walk = ["walk", "--steps", "3", "--contact-errors", "1e-6", "--no-figures", "--json", *words]
    assert main([*walk, "--output", str(tmp_path)]) == 0
    sensors = Experiment.load(tmp_path / "run.toml").sensors
    assert (sensors.kind, sensors.contact_errors) == (kind, 1e-6)
    assert '"fell": false' in capfd.readouterr().out
