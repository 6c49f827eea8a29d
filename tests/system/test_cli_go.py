"""``template-control go`` as a user meets it, and the figures of a scenario."""

import json
from dataclasses import replace

import numpy as np
import pytest

from template_control.cli.main import main
from template_control.cli.report import add_template, tables
from template_control.run.record import Record
from template_control.run.summary import summarise
from template_control.slip.scenario.run import ScenarioRecord
from template_control.terminal import show

KEYS = {
    "robot", "completed", "fell", "fall_reason", "duration", "top_speed", "speed_error_rms",
    "nearest_speed_taken", "strides", "joint_torque", "joint_speed", "qp_failures", "template",
    "record",
}  # fmt: skip
SCENARIO = """
map = "exact"
start = [1.1, 0.978, 0.0]
vlo = [0.978, 0.0]
[[segment]]
gait = "walk"
speed = 1.1
steps = 1
[[segment]]
gait = "run"
speed = 1.3
steps = 2
[[segment]]
gait = "walk"
speed = 1.1
steps = 1
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "short.toml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def gone(scenario, tmp_path_factory):
    """Folder of the five-link robot's way through the short scenario."""
    folder = tmp_path_factory.mktemp("gone")
    assert main(["go", str(scenario), "--no-figures", "--output", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def record(gone):
    return Record.load(gone / "run.npz")


@pytest.fixture(scope="module")
def template(gone):
    return ScenarioRecord.load(gone / "template.npz")


@pytest.mark.slow(seconds=3)
def test_the_run_repeats_and_json_has_what_it_promises(gone, record, tmp_path, capfd):
    words = ["go", "--config", str(gone / "run.toml"), "--json", "--no-figures", "--output"]
    assert main([*words, str(tmp_path)]) == 0
    figures = json.loads(capfd.readouterr().out)
    assert set(figures) >= KEYS
    assert figures["completed"]
    assert figures["strides"] == {"walking": 2, "walk to run": 1, "running": 2, "run to walk": 1}
    assert set(figures["template"]) == {"completed", "top_speed", "speed_error_rms"}
    assert figures["record"] == str(tmp_path / "run.npz")
    again = Record.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.section_state, record.section_state)


def test_the_robot_does_what_its_template_does(record, template):
    assert template.completed
    assert record.fall_reason == ""
    assert record.solved.all()
    limit = record.torque_limit
    assert np.all(np.abs(record.torque) <= limit)
    assert record.kinds_of_stride[:-1] == list(template.strides)
    names = [record.sections[i] for i in record.section]
    assert names == ["VLO", "VLO", "APEX", "APEX", "APEX", "VLO", "VLO"]


def summarised(record, template):
    figures = summarise(record, None)
    add_template(figures, record, template)
    return figures


def test_what_is_told_is_in_the_records(record, template):
    figures = summarised(record, template)
    assert figures["record"] is None
    assert figures["top_speed"] == record.section_state[:, 0].max()
    wanted = np.array([1.1, 1.3, 1.3, 1.3, 1.1, 1.1])
    error = record.section_state[1:, 0] - wanted
    assert figures["speed_error_rms"] == pytest.approx(np.sqrt(np.mean(error**2)))
    other = template.section_state[1:, 0] - wanted
    assert figures["template"]["speed_error_rms"] == pytest.approx(np.sqrt(np.mean(other**2)))


def test_where_the_nearest_speed_was_taken_is_told(record, template, capfd):
    assert summarised(record, template)["nearest_speed_taken"]["strides"] == 0
    target = record.section_target.copy()
    target[3, 0] = record.section_predicted[3, 0] + 0.5  # further than a running stride leads
    figures = summarised(replace(record, section_target=target), template)
    assert figures["nearest_speed_taken"] == {"strides": 1, "most": pytest.approx(0.5)}
    show(*tables(figures))
    assert "1 times, 0.50 m/s off" in capfd.readouterr().out


def test_the_table_has_both_beside_each_other(scenario, tmp_path, capfd):
    words = ["go", str(scenario), "--steps", "1", "--no-figures", "--output", str(tmp_path)]
    assert main(words) == 0, "it did as many strides as it was to"
    out = capfd.readouterr().out
    for text in ("completed, robot / template", "top speed", "falls", "rad/s", "QP failures"):
        assert text in out


def changed(scenario, tmp_path, old, new):
    path = tmp_path / "changed.toml"
    path.write_text(scenario.read_text().replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("speed = 1.3", "speed = 6.5", "segment 2 wants to run at 6.5 m/s: five-link can run from"),
        ("speed = 1.3", "speed = 0.9", "segment 2 wants to run at 0.9 m/s: five-link can run from"),
        (
            "speed = 1.3",
            "speed = 1.3\nacceleration = 6.0",
            "segment 2 wants 6 m/s^2: a stride of five-link changes its speed by at most 2 m/s^2",
        ),
        ('"run"', '"trot"', "trot"),
        ("start = [1.1", "start = [0.2", "the start has 0.2 m/s at VLO"),
    ],
)
def test_what_the_robot_cannot_follow_is_refused(scenario, tmp_path, refused, old, new, told):
    path = changed(scenario, tmp_path, old, new)
    assert told in refused(["go", str(path), "--output", str(tmp_path / "out")])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "no scenario is given: name a file, such as examples/example_one.toml"),
        (["missing.toml"], "cannot read missing.toml"),
        (["page.md"], "page.md is no TOML"),
        (["other.toml"], "unknown key colour"),
    ],
)
def test_a_file_that_is_no_scenario_is_refused(arguments, told, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "page.md").write_text("# A page\n\nwith text")
    (tmp_path / "other.toml").write_text('colour = "red"\n')
    assert told in refused(["go", *arguments, "--output", "out"])


def test_ctrl_c_keeps_the_run_and_its_template(scenario, tmp_path, capfd, interrupted):
    assert main(["go", str(scenario), "--json", "--no-figures", "--output", str(tmp_path)]) == 130
    told = capfd.readouterr()
    assert not json.loads(told.out)["completed"]
    assert f"interrupted: the run up to here is in {tmp_path / 'run.npz'}" in told.err
    assert Record.load(tmp_path / "run.npz").steps == 2


def test_a_fall_exits_with_one_and_keeps_the_run(scenario, tmp_path, capfd):
    words = ["--torque-scale", "0.3", "--json", "--no-figures", "--output", str(tmp_path)]
    assert main(["go", str(scenario), *words]) == 1
    figures = json.loads(capfd.readouterr().out)
    assert figures["fell"]
    assert not figures["completed"]
    assert Record.load(tmp_path / "run.npz").fell
