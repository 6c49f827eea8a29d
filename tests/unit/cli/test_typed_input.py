"""What a user types: each wrong value is refused in one line, by the option's name and its unit."""

import argparse
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control import slip
from template_control.checks.fitting import inward
from template_control.checks.typed import entries, number
from template_control.cli.main import _COMMANDS, build_parser
from template_control.errors import GaitError, ParameterError, RecordError, RobotError
from template_control.plant.terrain import KINDS, Terrain, terrain_from
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robustness.campaign import DisturbanceDistribution
from template_control.run.experiment import Experiment
from template_control.run.tables import quantities
from template_control.storage import writing

INTERNAL = re.compile(r"\b[A-Z][a-z]+[A-Za-z]*\.[a-z_]+")
POSITIONALS = {"plots": ["x"], "replay": ["x"], "slip": ["x"], "reproduce": ["fig6"]}


def option_actions(command):
    """The options of a command that take a value."""
    parser = build_parser([command])
    (commands,) = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return [a for a in commands.choices[command]._actions if a.option_strings and a.nargs != 0]


NUMBERS = [
    (command, action.option_strings[0], action.nargs if isinstance(action.nargs, int) else 1)
    for command in _COMMANDS
    for action in option_actions(command)
    if action.type is not None and "path" not in getattr(action.type, "__name__", "")
]
PATHS = [
    (command, action.option_strings[0])
    for command in _COMMANDS
    for action in option_actions(command)
    if getattr(action.type, "__name__", "") == "path"
]


def test_no_option_reads_its_value_in_a_way_of_its_own():
    plain = [
        (command, action.option_strings[0])
        for command in _COMMANDS
        for action in option_actions(command)
        if action.type in (int, float) or getattr(action.type, "__name__", "") == "Path"
    ]
    assert not plain
    assert len(NUMBERS) > 40


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "abc", "", "1e999"])
def test_a_number_that_is_none_names_its_option(text, refused):
    # All are read in one way: each text is tried with some of them, and one with all.
    some = [*NUMBERS[::9], *(number for number in NUMBERS if number[2] > 1)]
    for command, flag, count in NUMBERS if text == "nan" else some:
        words = [command, *POSITIONALS.get(command, ()), *[f"{flag}={text}"]]
        if count > 1:
            words = [*words[:-1], flag, f" {text}", *["1"] * (count - 1)]
        line = refused(words)
        assert re.search(rf"{flag} is '? ?{text}'?: give a", line), line
        assert not INTERNAL.search(line)


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("walk --foot-offset -0.1 0 -2e-3", "foot_offset", [-0.1, 0.0, -2e-3]),
        ("walk --push -20@4:0.5 --push -.5@2", "push", ["-20@4:0.5", "-.5@2"]),
        ("gaits --limits -1 -0.5", "limits", [-1.0, -0.5]),
        ("walk --course.side_speed -0.1", "keys", {"course.side_speed": -0.1}),
    ],
)
def test_a_value_may_begin_with_a_minus(line, name, value, understood):
    assert getattr(understood(f"template-control {line}"), name) == value


