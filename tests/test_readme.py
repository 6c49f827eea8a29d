"""Every command and snippet of the README runs as printed."""

import os
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()
REPLAY = (ROOT / "docs" / "replay.md").read_text()
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
GUIDES = ("your_robot.md", "controller.md")


def blocks(language, text=README):
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def test_python_snippets_run_as_printed(tmp_path):
    snippets = blocks("python")
    assert snippets
    for snippet in snippets:
        done = subprocess.run(
            [sys.executable, "-c", snippet],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
        assert done.returncode == 0, done.stderr


def commands(text=README):
    return [line for block in blocks("sh", text) for line in block.strip().splitlines()]


def test_the_two_commands_are_there():
    installing = [line for line in commands() if "venv" in line]
    assert len(installing) == 2
    walking, testing = installing
    assert walking.endswith(".venv/bin/template-control walk")
    assert testing.endswith(".venv/bin/pytest")
    # .ci/run takes the second from the README and runs it.
    assert "README.md" in (ROOT / ".ci" / "run").read_text()


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """What the first command leaves, after fewer steps."""
    folder = tmp_path_factory.mktemp("walked")
    line = [sys.executable, "-m", "template_control.cli.main", "walk", "--steps", "4"]
    subprocess.run([*line, "--no-figures", "--output", folder], check=True, env=ENVIRONMENT)
    return folder


# The quick suite runs the walks; of the other commands it runs the parts, in its own process.
SHORT = [c for c in commands() if "walk --steps 10" in c and "--plant ideal" not in c]
# Of the pages whose commands are short, those that the README does not have.
PAGES = [
    commands((ROOT / "docs" / page).read_text()) for page in ("stability.md", "example_two.md")
]
ALL = dict.fromkeys([*(c for c in commands() if "venv" not in c), *(c for p in PAGES for c in p)])


@pytest.mark.parametrize(
    "line", [pytest.param(c, marks=[pytest.mark.slow] * (c not in SHORT)) for c in ALL]
)
def test_other_commands_run_as_printed(line, tmp_path, walked):
    words = [str(ROOT / w) if w.startswith("examples/") else w for w in line.split()]
    assert words[0] in ("template-control", "python")
    if "runs/walk/run.npz" in words:
        shutil.copytree(walked, tmp_path / "runs" / "walk")
    if words[0] == "template-control":
        words = [sys.executable, "-m", "template_control.cli.main", *words[1:]]
    else:
        words = [sys.executable, *words[1:]]
    done = subprocess.run(
        words,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_replay_page_runs_as_printed(tmp_path):
    lines = [line for block in blocks("sh", REPLAY) for line in block.strip().splitlines()]
    assert lines[0].startswith("template-control walk")
    for line in lines:
        if "--video" in line and shutil.which("ffmpeg") is None:
            continue
        words = [sys.executable, "-m", "template_control.cli.main", *line.split()[1:]]
        served = "replay" in words and not {"--html", "--gif", "--video"} & set(words)
        process = subprocess.Popen(
            words,
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=ENVIRONMENT,
        )
        if served:
            assert "http://" in process.stdout.readline()
            process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=300)
        assert process.returncode == 0, f"{line}: {errors}"
    for snippet in blocks("python", REPLAY):
        done = subprocess.run(
            [sys.executable, "-c", snippet], cwd=tmp_path, capture_output=True, env=ENVIRONMENT
        )
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "slow.html").is_file()
    assert (tmp_path / "figures" / "energies.png").is_file()


@pytest.fixture(scope="module")
def on_path(tmp_path_factory):
    """Environment of a shell that knows ``template-control`` and ``python`` by name."""
    folder = tmp_path_factory.mktemp("bin")
    for name, words in (("python", ""), ("template-control", " -m template_control.cli.main")):
        script = folder / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}"{words} "$@"\n')
        script.chmod(0o755)
    return {**ENVIRONMENT, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}


@pytest.mark.slow
@pytest.mark.parametrize("page", GUIDES)
def test_a_guide_runs_as_printed_from_top_to_bottom(page, tmp_path, on_path):
    text = (ROOT / "docs" / page).read_text()
    found = re.findall(r"```(python|sh)\n(.*?)```", text, flags=re.DOTALL)
    assert found
    for language, block in found:
        shell = ["bash", "-euo", "pipefail", "-c", block]
        done = subprocess.run(
            [sys.executable, "-c", block] if language == "python" else shell,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            env=on_path,
        )
        assert done.returncode == 0, f"{block}: {done.stdout}{done.stderr}"
        assert "fell: True" not in done.stdout


@pytest.mark.parametrize("page", GUIDES)
def test_what_a_guide_points_at_is_there(page):
    text = (ROOT / "docs" / page).read_text()
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        assert (ROOT / "docs" / target).exists(), target
    for name, function in re.findall(r"`((?:[a-z_]+/)+[a-z_]+\.py)`(?::\s+`([\w.]+)`)?", text):
        source = ROOT / "template_control" / name
        assert source.is_file(), name
        for part in function.split(".") if function else ():
            assert re.search(rf"\b(def|class) {part}\b|^{part}\b", source.read_text(), re.M), part


def test_pictures_are_there():
    for folder, text in ((ROOT, README), (ROOT / "docs", REPLAY)):
        for picture in re.findall(r"!\[.*?\]\((.*?)\)", text):
            assert (folder / picture).is_file()


@pytest.mark.slow
def test_first_command_works_in_a_fresh_clone(tmp_path):
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    line = next(c for c in commands() if c.endswith("template-control walk"))
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", line],
        cwd=clone,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    assert (clone / "runs" / "walk" / "run.npz").is_file()
    assert (clone / "runs" / "walk" / "stick_diagram.png").is_file()


@pytest.mark.slow
def test_a_wheel_finds_its_robots_elsewhere(tmp_path):
    pip = [sys.executable, "-m", "pip"]
    subprocess.run(
        [*pip, "wheel", "--quiet", "--no-deps", "--wheel-dir", str(tmp_path), str(ROOT)],
        check=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert "template_control/robots/five_link.urdf" in names
    assert {"template_control/py.typed", "template_control/slip/__init__.pyi"} <= set(names)
    target = tmp_path / "site"
    subprocess.run(
        [*pip, "install", "--quiet", "--no-deps", "--target", str(target), str(wheel)], check=True
    )
    code = "import template_control as tc; print(tc.load_robot('five-link').path)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(target)},
    )
    assert done.stdout.strip() == str(target / "template_control/robots/five_link.urdf")
