"""Every option of the command line is a key of an experiment's file, and every key an option."""

import json
from contextlib import suppress
from enum import Enum
from types import NoneType
from typing import Literal, get_args, get_origin

import pytest
from hypothesis import given
from hypothesis import settings as settings_of_hypothesis
from hypothesis import strategies as st

import template_control as tc
from template_control import settings
from template_control.cli.experiment_options import experiment_from
from template_control.cli.flags import ALL
from template_control.cli.main import build_parser
from template_control.errors import ParameterError
from template_control.robot.library import robot_path
from template_control.robot.spec import RobotSpec
from template_control.run.specs import GaitSpec, OwnPlanner

COMMANDS = ("walk", "run", "go", "drive", "robustness", "campaign")
WITHOUT_EXPERIMENT = {
    "robots", "replay", "plots", "study", "slip", "gaits", "automaton", "keys", "warm-up",
    "completion",
    "reproduce",
}  # fmt: skip
KEPT_ELSEWHERE = {
    "help", "config", "output", "json", "no_figures", "keys", "scenario",
    "figures", "format", "dpi", "start", "end", "no_title",
    "disturbance", "quick", "workers", "markdown", "trials", "mix", "severity", "draws",
    "port", "fps", "no_browser",
}  # fmt: skip
LEAVES = {leaf.path: leaf for leaf in settings.leaves(tc.Experiment)}
SCENARIO = tc.load_scenario("examples/walk_run_walk.toml")
BOLT = (str(robot_path("bolt")), "--feet FL_FOOT FR_FOOT --foot-radius 0.016")


def options_of(command):
    parser = build_parser([command])
    (commands,) = (a for a in parser._actions if a.dest == "command")
    return commands.choices[command]._actions


def test_every_command_that_runs_a_robot_is_looked_at():
    (commands,) = (a for a in build_parser([])._actions if a.dest == "command")
    assert set(commands.choices) == {*COMMANDS, *WITHOUT_EXPERIMENT}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_of_a_run_is_a_short_name_of_keys_of_its_file(command):
    known = {flag.dest: flag for flag in ALL}
    for action in options_of(command):
        if action.dest in KEPT_ELSEWHERE:
            continue
        for key in known[action.dest].keys.split():
            assert any(path == key or path.startswith(f"{key}.") for path in LEAVES), key
    long = {s for a in options_of(command) for s in a.option_strings if "." in s}
    assert long == {f"--{path}" for path in LEAVES if "." in path}


def test_the_help_of_an_option_is_plain_text():
    for action in options_of("walk"):
        assert action.help, action.dest
        assert not any(mark in action.help for mark in ("`", "None")), action.help


def written_and_read(experiment, tmp_path):
    path = experiment.save(tmp_path / "run.toml")
    again = tc.Experiment.load(path)
    assert again == experiment.resolved()
    assert again.save(tmp_path / "again.toml").read_text() == path.read_text()
    return again