def test_an_empty_path_is_refused_by_every_command(refused):
    assert len(PATHS) > 10
    for command, flag in PATHS:
        for text in ("", " "):
            line = refused([command, *POSITIONALS.get(command, ()), f"{flag}={text}"])
            assert f"{flag} is empty: give a path" in line


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("walk --push 5@1:90", "--push 5@1:90: phase is 90: give a number from 0 to 1"),
        ("walk --push nan@1", "--push nan@1: impulse is nan: give a finite number"),
        ("walk --push 5@-1", "--push 5@-1: step is -1: give a whole number from 0 up"),
        ("walk --free --robot bolt --push 5@1:0:400", "direction is 400: give a number from -360"),
        ("walk --free --robot bolt --turn 9", "--turn 9: rate is 9: give a number from -2 to 2"),
        ("walk --free --robot bolt --turn 1@x", "--turn 1@x: time is 'x': give a number from 0 up"),
        ("walk --free --robot bolt --turn 1 --turn 0.5", "--turn has two rates from 0 s on"),
        ("walk --free --robot bolt --turn 1@2 --turn 0.5@2", "--turn has two rates from 2 s on"),
        ("walk --free --robot bolt --step-width -1", "--step-width is -1: give a number above 0"),
        ("walk --robot x.urdf --locked a=90", "--locked a is 90: give a number from -6.3 to 6.3"),
        ("walk --robot x.urdf --locked a=1 a=2", "--locked: a is given twice: give it once"),
        ("walk --terrain slope:angle=60", "angle is 60: give a number from -45 to 45"),
        ("walk --terrain step:height=0.1,x=2,x=3", "x is given twice: give it once"),
        ("walk --terrain stairs:rise=0.1,run=1,count=1000000000", "count is 1000000000: give a"),
        ("gaits --fix height=0.98 --fix height=0.97", "--fix: height is given twice"),
        ("gaits --start angle=70 --start angle=71", "--start: angle is given twice"),
        ("gaits --start angle=200", "--start angle is 200: give a number above 0 and below 90"),
        ("gaits --step 0", "--step is 0: give a number above 0 and up to 0.5"),
        ("gaits --limits 0 4", "--limits is 0: give a positive number"),
        ("gaits --family --fix height=0.98", "--fix does not go with --family"),
        ("campaign --severity 50 --trials 1", "the mix 50 times as severe: friction is"),
        ("campaign --speed 11", "--speed is 11: give a number from 0.01 to 10"),
    ],
)
def test_a_wrong_value_is_named_as_it_was_typed(line, told, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = refused(line.split())
    assert told in said
    assert not INTERNAL.search(said)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [kind for kind, (_, keys) in KINDS.items() if keys])
def test_every_key_of_every_terrain_is_taken_once(kind):
    for key in KINDS[kind][1]:
        with pytest.raises(ParameterError, match=f"{key} is given twice"):
            terrain_from(f"{kind}:{key}=1,{key}=2")


def test_entries_are_read_as_declared():
    assert entries("--x", ["a=1", "b=c=2"], "KEY=VALUE") == {"a": "1", "b=c": "2"}
    assert number("--x", "3", int) == 3
    for text in ("a", "=1"):
        with pytest.raises(ParameterError, match=f"--x {text}: give KEY=VALUE"):
            entries("--x", [text], "KEY=VALUE")


