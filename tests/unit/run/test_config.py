"""Run options in a file and on the command line: what a run writes repeats it to the last bit."""

import math
import re
import shlex
import shutil
import sys
import tomllib
from dataclasses import fields, replace

import numpy as np
import pytest
from places import DOCS, EXAMPLES

import template_control as tc
from template_control import settings
from template_control.cli.experiment_options import experiment_from
from template_control.cli.main import main
from template_control.plant import plant
from template_control.plant.plant import default_plant
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.run.specs import GaitSpec, OwnPlanner
from template_control.slip import Slot


def walk(folder, *arguments, command="walk"):
    """Exit status and record of a run without figures."""
    status = main([command, *arguments, "--no-figures", "--output", str(folder)])
    return status, tc.load_record(folder / "run.npz")


def assert_same_run(one, other):
    assert type(one) is type(other)
    for f in fields(one):
        if f.name == "metadata" or f.name.endswith("_seconds"):
            continue
        np.testing.assert_array_equal(getattr(one, f.name), getattr(other, f.name), err_msg=f.name)
    assert one.options == other.options


DISTURBED = (
    "--speed 1.2 --friction 0.6 --mass-scale 1.05 --torque-scale 0.9 --push -8@1:0.3 --push 5@0"
    " --noise 0.0005 --delay 0.002 --seed 3 --steps 2 --record-every 2"
)
KINDS_OF_RUN = {
    "disturbed": f"walk {DISTURBED}",
    "paper's planner": "walk --plant ideal --planner modified --map improved"
    " --touchdown-angle 66.5 --steps 1",
    "other robot": "walk --robot bolt --steps 1",
    "ahead": "walk --plant ideal --planner ahead --steps 1",
    "run": "run --robot runner --speed 2.5 --steps 1",
    "go": f"go {EXAMPLES / 'walk_run_walk.toml'} --robot runner --steps 2",
    "stand": f"walk --scenario {EXAMPLES / 'zero_five_zero.toml'} --steps 2",
    "floating base": "walk --robot bolt --floating-base --turn 0.2 --step-width 0.1 --steps 1",
    "estimate": "walk --estimate --seed 3 --contact-errors 0.001 --steps 1",
    "mujoco": "walk --plant mujoco --terrain slope:angle=2 --steps 1",
    "payload on another planet": "walk --plant-mass trunk=60 --gravity 5 --steps 1",
    "task by name": "walk --controller.tasks '{com = {gains = [80.0, 18.0]}}' --steps 1",
}


@pytest.mark.slow(seconds=1)
@pytest.mark.parametrize("kind", KINDS_OF_RUN)
def test_a_run_of_any_kind_writes_what_repeats_it_bit_by_bit(kind, tmp_path):
    command, *words = shlex.split(KINDS_OF_RUN[kind])
    status, first = walk(tmp_path / "first", *words, command=command)
    file = str(tmp_path / "first" / "run.toml")
    again, second = walk(tmp_path / "second", "--config", file, command=command)
    assert status == again == 0
    assert first.steps >= 1
    assert_same_run(first, second)
    texts = [(tmp_path / name / "run.toml").read_text() for name in ("first", "second")]
    assert texts[0] == texts[1]


@pytest.mark.slow(seconds=2)
def test_a_scenario_is_written_down_whole(tmp_path):
    path = tmp_path / "profile.toml"
    path.write_text('[[segment]]\ngait = "walk"\nspeed = 1.05\nsteps = 2\n')
    _, first = walk(tmp_path / "first", "--scenario", str(path))
    path.unlink()
    _, second = walk(tmp_path / "second", "--config", str(tmp_path / "first" / "run.toml"))
    assert_same_run(first, second)
    assert second.steps == 2


@pytest.fixture
def parsed(understood):
    """The experiment that a line describes."""

    def parse(line):
        return experiment_from(understood(f"template-control walk {line}"), Experiment())

    return parse


def test_every_option_has_its_place(parsed):
    simulation = parsed(DISTURBED)
    assert simulation.world == replace(default_plant(), friction=0.6, mass_scale=1.05)
    assert simulation.controller == tc.EmbeddingOptions(
        qp=tc.QpOptions(friction=0.6, torque_scale=0.9)
    )
    assert simulation.pushes == (tc.Push(-8.0, 1, 0.3), tc.Push(5.0, 0, 0.0))
    assert simulation.sensors == tc.SensorOptions(noise=5e-4)
    assert (simulation.delay, simulation.steps, simulation.record_every) == (0.002, 2, 2)
    assert simulation.seed == 3


