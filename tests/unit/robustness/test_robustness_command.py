"""``template-control robustness``: its files, its mistakes, and its documentation."""

import json
import re
import shlex
from pathlib import Path

import pytest
from json_page import undocumented
from places import DOCS

from template_control.cli import robustness as command
from template_control.cli.experiment_options import experiment_from
from template_control.cli.main import build_parser, main
from template_control.robot.library import robot_path
from template_control.robustness import disturbances, severity_sweep
from template_control.robustness.disturbances import DISTURBANCES
from template_control.run.experiment import Experiment


@pytest.fixture
def brief(monkeypatch):
    """Trials of a few steps: what a trial says of a robot is tested where trials are."""
    for module in (disturbances, severity_sweep):
        monkeypatch.setattr(module, "BEGIN", 2)
        monkeypatch.setattr(module, "AFTER", 7)


@pytest.mark.slow(seconds=5)
@pytest.mark.usefixtures("brief")
def test_json_figure_and_resumption(tmp_path, capfd):
    arguments = ["robustness", "--quick", "--disturbance", "delay", "--workers", "2", "--json"]
    arguments += ["--output", str(tmp_path)]
    assert main(arguments) == 0
    captured = capfd.readouterr()
    figures = json.loads(captured.out)
    assert "level 2" in captured.err
    assert undocumented("robustness", figures) == set()
    delay = figures["disturbances"]["delay"]
    assert [level["level"] for level in delay["levels"]] == [0.002, 0.004]
    assert abs(figures["undisturbed"]["speed_error"]) < 0.02
    assert Path(figures["figure"]).is_file()
    before = {path: path.read_bytes() for path in tmp_path.glob("*.jsonl")}
    assert len(before) == 2
    assert main(arguments) == 0
    assert json.loads(capfd.readouterr().out) == figures
    assert {path: path.read_bytes() for path in tmp_path.glob("*.jsonl")} == before


@pytest.mark.slow(seconds=4)
@pytest.mark.usefixtures("brief")
def test_a_run_is_disturbed_as_a_walk_is(tmp_path, capfd):
    words = ["robustness", "--gait", "run", "--quick", "--disturbance", "step-up", "--workers", "1"]
    assert main([*words, "--json", "--output", str(tmp_path)]) == 0
    figures = json.loads(capfd.readouterr().out)
    assert set(figures["gait"]) == {"mean_speed", "apex_height"}
    assert undocumented("robustness", figures) == set()
    assert abs(figures["undisturbed"]["speed_error"]) < 0.02
    steps = figures["disturbances"]["step-up"]
    assert steps["breaking_point"] == pytest.approx(0.01)
    assert [level["level"] for level in steps["levels"]] == pytest.approx([0.005, 0.01])


def test_a_robot_that_cannot_walk_is_one_line(tmp_path, refused):
    weak = tmp_path / "weak.urdf"
    text = robot_path("five-link").read_text()
    weak.write_text(re.sub(r'effort="350[^"]*"', 'effort="40"', text))
    assert weak.read_text() != text
    line = refused(["robustness", "--robot", str(weak), "--output", str(tmp_path / "out")])
    assert "falls without a disturbance" in line
    assert str(weak) in line


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["--robot", "hexapod"], "hexapod"),
        (["--workers", "0"], "--workers is 0"),
        (["--speed", "9"], "five-link does not walk at a mean speed of 9 m/s"),
        (["--plant", "ideal"], "the world is ideal, whose friction cannot be disturbed"),
        (["--gait", "run", "--speed", "9"], "no running gait has 9 m/s at its apex"),
        (["--gait", "run", "--speed", "nan"], "--speed is nan"),
        (["--output", "/proc/none"], "/proc/none"),
    ],
)
def test_bad_input_is_one_line(arguments, culprit, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    line = refused(["robustness", *arguments])
    assert culprit in line
    assert not (tmp_path / "runs" / "robustness" / "hexapod").exists()


OWN = [
    *("--feet", "FL_FOOT", "FR_FOOT", "--foot-radius", "0.016"),
    *("--sagittal-joints", "FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE", "--locked", "FL_HAA=0.0"),
]


def test_a_robot_of_ones_own_is_understood_as_walk_understands_it(
    understood, tmp_path, monkeypatch, capfd
):
    words = ["--robot", str(robot_path("bolt")), *OWN]
    found = []

    def measured(subject, *_):
        found.append(subject)
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "measure", measured)
    assert main(["robustness", *words, "--output", str(tmp_path)]) == 130
    walked = understood(shlex.join(["template-control", "walk", *words]))
    assert found[0].robot == experiment_from(walked, Experiment()).robot
    assert found[0].robot.locked == {"FL_HAA": 0.0}


