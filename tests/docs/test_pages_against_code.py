"""Tables, names of options and files of the pages, compared with the code that they describe."""

import importlib
import inspect
import pkgutil
import re
import tomllib
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from places import DOCS, EXAMPLES, ROOT

import template_control as tc
from template_control.checks.checked import Checked
from template_control.cli.main import build_parser
from template_control.embedding.planners.planner import Context, Decision, Planner
from template_control.embedding.state import Snapshot
from template_control.plant.plant import Plant
from template_control.robustness import DisturbanceDistribution
from template_control.run.specs import PlannerSpec
from template_control.slip.automaton.vocabulary import NUM_SLOTS
from template_control.view.figures import FIGURES, FREE_FIGURES, SOLE_FIGURES
from template_control.view.scenario_figures import ROUTE_FIGURES

PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
TEXTS = {page: page.read_text() for page in PAGES}


def commands_of(parser):
    return next(a for a in parser._actions if a.dest == "command").choices


def parser_of(command):
    return commands_of(build_parser([command]))[command]


def table(page, heading):
    """Rows of the table of a guide whose first line begins with ``heading``."""
    text = (DOCS / "guides" / page).read_text()
    (found,) = re.findall(rf"^\| {re.escape(heading)}.*\n\|[-| ]+\n((?:\|.*\n)+)", text, re.M)
    cells = re.compile(r"(?<!\\)\|")
    return [[cell.strip() for cell in cells.split(row)[1:-1]] for row in found.splitlines()]


def quoted(cell):
    """Names in backquotes, without arguments."""
    return [re.match(r"[\w-]+", name)[0] for name in re.findall(r"`([^`]+)`", cell)]


def first_names(rows):
    return [name for row in rows for name in quoted(row[0])]


def members(protocol):
    return {n for n in (*protocol.__annotations__, *vars(protocol)) if not n.startswith("_")}


def test_the_members_of_a_planner():
    rows = table("your_planner.md", "member ")
    assert set(first_names(rows)) == members(Planner)
    takes = {name: list(inspect.signature(getattr(Planner, name)).parameters)[1:]
             for name in members(Planner) if callable(getattr(Planner, name, None))}  # fmt: skip
    for row in rows:
        name, called, arguments = re.fullmatch(r"`(\w+)(\(?)([^)]*)\)?`", row[0]).groups()
        assert bool(called) == (name in takes), name
        assert not called or [a for a in arguments.split(", ") if a] == takes[name]


def test_what_a_planner_gets_and_returns():
    assert first_names(table("your_planner.md", "in a context ")) == list(Context._fields)
    rows = table("your_planner.md", "field ")
    assert first_names(rows) == [f.name for f in fields(Decision)]
    assert {2: "two", 3: "three", 5: "five", 6: "six"}[NUM_SLOTS] in rows[0][1]


def test_the_members_of_a_plant():
    assert set(first_names(table("your_plant.md", "member "))) == members(Plant)


def test_what_the_controller_follows():
    names = {f.name for f in fields(Snapshot)}
    assert set(first_names(table("your_loop.md", "attribute "))) == names


def test_what_a_tick_is_given():
    told = first_names(table("your_loop.md", "argument "))
    assert told == list(inspect.signature(tc.EmbeddingController.tick).parameters)[1:]


def test_the_figures_and_their_options():
    told = first_names(table("replay.md", "file "))
    assert set(told) == {*FIGURES, *FREE_FIGURES, *SOLE_FIGURES, *ROUTE_FIGURES}
    assert len(told) == len(set(told))
    known = {o for a in parser_of("plots")._actions for o in a.option_strings}
    rows = re.findall(r"`(--[\w-]+)", " ".join(row[0] for row in table("replay.md", "option ")))
    assert set(rows) == known - {"-h", "--help", "--output"}


NUMBER = r"-?\d+(?:\.\d+)?"