@pytest.mark.parametrize(
    ("words", "key", "value"),
    [
        ("--robot human", "robot", RobotSpec("human")),
        ("--robot bolt --floating-base", "robot.free", True),
        ("--feet a b", "robot.feet", ("a", "b")),
        ("--sagittal-joints a b c d", "robot.sagittal_joints", ("a", "b", "c", "d")),
        ("--locked a=0.5", "robot.locked", {"a": 0.5}),
        ("--foot-radius 0.02", "robot.foot_radius", 0.02),
        ("--foot-offset 0 0 -0.1", "robot.foot_offset", (0.0, 0.0, -0.1)),
        ("--lossless", "robot.lossless", True),
        ("--flat-feet", "robot.flat_feet", True),
        ("--upper-body", "robot.upper_body", True),
        ("--gravity 1.62", "robot.gravity", 1.62),
        ("--mass trunk=60", "robot.masses", {"trunk": 60.0}),
        ("--plant-gravity 9.7", "world.gravity", 9.7),
        ("--robot human --gravity 9 --plant-robot runner", "world.robot", RobotSpec("runner")),
        ("--robot human --plant-mass trunk=50", "world.robot.model", "human"),
        ("--plant-mass trunk=50", "world.robot.masses", {"trunk": 50.0}),
        ("--scenario examples/walk_run_walk.toml", "motion", SCENARIO),
        ("--gait paper", "motion.name", "paper"),
        ("--speed 0.9", "motion.speed", 0.9),
        ("--touchdown-angle 67", "motion.touchdown_angle", 67.0),
        ("--gait run --apex 1.02", "motion.apex_height", 1.02),
        ("--from-stand", "motion.from_stand", True),
        ("--to-stand", "motion.to_stand", True),
        ("--planner math:Planner", "planner", OwnPlanner("math:Planner")),
        ("--planner modified --map paper", "planner.map_kind", tc.MapKind.PAPER),
        ("--strict", "strict", True),
        ("--no-catch", "controller.catches", False),
        ("--plant ideal", "world", tc.IdealOptions()),
        ("--friction 0.5", "world.friction", 0.5),
        ("--friction 0.5", "controller.qp.friction", 0.5),
        ("--plant ideal --friction 0.5", "controller.qp.friction", 0.5),
        ("--terrain slope:angle=4", "world.terrain", "slope"),
        ("--mass-scale 1.1", "world.mass_scale", 1.1),
        ("--torque-scale 0.9", "controller.qp.torque_scale", 0.9),
        ("--push 5@1", "pushes", (tc.Push(5.0, 1),)),
        ("--noise 0.001", "sensors.noise", 1e-3),
        ("--contact-errors 0.01", "sensors.contact_errors", 0.01),
        ("--estimate", "sensors.kind", "imu"),
        ("--estimate --seed 3", "sensors.seed", 3),
        ("--delay 0.002", "delay", 2e-3),
        ("--seed 3", "seed", 3),
        ("--turn 0.1 --turn 0.2@3", "course.turns", ((3.0, 0.2),)),
        ("--step-width 0.2", "course.step_width", 0.2),
        ("--side-speed 0.1", "course.side_speed", 0.1),
        ("--steps 7", "steps", 7),
        ("--record-every 3", "record_every", 3),
    ],
)
def test_a_short_option_sets_its_key(words, key, value, understood, tmp_path):
    experiment = experiment_from(understood(f"template-control walk {words}"), tc.Experiment())
    found = written_and_read(experiment, tmp_path)
    for name in key.split("."):
        found = getattr(found, name)
    if value == "slope":
        assert found.height_at(20.0) - found.height_at(19.0) == pytest.approx(0.0699, abs=1e-3)
    else:
        assert found == value


def test_every_short_option_is_tried_above():
    marks = test_a_short_option_sets_its_key.pytestmark
    (cases,) = (m.args[1] for m in marks if m.name == "parametrize")
    tried = {word for words, *_ in cases for word in words.split() if word.startswith("--")}
    assert {flag.names.split()[0] for flag in ALL} <= tried


KINDS = {
    "motion": {"gait": {}, "scenario": {"motion": SCENARIO}},
    "controller": {"planar": {}, "free": {"robot": RobotSpec("bolt", free=True)}},
}


def base_for(path):
    """An experiment whose file has the key: of its table's kind."""
    table = path.partition(".")[0]
    yield tc.Experiment()
    for keys in KINDS.get(table, {}).values():
        yield tc.Experiment().with_(keys)
    if table == "motion":
        yield tc.Experiment(motion=tc.run.VelocityProfile(((0.0, 1.0, 0.0, 0.0),), duration=5.0))
    for name in ("lqr", "ahead", "modified", "deadbeat", "mujoco", "ideal", "imu"):
        try:
            yield tc.Experiment().with_({f"{table}.kind": name})
        except ParameterError:
            continue


def another(hint, default):
    """A value that fits an annotation and is not the default."""
    arguments = [a for a in get_args(hint) if a is not NoneType]
    if get_origin(hint) is Literal:
        return next(a for a in arguments if a != default)
    if NoneType in get_args(hint):
        return another(arguments[0], default)
    if get_origin(hint) is tuple:
        many = arguments[-1] is Ellipsis
        of = default if default and len(default) else [None] * (1 if many else len(arguments))
        kinds = [arguments[0]] * len(of) if many else arguments
        return [another(kind, x) for kind, x in zip(kinds, of, strict=True)]
    if hint is bool:
        return not default
    if isinstance(hint, type) and issubclass(hint, Enum):
        return next(m.name.lower() for m in hint if m is not default)
    if hint is float:
        return 0.5 if not default else 0.99 * default
    return {int: 1 + (default or 0), str: "x"}[hint]