@pytest.mark.slow(seconds=4)
@pytest.mark.usefixtures("brief")
def test_a_robot_of_ones_own_takes_as_much_as_the_shipped_one_that_it_is(
    tmp_path, capfd, monkeypatch
):
    monkeypatch.setattr(severity_sweep, "_QUICK_LEVELS", 1)
    words = ["--disturbance", "delay", "--quick", "--json", "--workers", "1"]
    path, found = tmp_path / "own.urdf", []
    path.write_text(robot_path("five-link").read_text().replace("_foot", "_toe"))
    for name, own in (("five-link", []), (str(path), ["--feet", "left_toe", "right_toe"])):
        folder = str(tmp_path / f"trials-{len(found)}")
        assert main(["robustness", "--robot", name, *own, *words, "--output", folder]) == 0
        found.append(json.loads(capfd.readouterr().out)["disturbances"])
    assert found[0] == found[1]


def test_an_unknown_disturbance_is_refused(refused):
    assert "push-forward" in refused(["robustness", "--disturbance", "wind"])


def test_ctrl_c_tells_how_to_go_on(tmp_path, monkeypatch, capfd):
    def impatient(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "measure", impatient)
    assert main(["robustness", "--output", str(tmp_path)]) == 130
    assert "goes on from there" in capfd.readouterr().err


def commands():
    text = (DOCS / "guides" / "robustness.md").read_text()
    blocks = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    return [line for block in blocks for line in block.strip().splitlines()]


@pytest.mark.parametrize("line", commands())
def test_commands_of_the_documentation_are_understood(line):
    words = shlex.split(line)
    assert words[0] == "template-control"
    assert build_parser(words[1:]).parse_args(words[1:]).command == "robustness"


@pytest.mark.slow
def test_the_snippet_of_the_documentation_runs(capfd):
    text = (DOCS / "guides" / "robustness.md").read_text()
    (snippet,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(snippet, {})
    assert "fell: False" in capfd.readouterr().out


@pytest.mark.slow(seconds=6)
@pytest.mark.usefixtures("brief")
def test_the_quick_command_of_the_documentation_runs(tmp_path, monkeypatch, capfd):
    others = {"--gait", "--floating-base", "--plant"}
    (line,) = (x for x in commands() if "--quick" in x and not others & {*x.split()})
    # One level of two, and one trial of two: the test of the files runs all.
    monkeypatch.setattr(severity_sweep, "_QUICK_LEVELS", 1)
    monkeypatch.setattr(severity_sweep, "_QUICK_TRIALS", 1)
    monkeypatch.delenv("COLUMNS", raising=False)  # pytest's workers have one: titles would wrap
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(line)[1:]) == 0
    assert (tmp_path / "runs" / "robustness" / "five-link" / "robustness.png").is_file()
    out = capfd.readouterr().out
    assert all(d.title in out for d in DISTURBANCES)


@pytest.mark.slow(seconds=5)
@pytest.mark.usefixtures("brief")
def test_the_command_of_the_documentation_for_another_engine_runs(tmp_path, monkeypatch, capfd):
    (line,) = (x for x in commands() if "--plant" in x)
    monkeypatch.chdir(tmp_path)
    assert main([*shlex.split(line)[1:], "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["plant"] == "mujoco"
    assert (tmp_path / "runs" / "robustness" / "five-link-mujoco").is_dir()
    (level, _) = found["disturbances"]["noise"]["levels"]
    assert level["interval"] == [pytest.approx(0.342, abs=1e-3), 1.0]  # two of two
