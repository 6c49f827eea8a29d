"""What a stranger meets first: licence, version, citation, and what the wheel holds."""

import re
import tomllib
from importlib.metadata import version

import pytest
from places import ROOT

import template_control as tc
from template_control.cli.main import main

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_version_has_one_source(capfd):
    assert tc.__version__ == version("template-control")
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capfd.readouterr().out == f"template-control {tc.__version__}\n"


def test_citation_and_changes_know_the_version():
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"\nlicense: {PROJECT['license']}\n" in citation
    changes = (ROOT / "CHANGELOG.md").read_text()
    assert re.search(r"^## (\S+)", changes, re.MULTILINE)[1] == PROJECT["version"]


def test_the_licence_is_the_one_that_is_named():
    text = (ROOT / "LICENSE").read_text()
    assert PROJECT["license"] == "BSD-2-Clause"
    assert text.startswith("BSD 2-Clause License")
    assert PROJECT["authors"][0]["name"] in text


def test_what_contributors_are_told_to_run_is_what_ci_runs():
    told = (ROOT / "CONTRIBUTING.md").read_text()
    script = (ROOT / ".ci" / "run").read_text()
    for command in ("ruff check .", "ruff format --check .", "mypy", "pytest -m slow"):
        assert f".venv/bin/{command}" in told
        assert f".venv/bin/{command}" in script
