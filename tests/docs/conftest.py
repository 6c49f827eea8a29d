"""How the blocks of a page are run."""

import os
import re
import shlex
import subprocess
import sys
from itertools import takewhile

import pytest
from places import ROOT

from template_control.cli.main import main


@pytest.fixture(scope="session")
def on_path(tmp_path_factory):
    """Environment of a shell that knows ``template-control`` and ``python`` by name."""
    folder = tmp_path_factory.mktemp("bin")
    for name, words in (("python", ""), ("template-control", " -m template_control.cli.main")):
        script = folder / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}"{words} "$@"\n')
        script.chmod(0o755)
    return {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
    }


@pytest.fixture
def run_block(tmp_path, monkeypatch, capfd, on_path):
    """Runs a page's block in an empty folder and gives what it prints on stdout.

    Python and commands run in this process, as importing the library for each takes two seconds; a
    shell runs the rest of a block, from the first line on that needs one.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    modules = set(sys.modules)

    def run(language, block):
        if language == "python":
            exec(compile(block, "a snippet", "exec"), {"__name__": "__main__"})
            return capfd.readouterr().out
        lines = block.splitlines()
        plain = list(takewhile(re.compile(r"template-control [^$&|<>;]*$").match, lines))
        for line in plain:
            assert main(shlex.split(line)[1:]) == 0, f"{line}: {capfd.readouterr().err}"
        if rest := "\n".join(lines[len(plain) :]):
            shell = ["bash", "-euo", "pipefail", "-c", rest]
            done = subprocess.run(shell, timeout=300, env=on_path)
            assert done.returncode == 0, f"{rest}: {capfd.readouterr()}"
        return capfd.readouterr().out

    yield run
    for name in set(sys.modules) - modules:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