@pytest.mark.slow(seconds=1)
@pytest.mark.parametrize(
    "make",
    [
        lambda: Terrain.stairs(0.0, 1e-9, 1_000_000),
        lambda: Terrain.random_steps(0.01, (1e-9, 1e-8)),
        lambda: Terrain.of_function(lambda _: 0.0, 100.0, 1e-9),
        lambda: Terrain(tuple((1e-3 * i, 0.0) for i in range(100_001))),
        lambda: terrain_from("random:height=0.02,shortest=1e-9,longest=1e-8"),
    ],
)
def test_ground_of_more_points_than_can_be_simulated_is_refused(make):
    with pytest.raises(ParameterError, match="at most 100000 points"):
        make()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[motion]\nspeed = 99.0\n", "motion.speed is 99: give a number above 0 and up to 20"),
        ("[motion]\ntouchdown_angle = 90.0\n", "motion.touchdown_angle is 90: give"),
        ("steps = 0\n", "steps is 0: give a whole number from 1"),
        ("[world]\nfriction = -1.0\n", "world.friction is -1: give"),
        (
            "[[pushes]]\nimpulse = 1.0\nphase = 9.0\n",
            "pushes[0].phase is 9:",
        ),
        ("[course]\nstep_width = -1.0\n", "course.step_width is -1"),
    ],
)
def test_a_wrong_value_in_a_file_is_named_by_its_key(text, told, tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(text)
    with pytest.raises(ParameterError) as caught:
        Experiment.load(path)
    assert told in str(caught.value)
    assert not INTERNAL.search(str(caught.value).replace("run.toml", ""))


@pytest.mark.parametrize("speed", [-1.0, np.nan, 99.0])
def test_no_speed_is_refused_wherever_it_is_wanted(speed):
    with pytest.raises(tc.TemplateControlError, match="from 0 to 20"):
        slip.SpeedProfile((0.0,), (speed,))


@pytest.mark.parametrize("speed", [0.0, -1.0, np.nan, 99.0])
def test_no_speed_of_a_walk_or_a_run_is_refused_in_a_scenario(speed):
    for make in (
        lambda: slip.Segment("walk", speed=speed, steps=1),
        lambda: slip.Segment("run", acceleration=1.0, until_speed=speed),
    ):
        with pytest.raises(tc.TemplateControlError, match="above 0 and up to 20"):
            make()


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path):
    """Editors of some systems write one at the beginning of every file."""
    mark = "\ufeff"
    files = {
        "run.toml": '[motion]\nkind = "gait"\nspeed = 1.1\n',
        "scenario.toml": '[[segment]]\ngait = "walk"\nspeed = 1.1\nsteps = 2\n',
        "ground.csv": "1.0, 0.0\n2.0, 0.1\n",
        "ground.toml": "points = [[1.0, 0.0], [2.0, 0.1]]\n",
        "five.urdf": tc.robot.robot_path("five-link").read_text(encoding="utf-8"),
        "bolt.urdf": tc.robot.robot_path("bolt").read_text(encoding="utf-8"),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(mark + text, encoding="utf-8")
    assert Experiment.load(tmp_path / "run.toml").motion.speed == 1.1
    assert slip.load_scenario(tmp_path / "scenario.toml").segments[0].steps == 2
    for name in ("ground.csv", "ground.toml"):
        assert terrain_from(str(tmp_path / name)).height_at(2.0) == 0.1
    assert tc.load_robot(tmp_path / "five.urdf").name == "five-link"
    loaded = tc.PlanarBiped.from_urdf(
        tmp_path / "bolt.urdf",
        ("FL_FOOT", "FR_FOOT"),
        ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE"),
        foot_radius=0.016,
    )
    assert loaded.mass == pytest.approx(tc.load_robot("bolt").mass)


def test_a_mix_says_which_key_is_wrong(tmp_path, refused):
    path = tmp_path / "mix.toml"
    path.write_text("direction = [0.0, 90.0]\n")
    line = refused(["campaign", "--mix", str(path), "--trials", "1"])
    assert "the mix has the direction [0.0, 90.0], and five-link is held in its plane" in line
    with pytest.raises(ParameterError, match="the mix 100 times as severe: friction is"):
        DisturbanceDistribution().times(100.0)


HOLDER = """
import sys
from pathlib import Path
from template_control.storage import writing
with writing(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize(
    "words",
    [
        ["walk", "--steps", "1", "--no-figures"],
        ["run", "--steps", "1", "--no-figures"],
        ["slip", "SCENARIO", "--no-figures"],
        ["gaits"],
        ["reproduce", "fig6"],
        ["campaign", "--trials", "1"],
        ["robustness", "--quick"],
        ["study", "STUDY"],
    ],
)
def test_a_folder_belongs_to_one_command_at_a_time(words, tmp_path, refused):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('[[segment]]\ngait = "walk"\nspeed = 1.1\nsteps = 1\n')
    study = tmp_path / "study.toml"
    study.write_text("[grid]\ndelay = [0.0]\n")
    folder, files = tmp_path / "runs", {"SCENARIO": scenario, "STUDY": study}
    words = [str(files.get(word, word)) for word in words]
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdout.readline() == "held\n"
        line = refused([*words, "--output", str(folder)])
        assert f"another command writes to {folder} now: wait for it" in line
        assert not list(folder.iterdir())
        other.stdin.close()
    assert other.returncode == 0
    with writing(folder):
        pass


def test_a_folder_is_let_go_whatever_ends_the_block(tmp_path):
    with pytest.raises(KeyError), writing(tmp_path / "new"):
        raise KeyError
    new = tmp_path / "new"
    with writing(new), pytest.raises(RecordError, match="another command writes"), writing(new):
        pass
    assert not list((tmp_path / "new").iterdir())


@pytest.mark.parametrize(
    ("low", "high"), [(1.2345, 1.4567), (0.29999, 1.45001), (3.0, 4.0), (2e-7, 3e-3)]
)
def test_a_window_is_rounded_inward(low, high):
    ends = [float(x) for x in inward(low, high).split(" to ")]
    assert low - 1e-12 <= ends[0] <= ends[1] <= high + 1e-12


@pytest.mark.parametrize(
    ("angle", "speed"), [(65.0, 0.8), (66.0, 1.3), (89.0, 1.1), (72.0, 0.9), (60.0, 1.1)]
)
def test_an_advised_gait_exists_and_is_not_what_was_refused(angle, speed):
    """Both numbers may lie within the ranges that gaits have, and yet have no gait together."""
    p = tc.SlipParameters()
    with pytest.raises(GaitError) as caught:
        tc.gait_at(p, np.radians(angle), speed)
    kind, value = re.search(r"the nearest (angle|speed) is ([\d.]+)", str(caught.value)).groups()
    if kind == "angle":
        angle = float(value)
    else:
        speed = float(value)
    assert tc.gait_at(p, np.radians(angle), speed).vlo[0] == speed


def test_advised_speeds_are_had():
    robot, p = tc.load_robot("five-link"), tc.robot.template_for(tc.load_robot("rabbit"))
    for ask in (
        lambda v: tc.robot_gait_for_speed(robot, v),
        lambda v: tc.running_gait(p, v),
        lambda v: tc.gait_for_speed(p, v),
        lambda v: tc.gait_for_speed(p, v, touchdown_angle=np.radians(67.0)),
    ):
        with pytest.raises(GaitError) as caught:
            ask(19.0)
        low, high = map(float, re.search(r"from ([\d.]+) to ([\d.]+)", str(caught.value)).groups())
        for speed in (low, high):
            ask(speed)


def test_a_centre_of_mass_outside_its_link_is_refused():
    tc.Link(1.0, 2.0, 1.0, 0.1)
    with pytest.raises(RobotError, match=r"com is 5 m, outside a link of 1 m"):
        tc.Link(1.0, 2.0, 5.0, 0.1)


def test_feet_larger_than_the_legs_are_refused(tmp_path):
    path = tmp_path / "mine.urdf"
    text = tc.robot.robot_path("five-link").read_text()
    path.write_text(re.sub(r'sphere radius="[^"]+"', 'sphere radius="5.0"', text))
    legs = ("FL_HFE", "FL_KFE", "FR_HFE", "FR_KFE")
    bolt, feet = tc.robot.robot_path("bolt"), ("FL_FOOT", "FR_FOOT")
    for load in (
        lambda: tc.load_robot(path),
        lambda: tc.PlanarBiped.from_urdf(bolt, feet, legs, foot_radius=5.0),
        lambda: FloatingBaseBiped.from_urdf(bolt, feet, 5.0),
    ):
        with pytest.raises(RobotError, match=r"larger than the legs.*: give a smaller radius"):
            load()


def sampled(record):
    return [
        name
        for name, quantity in quantities(type(record)).items()
        if quantity.dimensions[0] == "time"
        and getattr(record, name).dtype.kind == "f"
        and not name.endswith("reference")
    ]


def test_a_run_with_values_that_are_not_finite_is_not_shown(short_walk, tmp_path, refused):
    path = tmp_path / "run.npz"
    names = sampled(short_walk)
    assert len(names) > 12
    for name in names:
        values = getattr(short_walk, name).copy()
        values[len(values) // 2] = np.nan
        bad = replace(short_walk, **{name: values})
        for show in (
            lambda bad=bad: tc.save_figures(bad, tmp_path),
            lambda bad=bad: tc.plot(bad, "com"),
            lambda bad=bad: tc.save_html(bad, tmp_path / "walk.html"),
            lambda bad=bad: tc.save_film(bad, tmp_path / "walk.gif"),
            lambda bad=bad: tc.replay(bad),
        ):
            with pytest.raises(RecordError, match=f"no finite {name} in 1 of .* samples"):
                show()
    bad.save(path)
    for words in (["plots"], ["replay", "--gif", "x.gif"], ["replay", "--html", "x.html"]):
        words = [*words[:1], str(path), *words[1:-1], *(str(tmp_path / w) for w in words[1:][1:])]
        assert "it cannot be shown" in refused(words)
    assert sorted(f.name for f in tmp_path.iterdir()) == ["run.npz"]


def test_what_numpy_says_of_a_file_is_kept_from_the_user(tmp_path, refused):
    path = tmp_path / "run.npz"
    np.savez(path, metadata=np.array(json.dumps({})), time=np.array([{}], dtype=object))
    line = refused(["plots", str(path)])
    assert "time" in line
    assert "pickle" not in line
    assert "unsafe" not in line
