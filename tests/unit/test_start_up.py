"""What starting costs and prints: names and commands are imported when they are used."""

import os
import re
import subprocess
import sys

import pytest

import template_control as tc
from template_control import errors
from template_control.cli.main import main

HEAVY = (
    "IPython", "matplotlib", "meshcat", "numba", "numpy", "pinocchio", "proxsuite", "pybullet",
    "rich", "scipy",
)  # fmt: skip
COMMANDS = (
    "walk", "run", "go", "drive", "robots", "replay", "plots", "robustness", "campaign", "study",
    "slip", "gaits", "automaton", "keys", "warm-up", "completion", "reproduce",
)  # fmt: skip
ROOMS = (
    "slip", "robot", "whole_body", "estimation", "embedding", "plant", "run", "robustness",
    "sweep", "view", "paper",
)  # fmt: skip
# What the root exported when it exported everything.
ONCE_IN_THE_ROOT = (
    "AUTOMATON", "ROBOTS", "STRIDE_START", "ActiveRunning", "ActiveWalking", "Decision",
    "EmbeddingController", "EmbeddingOptions", "Event", "FiveLink", "GaitError",
    "IdealOptions", "Link", "LqrOptions", "LqrPlanner", "MapKind", "ModifiedOptions",
    "ModifiedPlanner", "ModifiedWalking", "Outcome", "ParameterError", "PlanarBiped", "Planner",
    "PlantOptions", "Push", "Record", "RecordError", "ReturnMap", "RobotError", "RunToWalk",
    "Scenario", "ScenarioError", "ScenarioRecord", "Segment", "SensorOptions",
    "Experiment", "SlipParameters", "Slot", "StepSolution", "Stride",
    "TemplateControlError", "WalkToRun", "WalkingGait", "controls", "default_gait",
    "example_one", "gait_at", "gait_for_speed", "gait_from_energy", "load_robot",
    "load_scenario", "paper_gait", "perturbed_start", "replay", "save_figures", "save_film",
    "save_html", "save_scenario_figures", "simulate", "simulate_scenario", "simulate_stride",
    "summarise", "template_for",
)  # fmt: skip


def python(*arguments, **environment):
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, **environment},
    )


def imported_by(code):
    """Which of the heavy modules ``code`` brings along."""
    done = python("-c", f"{code}\nimport sys\nprint('imported:', *sys.modules)")
    assert done.returncode == 0, done.stderr
    found = done.stdout.rpartition("imported:")[2].split()
    return {name.partition(".")[0] for name in found} & set(HEAVY)


def test_importing_the_library_imports_nothing_heavy():
    assert imported_by("import template_control as tc; dir(tc), tc.slip.__all__") == set()


@pytest.mark.slow(seconds=3)
def test_a_name_brings_what_it_needs_and_no_more():
    assert imported_by("import template_control as tc; tc.SlipParameters") <= {"numpy"}
    assert "matplotlib" not in imported_by("import template_control as tc; tc.simulate")


def test_help_imports_nothing_heavy():
    code = """
from template_control.cli.main import main
try:
    main(["--help"])
except SystemExit as stop:
    assert stop.code == 0
"""
    assert imported_by(code) == set()


@pytest.mark.slow(seconds=4)
def test_a_walk_without_figures_does_not_import_what_draws_them(tmp_path):
    """And Python's collector passes by what it has imported, but works again."""
    words = ["walk", "--steps", "1", "--no-figures", "--output", str(tmp_path)]
    code = f"""
import gc, sys
from template_control.cli.main import main
sys.argv[1:] = {words}
assert main() == 0
assert gc.isenabled() and gc.get_freeze_count() > 100_000
"""
    assert "matplotlib" not in imported_by(code)


def test_help_lists_every_command_with_its_line(capfd):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    listed = capfd.readouterr().out.partition("COMMAND\n")[2].partition("\n\n")[0]
    lines = re.findall(r"^    ([\w-]+)\s+((?:.|\n {5,})+)", listed, flags=re.MULTILINE)
    assert tuple(name for name, _ in lines) == COMMANDS
    assert all(len(about.split()) > 4 for _, about in lines)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_its_own_help(command, capfd):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    out = capfd.readouterr().out
    assert out.startswith(f"usage: template-control {command} ")
    assert "%%" not in out
    options = [line.split()[0] for line in out.splitlines() if line.startswith("  --")]
    assert options or command in ("warm-up", "completion")


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        ([], "COMMAND"),
        (["jump"], "jump"),
        (["--fast", "walk"], "--fast"),
        (["plots", "run.npz", "--fast"], "--fast"),
    ],
)
def test_a_wrong_line_is_refused_by_name(arguments, culprit, refused):
    assert culprit in refused(arguments)


def test_ctrl_c_while_a_command_is_imported_is_one_line(tmp_path):
    folder = tmp_path / "numpy"
    folder.mkdir()
    folder.joinpath("__init__.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", ""), os.getcwd()])
    done = python("-m", "template_control.cli.main", "walk", PYTHONPATH=path)
    assert done.returncode == 130
    assert done.stdout == ""
    assert done.stderr == "template-control: interrupted before anything was done\n"


def test_the_root_is_small_and_tells_its_names():
    assert len(tc.__all__) < 64
    assert len(set(tc.__all__)) == len(tc.__all__)
    assert dir(tc) == tc.__all__
    assert set(ROOMS) < set(tc.__all__)


@pytest.mark.parametrize("room", ["", *ROOMS])
def test_every_name_that_is_told_is_there(room):
    place = getattr(tc, room) if room else tc
    assert dir(place) == place.__all__
    for name in place.__all__:
        value = getattr(place, name)
        assert value is getattr(place, name)
        if callable(value):
            assert getattr(value, "__name__", name) == name


@pytest.mark.parametrize("room", ["", *ROOMS])
def test_a_wrong_name_is_an_attribute_error(room):
    place = getattr(tc, room) if room else tc
    with pytest.raises(AttributeError, match=r"simulat$"):
        _ = place.simulat
    with pytest.raises(ImportError, match="simulat"):
        exec(f"from {place.__name__} import simulat")


def test_everything_can_be_imported_at_once():
    names = {}
    exec("from template_control import *", names)
    assert set(tc.__all__) <= set(names)
    assert names["simulate"] is tc.simulate


def test_what_the_root_exported_is_there_or_in_a_room():
    places = [tc, errors, *(getattr(tc, room) for room in ROOMS)]
    for name in ONCE_IN_THE_ROOT:
        assert len({id(getattr(p, name)) for p in places if name in dir(p)}) == 1, name


@pytest.mark.parametrize("first", ["import template_control.sweep.sweep", "tc.sweep.grid"])
def test_a_function_named_as_its_module_stays_a_function(first):
    code = f"import template_control as tc\n{first}\nfrom template_control.sweep import sweep\n"
    done = python("-c", code + "print(tc.sweep.sweep is sweep, callable(sweep))")
    assert done.stdout == "True True\n", done.stderr


@pytest.mark.slow(seconds=3)
def test_where_no_folder_takes_a_cache_everything_is_imported_and_compiles(tmp_path):
    code = """
import template_control as tc
tc.simulate, tc.ReturnMap, tc.PlantOptions
from template_control.compiled import compiled
print(compiled(lambda x: x + 1)(1))
"""
    nowhere = tmp_path / "file"
    nowhere.touch()
    done = python("-c", code, NUMBA_CACHE_DIR=str(nowhere / "cache"), HOME=str(nowhere))
    assert done.returncode == 0, done.stderr
    assert done.stdout == "2\n"