OTHERWISE = {
    "robot.model": "human", "robot.locked": {"a": 0.1}, "robot.feet": ["a", "b"],
    "robot.groups": [[0, 2], [1, 3]], "world.robot.groups": [[0, 2], [1, 3]],
    "motion.kind": "gait", "motion.segments": [{"gait": "walk", "speed": 1.0, "steps": 3}],
    "motion.velocities": [[0.0, 0.5, 0.0, 0.0]], "motion.gaits": ["stand", "walk"],
    "motion.speed": 1.0, "motion.touchdown_angle": 66.0, "motion.start": [1.0, 0.97, 0.0],
    "motion.to_stand": True, "controller.kind": "planar", "pushes": [{"impulse": 5.0, "step": 2}],
    "world.kind": "mujoco", "sensors.kind": "imu", "planner.kind": "ahead", "delay": 0.003,
    "world.terrain.points": [[0.0, 0.0], [1.0, 0.1]], "course.turns": [[1.0, 0.1]],
    "planner.path": "math:Planner", "start": [1.0, 0.97, 0.0], "world.time_step": 5e-4,
    "controller.tasks": {"com": {"gains": [80.0, 18.0]}},
    "planner.map_kind": "paper", "robot.masses": {"a": 1.0}, "world.robot.masses": {"a": 1.0},
    "controller.lean.strides": {"r": {"speeds": [0.3], "pitches": [0.1]}},
    "world.robot.model": "human", "world.robot.locked": {"a": 0.1}, "world.robot.feet": ["a", "b"],
}  # fmt: skip
POSE = {
    "pose.com": [0.0, 0.97], "pose.com_velocity": [1.0, 0.0],
    "pose.feet": [[0.0, 0.0], [0.1, 0.1]], "pose.feet_velocity": [[0.0, 0.0], [2.0, 0.0]],
}  # fmt: skip
NEEDS_MORE = (
    "world.terrain.friction", "planner.path",
)  # fmt: skip
"""Keys of tables that have other keys which must be given with them."""


@pytest.mark.parametrize("path", LEAVES)
def test_every_key_is_an_option_that_its_file_holds(path, understood, tmp_path):
    leaf, last = LEAVES[path], None
    value = OTHERWISE.get(path) or POSE.get(path) or another(leaf.hint, leaf.default)
    needed = POSE if path.startswith("pose.") else {}
    for base in base_for(path) if "." in path else [tc.Experiment()]:
        try:
            experiment = base.with_({**needed, path: value})
        except tc.TemplateControlError as error:
            last = str(error)
            continue
        break
    else:
        assert path.startswith(NEEDS_MORE), last
        return
    again = written_and_read(experiment, tmp_path)
    table = settings.to_table(again)
    for name in path.split("."):
        table = table[name]
    assert table == pytest.approx(value) if isinstance(value, float) else table is not None
    if "." not in path:
        return
    words = (f"--{key} '{settings.literal(x)}'" for key, x in {**needed, path: value}.items())
    line = understood(f"template-control walk {' '.join(words)}")
    assert experiment_from(line, base).resolved() == experiment.resolved()


SIMPLE = sorted(
    path
    for path, leaf in LEAVES.items()
    if leaf.hint in (bool, float, int)
    and path.startswith(("controller.", "planner.", "falls.", "record_every", "strict"))
    and path not in OTHERWISE
)
"""Keys that any default experiment has or another kind of its tables, with a default."""


