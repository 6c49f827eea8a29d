"""Compiled functions follow their sources, whatever became of the cache."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from template_control import compiled

PACKAGE = Path(compiled.__file__).parent
CALLEE = """\
from template_control.compiled import inner

@inner
def factor(x):
    return {factor} * x
"""
CALLER = """\
from template_control.compiled import compiled
from template_control.toy_callee import factor

@compiled
def scaled(x):
    return factor(x)
"""
RUN = """\
import json
from template_control.toy_caller import scaled
value = scaled(1.0)
print(json.dumps([value, sum(scaled.stats.cache_hits.values()), scaled.stats.cache_path]))
"""


@pytest.fixture
def package(tmp_path):
    """A copy of the package's compiled.py with two modules; gives what writes the callee."""
    folder = tmp_path / "template_control"
    folder.mkdir()
    shutil.copy(PACKAGE / "compiled.py", folder)
    (folder / "__init__.py").touch()
    (folder / "toy_caller.py").write_text(CALLER)

    def write(factor):
        (folder / "toy_callee.py").write_text(CALLEE.format(factor=factor))
        return folder

    return write


def call(package, **environment):
    """Value, cache hits and cache folder of ``scaled(1.0)`` in a new process."""
    kept = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    more = {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(package.parent)}
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=package.parent,
        env=kept | more | environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    value, hits, path = json.loads(done.stdout)
    return value, hits, path and Path(path)


@pytest.mark.slow(seconds=6)
def test_a_caller_is_compiled_anew_when_what_it_calls_changes(package):
    """And the folders of old sources do not pile up."""
    assert call(package(2.0))[:2] == (2.0, 0)
    assert call(package(3.0))[:2] == (3.0, 0)
    assert call(package(2.0))[:2] == (2.0, 1)  # the first folder is still there
    for factor in (4.0, 5.0):
        value, _, path = call(package(factor))
        assert value == factor
    assert path.is_dir()
    assert len(list((package(0.0) / "__pycache__" / "compiled").iterdir())) == 3


@pytest.mark.slow(seconds=3)
def test_where_the_package_is_read_only_the_cache_is_the_users(package, tmp_path):
    folder = package(2.0)
    (folder / "__pycache__").write_text("a file: no folder can be made here")
    home = tmp_path / "home"
    assert call(folder, HOME=str(home))[:2] == (2.0, 0)
    value, hits, path = call(folder, HOME=str(home))
    assert (value, hits) == (2.0, 1)
    assert home in path.parents


@pytest.mark.slow(seconds=1)
def test_where_nothing_is_writable_functions_work_without_a_cache(package, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file: no folder can be made here")
    assert call(package(2.0), NUMBA_CACHE_DIR=str(blocked)) == (2.0, 0, None)


def test_another_library_keeps_its_own_cache_folder(monkeypatch):
    monkeypatch.setattr(compiled.numba.config, "CACHE_DIR", "elsewhere")
    compiled.inner(lambda x: x)
    assert compiled.numba.config.CACHE_DIR == "elsewhere"


def test_the_digest_covers_what_compiled_code_depends_on_and_no_more(tmp_path, monkeypatch):
    def digest():
        return compiled._digest()

    def append(name, text="# changed\n"):
        path = tmp_path / "template_control" / name
        path.write_text(f"{path.read_text() if path.exists() else ''}\n{text}")

    shutil.copytree(PACKAGE, tmp_path / "template_control", ignore=shutil.ignore_patterns("__*__"))
    monkeypatch.setattr(compiled, "_PACKAGE", tmp_path / "template_control")
    found = [digest()]
    append("cli/main.py")
    assert digest() == found[0]
    for name in ("slip/dynamics/guards.py", "slip/automaton/vocabulary.py", "compiled.py"):
        append(name)
        found.append(digest())
    for names in ("NUM_EVENTS, numbers", "(\n    more_numbers,\n)"):  # modules, by a package
        append("slip/dynamics/guards.py", f"from template_control.slip import {names}\n")
        found.append(digest())
        append(f"slip/{'more_numbers' if '(' in names else 'numbers'}.py")
        found.append(digest())
    assert len(set(found)) == len(found)


def test_every_compiled_function_of_the_package_goes_through_the_cache():
    texts = {path: path.read_text() for path in PACKAGE.rglob("*.py")}
    assert [p.name for p, text in texts.items() if "njit" in text] == ["compiled.py"]


FLAGS = """\
import numpy
from template_control.compiled import compiled, inner

@compiled
def product_sum(a, b, c):
    return a * b + c

@inner
def through(a, b, c):
    return product_sum(a, b, c)

FIRST(1.0, 2.0, 3.0)
product_sum(1.0, 2.0, 3.0)
[(signature, code)] = product_sum.overloads.items()
print("contract" in product_sum.inspect_llvm(signature))
print([code.fndesc.llvm_func_name for code in through.overloads.values()])
"""


@pytest.mark.slow(seconds=4)
def test_a_function_has_its_own_flags_whatever_it_is_compiled_for(tmp_path):
    """Not those of a function that calls it; and its name is the same in all processes."""
    said = {}
    for first in ("product_sum", "through"):
        for seed in ("1", "2"):
            path = tmp_path / f"{first}_{seed}" / "flags.py"
            path.parent.mkdir()
            path.write_text(FLAGS.replace("FIRST", first))
            more = {"PYTHONHASHSEED": seed, "NUMBA_CACHE_DIR": str(path.parent)}
            done = subprocess.run(
                [sys.executable, path],
                env=os.environ | more | {"PYTHONPATH": str(PACKAGE.parent)},
                stdout=subprocess.PIPE,
                text=True,
                check=True,
            )
            said[first, seed] = done.stdout.splitlines()
    assert {lines[0] for lines in said.values()} == {"False"}
    assert said["through", "1"][1] == said["through", "2"][1] != "[]"