def ends(text, unit):
    """Least and greatest number of a range's cell."""
    found = [float(x) * unit for x in re.findall(NUMBER, text)]
    return [-found[0], found[0]] if text.startswith("±") else [found[0], found[-1]]


def test_the_default_disturbances_of_a_campaign():
    rows, default = table("campaign.md", "key "), DisturbanceDistribution()
    assert first_names(rows) == [f.name for f in fields(default)]
    for key, cell, _ in rows:
        unit = next((u for word, u in (("%", 0.01), ("cm", 0.01), ("mrad", 1e-3), ("ms", 1e-3))
                     if word in cell), 1.0)  # fmt: skip
        value = getattr(default, key.strip("`"))
        value = value if isinstance(value, tuple) else (value, value)
        np.testing.assert_allclose(ends(cell, unit), value, err_msg=key)


def options_classes():
    """Name to class of every dataclass whose values are checked."""
    found = {}
    for module in pkgutil.walk_packages(tc.__path__, "template_control."):
        for name, kind in vars(importlib.import_module(module.name)).items():
            if inspect.isclass(kind) and issubclass(kind, Checked) and is_dataclass(kind):
                found.setdefault(name, kind)
    return found


CLASSES = options_classes()


def test_every_class_of_options_is_in_the_table_with_its_file():
    rows = table("architecture.md", "options ")
    told = {}
    for row in rows:
        files = [f if f.endswith(".py") else f"{f}/" for f in re.findall(r"`([\w/.]+?)/?`", row[2])]
        for name in quoted(row[0]):
            told[name] = files
    assert {name for name in CLASSES if name.endswith("Options")} <= set(told)
    for name, files in told.items():
        path = CLASSES[name].__module__.removeprefix("template_control.").replace(".", "/") + ".py"
        assert any(path == f or (f.endswith("/") and path.startswith(f)) for f in files), name


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_named_options_are_there(page):
    text = TEXTS[page]
    for name, field in re.findall(r"\b([A-Z]\w+)\.([a-z_]\w*)", text):
        if name in CLASSES:
            assert hasattr(CLASSES[name], field) or field in known(name), f"{name}.{field}"
    for name, arguments in re.findall(r"\b([A-Z]\w+)\(([^()]*)\)", text):
        if name in CLASSES:
            given = re.findall(r"(\w+)=", arguments)
            assert set(given) <= known(name), f"{name}({arguments})"


def known(name):
    return {f.name for f in fields(CLASSES[name])}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_named_options_of_the_command_line_are_there(page):
    """``--word`` in the text and in tables; commands are read by the parser elsewhere."""
    parsers = [parser_of(command) for command in commands_of(build_parser([]))]
    options = {o for p in parsers for a in p._actions for o in a.option_strings} | {"--version"}
    for script in (*EXAMPLES.glob("*.py"), *(ROOT / "benchmarks").glob("*.py")):
        options |= set(re.findall(r'"(--[\w-]+)"', script.read_text()))
    prose = re.sub(r"```.*?```", "", TEXTS[page], flags=re.DOTALL)
    for quote in re.findall(r"`(--[^`]*)`", prose):
        for word in re.findall(r"(?<!\S)--[a-z][\w.-]*", quote):
            assert word in options, word


def test_kinds_of_planner_are_those_of_the_file():
    rows = table("options.md", "kind ")
    kinds = {kind.kind for kind in PlannerSpec.__args__}
    assert set(first_names(rows)) | {"deadbeat"} >= kinds
    assert {n for row in rows for n in quoted(row[0])} <= kinds


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_files_shown_are_read(page, tmp_path):
    for number, shown in enumerate(re.findall(r"```toml\n(.*?)```", TEXTS[page], re.DOTALL)):
        path = tmp_path / f"{number}.toml"
        path.write_text(shown)
        table = tomllib.loads(shown)
        if "segment" in table and "motion" not in table:
            tc.load_scenario(path)
        elif "experiment" in table:
            tc.sweep.Study.load(path)
        else:
            tc.Experiment.load(path)
