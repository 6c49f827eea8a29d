"""Options are public only where somebody sets them: a test, an example, a benchmark or a page."""

import ast
import re
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module

import pytest
from places import ROOT

from template_control.checks.checked import Checked

LIBRARY = ROOT / "template_control"
USERS = ("tests", "examples", "benchmarks")
PAGES = (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.toml"))


def options():
    """Every class of options of the library."""
    found = set()
    for path in sorted(LIBRARY.rglob("*.py")):
        names = re.findall(r"^class (\w+Options)\b", path.read_text(), re.MULTILINE)
        parts = path.relative_to(ROOT).with_suffix("").parts
        found |= {getattr(import_module(".".join(parts)), name) for name in names}
    return sorted((kind for kind in found if issubclass(kind, Checked)), key=lambda k: k.__name__)


@cache
def set_somewhere():
    """Names that a call or a dictionary sets, or a line of TOML, or a key with dots."""
    found = set()
    for path in (p for folder in USERS for p in (ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.keyword):
                found.add(node.arg)
            elif isinstance(node, ast.Dict):
                found |= {k.value for k in node.keys if isinstance(k, ast.Constant)}
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found |= named(node.value)
    for page in PAGES:
        found |= named(page.read_text())
    return found | set().union(*map(of_presets, LIBRARY.rglob("*.py")))


def of_presets(path):
    """Names that a module of the library sets for a kind of robot or stride."""
    calls = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
    return {
        keyword.arg
        for call in calls
        if ast.unparse(call.func).endswith(("Options", "replace"))
        for keyword in call.keywords
    }


def named(text):
    """Names that a text sets: ``name = 1``, ``name=1``, and all of ``controller.swing.late``."""
    dotted = re.findall(r"\b[a-z]\w*(?:\.[a-z]\w*)+\b", text)
    return {*re.findall(r"\b(\w+) ?=", text), *(n for key in dotted for n in key.split("."))}


@pytest.mark.parametrize("kind", options(), ids=lambda kind: kind.__name__)
def test_every_option_is_set_somewhere(kind):
    own = [f for f in fields(kind) if not is_dataclass(f.default_factory)]  # else its own are
    assert not [f.name for f in own if f.name not in set_somewhere()]


def test_what_sets_an_option_is_found():
    assert named("[a]\nb = 1") == {"b"}
    assert named("--controller.swing.late 0.1") == {"controller", "swing", "late"}
