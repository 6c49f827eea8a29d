"""A user's names are printed and drawn as they are: brackets, dollars and colons order nothing."""

from dataclasses import replace

import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.cli.report import tables
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import Scenario, Segment
from template_control.terminal import show
from template_control.view import save_scenario_figures
from template_control.view.figures import FIGURES, figures_of

NAMES = ("[/nope]", "[bold]x", ":bus:", "$x^{", "50 % [link=x]", r"a\b[/]")
TOML = 'name = {}\n[[segment]]\ngait = "walk"\nspeed = 1.1\nsteps = 1\n'


def renamed(record, name):
    return replace(record, metadata={**record.metadata, "robot": name})


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_s_name_is_printed_as_it_is(name, tmp_path, capsys):
    path = tmp_path / "s.toml"
    path.write_text(TOML.format("'" + name + "'"))
    assert main(["slip", str(path), "--no-figures", "--output", str(tmp_path)]) == 0
    assert f"{name}, paper map" in capsys.readouterr().out


@pytest.mark.parametrize("name", NAMES)
def test_a_robot_s_name_is_printed_as_it_is(name, short_walk, capsys):
    figures = tc.run.summarise(renamed(short_walk, name), f"{name}.npz")
    show(*tables(figures))
    out = capsys.readouterr().out
    assert f"{name}, gait walk" in out
    assert f"{name}.npz" in out


@pytest.mark.slow(seconds=6)
def test_a_folder_s_name_is_printed_as_it_is(tmp_path, capsys):
    assert main(["gaits", "--output", str(tmp_path / "[b]"), "--no-figures"]) == 0
    assert main(["automaton", "--output", str(tmp_path / "[/b].png")]) == 0
    assert "[/b].png" in capsys.readouterr().out.replace("\n", "")


@pytest.mark.slow(seconds=4)
def test_names_are_drawn_as_they_are(tmp_path):
    robot = tc.load_robot("runner")
    planner = tc.RunningPlanner(running_gait(tc.template_for(robot), 3.0))
    short_run = tc.simulate(tc.Experiment(robot, planner=planner, steps=3))
    assert figures_of(short_run) == FIGURES
    name = "$x^{\\frac$\nb"  # between dollars Matplotlib reads mathematics, which these are not
    named = renamed(short_run, name)
    for draw in figures_of(named).values():
        draw(named).savefig(tmp_path / "a.png", dpi=20)
    record = simulate_scenario(Scenario((Segment("walk", speed=1.1, steps=2),), name="$x^{"))
    assert save_scenario_figures(record, tmp_path)
