"""Compiled code made ready by several processes: once each, whoever dies meanwhile."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import template_control
from template_control.file_lock import LOCKS, FileLock, locked

pytestmark = pytest.mark.skipif(not LOCKS, reason="processes cannot see one another's locks here")

_WAIT = 60.0  # [s] for what takes a moment
# Whoever imports the package tells what it compiles of it.
_INIT = """\
import os
from numba.core import event


class Tell(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("toy"):
            with open(os.environ["TOY_LOG"], "a") as log:
                log.write(f"{function.__name__} {event.data['args']}\\n")

    def on_end(self, event):
        pass


event.register("numba:compile", Tell())
"""
_KERNELS = """\
from template_control.compiled import compiled, inner


@inner
def shared(x):
    return x * x + 1


@inner
def cube(x):
    return x * shared(x)


@compiled
def one(x):
    return cube(x) + shared(x)


@compiled
def two(x):
    return cube(x) - shared(x)
"""
_PARTS = """\
import os
import signal
import time
from pathlib import Path

from toy.kernels import one, two

HERE = Path(__file__).parent


def is_helper():
    return os.environ["TOY_MAIN"] != str(os.getpid())


def meet():
    \"\"\"Until main and helper are both here.\"\"\"
    (HERE / ("helper" if is_helper() else "main")).touch()
    while not ((HERE / "helper").exists() and (HERE / "main").exists()):
        time.sleep(0.01)


def real_one():
    one(2.0)


def complex_one():
    one(2.0j)


def real_two():
    two(2.0)


def complex_two():
    two(2.0j)


def stays():
    if is_helper():
        return
    meet()
    one(2.0)


def dies():
    if is_helper():
        meet()
        os.kill(os.getpid(), signal.SIGKILL)
    one(2.0j)


def is_killed():
    meet()
    os.kill(os.getpid(), signal.SIGKILL)


def goes_on():
    meet()
    time.sleep(600.0)
"""
# As a user's: nothing keeps it from being run again by a process that imports it.
_SCRIPT = """\
import json, os, sys
os.environ["TOY_MAIN"] = str(os.getpid())
with open(os.environ["TOY_LOG"], "a") as log:
    log.write("script\\n")
from template_control import parts
from toy import kernels, parts as toy
parts._cores = lambda: int(os.environ["TOY_CORES"])
parts.ready([getattr(toy, name) for name in sys.argv[1:]])
print(json.dumps(kernels.one(3.0)))
"""


@pytest.fixture
def toy(tmp_path):
    """Starts a script that wants parts of a toy package; gives its process."""
    package = tmp_path / "toy"
    package.mkdir()
    for name, content in (("__init__", _INIT), ("kernels", _KERNELS), ("parts", _PARTS)):
        (package / f"{name}.py").write_text(content)
    (tmp_path / "script.py").write_text(_SCRIPT)
    root = str(Path(template_control.__file__).parents[1])
    environment = {
        **{k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"},
        "PYTHONPATH": os.pathsep.join((str(tmp_path), root)),
        "TOY_LOG": str(tmp_path / "log"),
    }

    def start(*parts, cores=2, **more):
        return subprocess.Popen(
            [sys.executable, str(tmp_path / "script.py"), *parts],
            env={**environment, "TOY_CORES": str(cores), **more},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


def ended(process):
    out, err = process.communicate(timeout=_WAIT)
    assert (process.returncode, err) == (0, "")
    assert json.loads(out) == 40.0


ALL = ("real_one", "complex_one", "real_two", "complex_two")


def compiled_by_all(tmp_path):
    return sorted((tmp_path / "log").read_text().splitlines())


@pytest.mark.slow(seconds=6)
def test_processes_that_start_together_compile_each_function_once(toy, tmp_path):
    processes = [toy(*ALL), toy(*ALL)]
    for process in processes:
        ended(process)
    lines = compiled_by_all(tmp_path)
    expected = [
        f"{name} ({number},)"
        for name in ("shared", "cube", "one", "two")
        for number in ("float64", "complex128")
    ]
    assert lines == sorted([*expected, "script", "script"])
    ended(toy(*ALL))
    assert compiled_by_all(tmp_path) == sorted([*lines, "script"])


@pytest.mark.slow(seconds=2)
def test_one_core_has_no_helper(toy, tmp_path):
    ended(toy("real_one", "real_two", cores=1))
    assert len(compiled_by_all(tmp_path)) == 5
    assert not list(tmp_path.rglob("helper-*"))


def test_where_nothing_can_be_kept_the_process_compiles_for_itself(toy, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file: no folder can be made here")
    ended(toy("real_one", "real_two", NUMBA_CACHE_DIR=str(blocked)))
    assert len(compiled_by_all(tmp_path)) == 5


@pytest.mark.slow(seconds=3)
def test_what_a_killed_helper_had_taken_is_done_all_the_same(toy, tmp_path):
    ended(toy("stays", "dies"))
    assert (tmp_path / "toy" / "helper").exists()
    assert compiled_by_all(tmp_path).count("one (complex128,)") == 1


def test_a_helper_ends_when_its_parent_is_killed(toy, tmp_path):
    process = toy("is_killed", "goes_on")
    process.communicate(timeout=_WAIT)
    assert process.returncode < 0
    (slot,) = tmp_path.rglob("helper-0")
    late = time.monotonic() + _WAIT
    while not FileLock(slot).take():
        assert time.monotonic() < late
        time.sleep(0.01)


def test_a_lock_has_one_holder(tmp_path):
    path = tmp_path / "folder" / "lock"
    one, other = FileLock(path), FileLock(path)
    assert one.take()
    assert not other.take()
    one.release()
    assert other.take()
    other.release()
    with locked(path):
        assert not one.take()
    assert one.take()


def test_a_lock_in_no_folder_stops_nobody(tmp_path):
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "lock"
    assert FileLock(path).take()
    assert FileLock(path).take()


_RUN = """\
import template_control as tc
from template_control import compiled

robot = tc.load_robot("five-link")
gait = tc.default_gait(robot)
planner = tc.LqrPlanner(gait)
tc.embedding.EmbeddingController(robot, planner)
route = tc.slip.CatchingRoute(tc.slip.SteadyRoute.of(gait))
tc.embedding.default_planners(route, planner)  # of what the walk may break into
wanted = []
load = compiled._Cache.load_overload


def listen(self, sig, context):
    wanted.append(self._name)
    return load(self, sig, context)


compiled._Cache.load_overload = listen
far = planner.decide(0.8 * gait.vlo)
options = tc.SimulationOptions(steps=2, pushes=(tc.Push(impulse=20.0, step=1),))
tc.simulate(robot, planner, options)
print(far.nominal, wanted)
"""


@pytest.mark.slow(seconds=4)
def test_a_run_compiles_and_loads_nothing_not_even_for_the_search():
    done = subprocess.run([sys.executable, "-c", _RUN], capture_output=True, text=True)
    assert done.stdout == "False []\n", done.stderr
