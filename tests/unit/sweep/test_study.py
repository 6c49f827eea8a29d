"""Studies: an experiment over a grid or a sample of keys, by file, command line and Python."""

import json
import runpy
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from json_page import undocumented, unprinted
from places import EXAMPLES, ROOT

import template_control as tc
from template_control.cli.main import main
from template_control.errors import ParameterError

QUESTIONS = EXAMPLES / "questions"
BOTH = "world.friction controller.qp.friction"
SMALL = tc.sweep.Study(
    about="small",
    experiment={"steps": 1, "record_every": 10},
    grid={BOTH: (0.5, 0.7), "motion.speed": (0.6, 9.0)},
    figures=("mean_speed", "fell"),
)


@pytest.fixture(scope="module")
def answered():
    with ThreadPoolExecutor(1) as pool:
        return tc.sweep.run_study(SMALL, executor=pool)


def test_a_key_in_two_places_has_one_value():
    world = SMALL.trial(SMALL.items()[0])
    assert (world.world.friction, world.controller.qp.friction, world.steps) == (0.5, 0.5, 1)


def test_figures_are_those_of_the_runs(answered):
    record = tc.simulate(SMALL.trial(SMALL.items()[2]))
    assert answered.column("mean_speed")[2] == tc.run.summarise(record, None)["mean_speed"]
    assert answered.column("fell").tolist()[::2] == [0.0, 0.0]


def test_a_trial_that_cannot_be_run_says_why_and_the_heat_map_shows_it(answered):
    assert set(answered.failures) == {1, 3}
    assert "five-link does not walk at a mean speed of 9 m/s" in answered.failures[1]
    values = tc.sweep.heat_map(SMALL, answered)
    assert values.shape == (2, 2)
    assert np.isnan(values[:, 1]).all()
    figure = tc.view.study_figure(SMALL, answered)
    assert [t.get_text() for t in figure.axes[0].texts].count("failed") == 2
    assert figure.axes[0].get_ylabel() == BOTH


def test_a_sample_is_drawn_with_its_seed():
    draws = {"sample": {"delay": (0.0, 1.0)}, "draws": 3}
    first, again, other = (tc.sweep.Study(seed=s, **draws).items() for s in (1, 1, 2))
    assert first == again != other
    assert tc.sweep.heat_map(tc.sweep.Study(**draws), None) is None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "give one of them"),
        ("[grid]\ndelay = [0.0]\n[sample]\ndelay = [0.0, 1.0]", "give one of them"),
        ("figures = []\n[grid]\ndelay = [0.0]", "give figures"),
        ("[grid]\nnone = [0.0]", "unknown key none"),
        ("[experiment]\nnone = 1\n[grid]\ndelay = [0.0]", "experiment.none"),
        ("wrong = 1", "unknown key wrong"),
    ],
)
def test_a_wrong_study_is_one_line(text, why, tmp_path, refused):
    path = tmp_path / "study.toml"
    path.write_text(text)
    assert why in refused(["study", str(path), "--output", str(tmp_path / "out")])


def test_a_study_in_a_folder_that_cannot_be_made_is_one_line(tmp_path, refused):
    path = tmp_path / "study.toml"
    path.write_text("[grid]\ndelay = [0.0]\n")
    assert "cannot write to /proc/none" in refused(["study", str(path), "--output", "/proc/none"])


def test_a_figure_that_no_run_has_is_said(tmp_path):
    study = tc.sweep.Study(experiment={"steps": 1}, grid={"delay": (0.0,)}, figures=("none",))
    with ThreadPoolExecutor(1) as pool:
        assert "a run has no figure 'none'" in tc.sweep.run_study(study, executor=pool).failures[0]


def test_no_study_without_an_axis():
    with pytest.raises(ParameterError, match="give one of them"):
        tc.sweep.Study()


@pytest.mark.slow(seconds=4)
def test_a_stopped_study_goes_on_where_it_was(tmp_path, capfd):
    path, out = tmp_path / "s.toml", tmp_path / "out"
    text = "[experiment]\nsteps = 1\n[grid]\ndelay = [0.0, 0.002]\nseed = [1, 2]"
    path.write_text(text)
    words = ["study", str(path), "--output", str(out), "--workers", "1", "--json"]
    assert main(words) == 0
    first = json.loads(capfd.readouterr().out)
    assert undocumented("study", first) == unprinted("study", first) == set()
    lines = (out / "trials.jsonl").read_text().splitlines()
    (out / "trials.jsonl").write_text("\n".join(lines[:3]) + "\n")
    assert main(words) == 0
    assert json.loads(capfd.readouterr().out)["trials"] == first["trials"]
    assert (out / "trials.jsonl").read_text().splitlines()[:3] == lines[:3]
    assert (out / "figure.png").stat().st_size > 5000


@pytest.mark.parametrize("path", sorted(QUESTIONS.glob("*.toml")), ids=lambda p: p.stem)
def test_a_question_is_one(path):
    study = tc.sweep.Study.load(path)
    assert study.about.endswith("?") or "?" in study.about
    for item in study.items():
        assert study.trial(item).steps in (6, 8)
    assert path.name in (ROOT / "docs" / "guides" / "questions.md").read_text()


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize("path", sorted(QUESTIONS.glob("*.py")), ids=lambda p: p.stem)
def test_a_question_in_python_is_answered(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path))
    assert capsys.readouterr().out.count("fell False") >= 4
    assert path.name in (ROOT / "docs" / "guides" / "questions.md").read_text()
