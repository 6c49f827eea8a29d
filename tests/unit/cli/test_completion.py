"""Completion of commands, options and choices, in a shell."""

import shutil
import subprocess

import pytest

from template_control.cli.main import main

# What bash completes the last of the words to.
COMPLETE = """source "$1"; shift
function=$(complete -p template-control | sed -E 's/.*-F (\\S+).*/\\1/')
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); $function; echo "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def completed(tmp_path_factory):
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("needs bash")
    path = tmp_path_factory.mktemp("completion") / "template-control.bash"
    with pytest.MonkeyPatch.context() as patch:
        lines = []
        patch.setattr("builtins.print", lines.append)
        assert main(["completion", "bash"]) == 0
    path.write_text("\n".join(lines))

    def complete(*words):
        command = [bash, "-c", COMPLETE, "bash", str(path), "template-control", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
        assert done.stderr == ""
        return done.stdout.split()

    return complete


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["camp"], ["campaign"]),
        (["walk", "--tur"], ["--turn"]),
        (["walk", "--world.fric"], ["--world.friction"]),
        (["walk", "--plant", ""], ["pybullet", "mujoco", "ideal"]),
        (["completion", "ba"], ["bash"]),
        (["walk", "--nothing-"], []),
    ],
)
def test_a_word_is_completed(completed, words, wanted):
    assert completed(*words) == wanted


def test_an_unknown_shell_is_refused(refused):
    assert "choose from" in refused(["completion", "elvish"])