def test_the_touchdown_angle_is_the_gaits(parsed):
    for line, speed in (
        ("--touchdown-angle 67", None),
        ("--touchdown-angle 67 --speed 1.15", 1.15),
    ):
        gait = parsed(line).prepare().gait
        assert gait.controls[Slot.TOUCHDOWN_ANGLE] == pytest.approx(math.radians(67.0))
        if speed is not None:
            assert gait.mean_speed == pytest.approx(speed)


def test_the_command_line_comes_before_the_file(parsed, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'steps = 9\n[robot]\nmodel = "rabbit"\n[motion]\nspeed = 0.8\n'
        '[planner]\nkind = "lqr"\noffset_gain = 0.1\n'
        '[world]\nkind = "pybullet"\nmass_scale = 1.1\n'
    )
    config = parsed(f"--config {path} --steps 3 --friction 0.5")
    assert config.robot == RobotSpec("rabbit")
    assert config.motion == GaitSpec(speed=0.8)
    assert config.planner == tc.LqrOptions(offset_gain=0.1)
    assert config.steps == 3
    assert config.world == tc.PlantOptions(friction=0.5, mass_scale=1.1)
    assert parsed(f"--config {path} --robot five-link --speed 1.2").robot == RobotSpec()


def test_long_walks_are_thinned_unless_told_otherwise(parsed, tmp_path):
    assert parsed("--steps 200").record_every == 1
    assert parsed("--steps 201").record_every == 5
    assert parsed("--steps 201 --record-every 2").record_every == 2
    path = tmp_path / "long.toml"
    path.write_text("steps = 201\n")
    assert parsed(f"--config {path}").record_every == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("step = 3", "unknown key step (did you mean steps?): known are robot,"),
        ("steps = 'x'", "steps is 'x': give a whole number"),
        ("delay = 0.0005", "delay is 0.0005 s: give a multiple"),
        ("[world]\nkind = 'moon'", "world.kind is 'moon': give one of"),
        ("[planner]\nkind = 'lqr'\ngain = 1", "unknown key planner.gain: known are state_cost"),
        ("[motion]\nname = 'jump'", "motion.name is 'jump': give one of walk, paper"),
        ("[motion]\nname = 'paper'\nspeed = 1.0", "speed does not go with gait paper"),
        ("[robot]\nmodel = 5", "robot.model is 5: give a text in quotes"),
        ("robot = 5", "robot is 5: give a table"),
        ("[", "is no TOML"),
    ],
)
def test_a_wrong_file_is_one_line_with_file_and_key(text, told, refused, tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    line = refused(["walk", "--config", str(path), "--output", str(tmp_path / "out")])
    assert str(path) in line
    assert told in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("--config none.toml", "cannot read none.toml"),
        ("--push 5", "--push 5: give IMPULSE@STEP or IMPULSE@STEP:PHASE"),
        ("--push x@2", "--push x@2: impulse is 'x': give a finite number"),
        ("--push 5@2.5", "--push 5@2.5: step is '2.5': give a whole number from 0 up"),
        ("--noise -1", "--noise is -1: give a number from 0 to 1"),
        ("--delay 2", "--delay is 2: give a number from 0 to 1"),
        ("--delay 0.0015", "give a multiple of the time step"),
        ("--touchdown-angle 90", "--touchdown-angle is 90: give a number from 1 to 89"),
        ("--touchdown-angle 20", "no walking gait with touchdown angle 20.00 deg"),
        ("--locked knee", "--locked knee: give JOINT=ANGLE"),
        ("--locked knee=0.1", "locked go with a URDF, not with five-link"),
        (
            "--planner best",
            "--planner is 'best': give lqr, ahead, modified, deadbeat or module:Class",
        ),
        ("--planner none_such:Planner", "there is no module none_such"),
        ("--planner math:Planner", "module math has no class Planner"),
        ("--planner queue:Empty:x", "module queue has no class Empty:x"),
        ("--map paper", "--map does not go with planner lqr"),
    ],
)
def test_a_wrong_option_is_one_line(line, told, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert told in refused(["walk", *line.split(), "--output", "out"])


def test_angles_of_locked_joints_reach_the_robot():
    feet, joints = ("FL_FOOT", "FR_FOOT"), ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE")
    path = str(tc.robot.robot_path("bolt"))
    choice = RobotSpec(path, feet, joints, 0.016)
    assert choice.load().name == "bolt"
    with pytest.raises(tc.TemplateControlError, match="turns about"):
        replace(choice, locked={"FL_HAA": 0.5}).load()


def test_a_urdf_is_found_from_any_folder(parsed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(tc.robot.robot_path("five-link"), "mine.urdf")
    config = parsed("--robot mine.urdf")
    config.save("run.toml")
    monkeypatch.chdir("/")
    assert Experiment.load(tmp_path / "run.toml").robot.load().name == "five-link"


PLANNER = """
import template_control as tc

class Mine(tc.LqrPlanner):
    pass

class Bare:
    def __init__(self, gait, sign):
        pass

class Half:
    def __init__(self, gait):
        self.gait = gait

    def reset(self):
        pass


class Nearly(Half):
    offset = decide = observe = None
"""


@pytest.fixture
def own_planner(tmp_path, monkeypatch):
    """A module ``own_planner_of_a_test`` in the current folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "own_planner_of_a_test.py").write_text(PLANNER)
    yield "own_planner_of_a_test"
    sys.modules.pop("own_planner_of_a_test", None)


def test_a_planner_of_ones_own_walks_and_is_written_down(own_planner, tmp_path):
    planner = f"{own_planner}:Mine"
    status, record = walk(tmp_path / "own", "--planner", planner, "--steps", "1")
    assert status == 0
    assert record.planner == "Mine"
    config = Experiment.load(tmp_path / "own" / "run.toml")
    assert config.planner == OwnPlanner(planner)


def test_what_a_planner_lacks_is_told(own_planner, refused):
    line = refused(["walk", "--planner", f"{own_planner}:Half"])
    assert f"{own_planner}:Half' lacks offset, retries, decide, decide_rest" in line
    line = refused(["walk", "--planner", f"{own_planner}:Nearly"])
    assert f"{own_planner}:Nearly' lacks retries, decide_rest, forget" in line
    assert "derive it from Planner" in line
    line = refused(["walk", "--planner", f"{own_planner}:Bare"])
    assert (
        f"{own_planner}:Bare' must take a gait alone: missing a required argument: 'sign'" in line
    )


def test_a_second_run_says_that_it_replaces_the_first(tmp_path, capfd):
    arguments = ["walk", "--steps", "1", "--no-figures", "--output", str(tmp_path)]
    assert main(arguments) == 0
    assert "replaced" not in capfd.readouterr().err
    assert main([*arguments, "--json"]) == 0
    assert f"the run in {tmp_path} will be replaced; --output" in capfd.readouterr().err


def test_the_file_that_the_page_shows_is_understood(tmp_path):
    page = (DOCS / "guides" / "options.md").read_text()
    (shown,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    path = tmp_path / "shown.toml"
    path.write_text(shown)
    config = Experiment.load(path)
    assert config.robot == RobotSpec("rabbit")
    assert config.planner == tc.LqrOptions(offset_gain=0.15)
    assert config.pushes == (tc.Push(3.0, 2, 0.25),)


def test_the_defaults_are_written_and_read():
    config = Experiment()
    assert (
        settings.from_table(Experiment, tomllib.loads(settings.text(settings.to_table(config))))
        == config
    )


def test_a_world_without_kind_is_the_engine_that_is_installed(tmp_path, monkeypatch):
    path = tmp_path / "world.toml"
    path.write_text("[world]\nfriction = 0.5\n")
    assert Experiment.load(path).world == replace(default_plant(), friction=0.5)
    monkeypatch.setattr(plant, "find_spec", lambda name: None)
    assert Experiment.load(path).world == tc.MujocoOptions(friction=0.5)
    kinds = {leaf.path: leaf.default for leaf in settings.leaves(Experiment)}
    assert kinds["world.kind"] == "mujoco"
