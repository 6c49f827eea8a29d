"""Every command and snippet of the README runs as printed."""

import ast
import os
import re
import shutil
import signal
import subprocess
import sys

import pytest
from places import DOCS, ROOT
from printed import EXAMPLE_ONE, WALK_SPEEDS, ZERO_FIVE_ZERO
from printed import words as words_of
from test_pages import RUN

import template_control as tc
from template_control.cli.main import main
from template_control.paper import REPRODUCTIONS

README = (ROOT / "README.md").read_text()
REPLAY = (DOCS / "guides" / "replay.md").read_text()
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
PAGES = [pytest.param(p, id=p.name) for p in (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))]


def blocks(language, text=README):
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.slow(seconds=4)
def test_python_snippets_run_as_printed(run_block):
    snippets = blocks("python")
    assert snippets
    for snippet in snippets:
        run_block("python", snippet)


@pytest.mark.parametrize("page", PAGES)
def test_every_name_in_a_snippet_is_the_librarys(page):
    """The quick suite does not run the long snippets, but knows when a name has gone."""
    for snippet in blocks("python", page.read_text()):
        tree = ast.parse(snippet)
        exec("\n".join(ast.unparse(n) for n in tree.body if is_our_import(n)), {})
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "tc":
                assert hasattr(tc, node.attr), node.attr


def is_our_import(node):
    if isinstance(node, ast.ImportFrom):
        return node.module.startswith("template_control")
    return isinstance(node, ast.Import) and node.names[0].name.startswith("template_control")


def commands(text=README):
    return [line for block in blocks("sh", text) for line in block.strip().splitlines()]


def test_the_two_commands_are_there():
    installing = [line for line in commands() if "python3 -m venv" in line]
    assert len(installing) == 2
    # What follows needs no path of a program.
    assert commands()[2] == ACTIVATE
    walking, testing = installing
    assert walking.endswith(".venv/bin/template-control walk")
    assert testing.endswith(".venv/bin/pytest")
    # .ci/run finds both by their beginning and end, and runs them.
    script = (ROOT / ".ci" / "run").read_text()
    patterns = re.findall(r"'(\^python3 -m venv .*?\$)'", script)
    assert [line for p in patterns for line in commands() if re.search(p, line)] == installing


@pytest.fixture(scope="module")
def walked(short_walk, tmp_path_factory):
    """The run that the first command leaves, after fewer steps."""
    folder = tmp_path_factory.mktemp("walked")
    short_walk.save(folder / "run.npz")
    return folder


# Of the pages whose commands are short, those that the README does not have.
SHORT = [
    commands((DOCS / page).read_text())
    for page in (
        "guides/choosing_a_gait.md",
        "guides/paper.md",
        "guides/scenarios.md",
        "guides/standing.md",
        "lab/example_two.md",
    )
]
ACTIVATE = ". .venv/bin/activate"
PRINTED = [*(c for c in commands() if "python3 -m venv" not in c), *(c for p in SHORT for c in p)]
ALL = dict.fromkeys(c for c in PRINTED if c != ACTIVATE)
REPRODUCED = [line for line in ALL if line.startswith("template-control reproduce ")]
# A page that runs from top to bottom has these commands too.
ON_A_PAGE = {
    line for page in RUN for line in commands((DOCS / f"{page}.md").read_text()) if line in ALL
}
ELSEWHERE = [*REPRODUCED, EXAMPLE_ONE, WALK_SPEEDS, ZERO_FIVE_ZERO, *ON_A_PAGE]


@pytest.mark.parametrize("page", PAGES)
def test_every_command_is_understood(page, understood):
    for line in commands(page.read_text()):
        if line.startswith("template-control "):
            line = line.partition(" > ")[0]
            understood(re.sub(r"\$\w+|\"\$\w+\"", "x", line))


def test_every_reproduction_is_printed():
    """``test_reproduce_command`` runs each as printed here."""
    assert sorted(line.split(maxsplit=2)[2] for line in REPRODUCED) == sorted(REPRODUCTIONS)


def test_what_is_run_elsewhere_as_printed_is_printed():
    assert set(ELSEWHERE) <= set(ALL)


@pytest.mark.slow
@pytest.mark.parametrize("line", [line for line in ALL if line not in ELSEWHERE])
def test_other_commands_run_as_printed(line, tmp_path, walked, monkeypatch, capfd):
    words = words_of(line)
    for record in (word for word in words if word.endswith("/run.npz")):
        shutil.copytree(walked, (tmp_path / record).parent)
    if words[0] == "template-control":
        monkeypatch.chdir(tmp_path)
        assert main(words[1:]) == 0, capfd.readouterr().err
        return
    assert words[0] == "python"
    done = subprocess.run(
        [sys.executable, *words[1:]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        env=ENVIRONMENT,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow(seconds=11)
def test_the_replay_page_runs_as_printed(tmp_path, run_block, on_path):
    lines = [line for block in blocks("sh", REPLAY) for line in block.strip().splitlines()]
    assert lines[0].startswith("template-control walk")
    for line in lines:
        words = line.split()
        if "--video" in words and shutil.which("ffmpeg") is None:
            continue
        if "replay" in words and not {"--html", "--gif", "--video"} & set(words):
            process = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=on_path
            )
            assert "http://" in process.stdout.readline()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=300)
            assert process.returncode == 0, f"{line}: {errors}"
        else:
            run_block("sh", line)
    for snippet in blocks("python", REPLAY):
        run_block("python", snippet)
    assert (tmp_path / "slow.html").is_file()
    assert (tmp_path / "figures" / "energies.png").is_file()


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 150


def test_what_is_printed_leaves_nothing_that_git_sees():
    """Files that commands and snippets write into the clone are ignored."""
    written = ["runs/walk/run.npz", "run.npz", "stick_diagram.png", "eight.png"]
    listed = subprocess.run(
        ["git", "check-ignore", *written], cwd=ROOT, capture_output=True, text=True
    )
    assert listed.stdout.split() == written