@pytest.mark.slow(seconds=2)
@given(st.sets(st.sampled_from(SIMPLE), max_size=8), st.sampled_from(["five-link", "bolt"]))
@settings_of_hypothesis(max_examples=40, deadline=None, derandomize=True)
def test_any_keys_together_are_options_that_their_file_holds(tmp_path_factory, paths, model):
    base = tc.Experiment(model)
    keys = {path: another(LEAVES[path].hint, LEAVES[path].default) for path in sorted(paths)}
    kept = {}
    for path, value in keys.items():  # of the kinds of table that this experiment has
        with suppress(tc.TemplateControlError):
            base.with_({**kept, path: value})
            kept[path] = value
    words = [f"--{p}={settings.literal(v)}" for p, v in kept.items() if "." in p]
    words += [f"--{p.replace('_', '-')}" for p in kept if p == "strict"]
    words += [f"--record-every={v}" for p, v in kept.items() if p == "record_every"]
    options = build_parser(["walk"]).parse_args(["walk", "--robot", model, *words])
    experiment = experiment_from(options, tc.Experiment())
    assert experiment.resolved() == base.with_(kept).resolved()
    written_and_read(experiment, tmp_path_factory.mktemp("keys"))


def test_a_key_of_a_text_needs_no_quotes(understood):
    line = understood("template-control walk --motion.name run --world.friction=0.4 --steps 3")
    found = experiment_from(line, tc.Experiment())
    assert found.motion == GaitSpec("run")
    assert found.world.friction == 0.4
    assert found.resolved().controller.qp.friction == 0.7, "it is another key"


def test_keys_come_before_those_of_the_file(understood, tmp_path):
    path = tc.Experiment(steps=9, world=tc.PlantOptions(friction=0.5)).save(tmp_path / "a.toml")
    line = understood(f"template-control walk --config {path} --world.friction 0.6")
    found = experiment_from(line, tc.Experiment())
    assert (found.steps, found.world.friction) == (9, 0.6)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("--world.friction x", "world.friction is 'x': give a number"),
        ("--world.friction -1", "world.friction is -1: give a positive number"),
        ("--plant pybullet --world.contact_time 0.01", "unknown key world.contact_time: known are"),
        ("--world.frictoin 1", "--world.frictoin"),
        ("--motion.speed 1 --scenario examples/walk_speeds.toml", "unknown key motion.speed"),
        ("--planner.kind jump", "planner.kind is 'jump': give one of lqr, ahead"),
        ("--speed 1 --scenario examples/walk_speeds.toml", "--speed does not go with a scenario"),
    ],
)
def test_a_wrong_key_is_one_line(words, told, refused, tmp_path):
    assert told in refused(["walk", *words.split(), "--output", str(tmp_path)])


def test_all_keys_are_listed(capfd):
    from template_control.cli.main import main

    assert main(["keys"]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert [line.split(" = ")[0].removesuffix(" =") for line in lines] == list(LEAVES)
    assert "world.friction = 0.7  # Coulomb coefficient between foot and ground" in lines
    assert not [leaf.path for leaf in LEAVES.values() if not leaf.about]
    assert main(["keys", "--json"]) == 0
    assert list(json.loads(capfd.readouterr().out)) == list(LEAVES)
    assert main(["keys", "friction"]) == 0
    assert all("friction" in line for line in capfd.readouterr().out.splitlines())


def test_another_kind_of_world_keeps_what_both_have():
    found = tc.Experiment(world=tc.PlantOptions(mass_scale=1.1, friction=0.5))
    assert found.with_({"world.kind": "mujoco"}).world == tc.MujocoOptions(
        friction=0.5, mass_scale=1.1
    )
    assert found.with_({"world.kind": "ideal"}).world == tc.IdealOptions(mass_scale=1.1)


def test_objects_cannot_be_written(robot, default_gait, tmp_path):
    planner = tc.LqrPlanner(default_gait)
    for experiment, name in (
        (tc.Experiment(robot), "robot is PlanarBiped"),
        (tc.Experiment(planner=planner), "planner is LqrPlanner"),
        (tc.Experiment(motion=default_gait), "motion is WalkingGait"),
    ):
        with pytest.raises(ParameterError, match=f"^{name}, which TOML cannot say$"):
            experiment.save(tmp_path / "run.toml")


def test_a_word_that_is_in_no_key_is_refused(refused):
    assert "no key has 'frictoin' in it" in refused(["keys", "frictoin"])
