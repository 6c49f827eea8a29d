"""Compiled functions follow their sources, whatever became of the cache."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from template_control import compiled
from template_control.code_cache.source_stamp import sources
from template_control.slip.dynamics.guards import guard

_FACTOR = """\
from template_control.compiled import inner

UNIT = {unit}


@inner
def factor(x):
    return {factor} * x
"""
_CALLER = """\
from template_control.compiled import compiled
from toy.factor import UNIT, factor


@compiled
def scaled(x):
    return UNIT * factor(x)
"""
_RUN = """\
import json
from toy.caller import scaled
value = scaled(1.0)
hits = sum(scaled.stats.cache_hits.values())
print(json.dumps([value, hits, scaled.stats.cache_path]))
"""


@pytest.fixture
def toy(tmp_path):
    """A package of two modules; yields the function that writes the called one."""
    package = tmp_path / "toy"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "caller.py").write_text(_CALLER)

    def write(factor, unit=1.0):
        (package / "factor.py").write_text(_FACTOR.format(factor=factor, unit=unit))
        return package

    return write


def call(package, run=_RUN, **environment):
    """Value, cache hits and cache folder of ``scaled(1.0)`` in a new process, by ``run``."""
    root = str(Path(compiled.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", run],
        env={
            **{k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"},
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONPATH": os.pathsep.join((str(package.parent), root)),
            **environment,
        },
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits, path = json.loads(done.stdout.splitlines()[-1])
    return value, hits, path and Path(path)


@pytest.mark.slow(seconds=3)
def test_a_caller_is_compiled_with_what_the_cache_has_of_its_callee(toy):
    value, _, folder = call(toy(2.0))
    for kept in folder.glob("caller.scaled*"):
        kept.unlink()
    assert list(folder.glob("factor.factor*.nbc"))
    assert call(toy(2.0))[:2] == (value, 0)
    assert list(folder.glob("caller.scaled*.nbc"))


@pytest.mark.slow(seconds=8)
def test_a_caller_is_compiled_anew_when_what_it_calls_changes(toy):
    assert call(toy(2.0))[:2] == (2.0, 0)
    assert call(toy(2.0))[:2] == (2.0, 1)
    assert call(toy(3.0))[:2] == (3.0, 0)
    assert call(toy(3.0, unit=0.5))[:2] == (1.5, 0)
    # And back again: the first content's folder is still there.
    assert call(toy(2.0))[:2] == (2.0, 1)


@pytest.mark.slow(seconds=8)
def test_folders_of_old_contents_do_not_pile_up(toy):
    for factor in range(5):
        value, _, path = call(toy(float(factor)))
        assert value == factor
    assert path.is_dir()
    assert len(list(path.parent.iterdir())) <= 4


@pytest.mark.slow(seconds=3)
def test_where_the_package_is_read_only_the_cache_is_the_users(toy, tmp_path):
    package = toy(2.0)
    (package / "__pycache__").write_text("a file: no folder can be made here")
    home = tmp_path / "home"
    places = {"HOME": str(home), "XDG_CACHE_HOME": str(home)}
    assert call(package, **places)[:2] == (2.0, 0)
    value, hits, path = call(package, **places)
    assert (value, hits) == (2.0, 1)
    assert home in path.parents


def test_where_nothing_is_writable_functions_work_without_a_cache(toy, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file: no folder can be made here")
    assert call(toy(2.0), NUMBA_CACHE_DIR=str(blocked)) == (2.0, 0, None)


@pytest.mark.slow(seconds=3)
def test_a_script_is_its_own_source(toy, tmp_path):
    script = tmp_path / "script.py"
    for value in (2.0, 3.0):
        toy(2.0)
        script.write_text(_CALLER.replace("UNIT *", f"{value} *"))
        run = _RUN.replace("toy.caller", "script")
        assert call(tmp_path / "toy", run)[:2] == (2.0 * value, 0)


def test_the_stamp_covers_compiled_modules_and_what_they_import():
    package = Path(compiled.__file__).parent
    found = {str(Path(p).relative_to(package)) for p in sources(package)}
    assert "slip/dynamics/guards.py" in found
    assert "slip/automaton/vocabulary.py" in found  # its integers are frozen into the code
    assert "cli/main.py" not in found


def test_every_compiled_function_of_the_package_goes_through_the_cache():
    package = Path(compiled.__file__).parent
    users = [p for p in package.rglob("*.py") if "numba" in p.read_text().split('"""', 2)[-1]]
    assert [p.name for p in users if "import njit" in p.read_text()] == ["compiled.py"]


def test_inner_functions_run_as_python_from_python():
    assert guard(0, [0.0, 0.9, 1.0, 0.0], [0.0, 0.0], 1.0, 0.95) == pytest.approx(0.05)
