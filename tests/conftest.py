"""What tests share: robot, gaits, a short walk, how a mistake is told, and their own setting."""

import os
import shlex
import signal
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import build_parser, main

NEEDED = "needs the package pybullet"


def pytest_configure():
    """Make what a test sees independent of who runs the tests."""
    # A shell without job control starts its background jobs with SIGINT ignored, which the
    # processes that the tests interrupt would inherit.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items):
    """Start the longest first: none shall be left to one process at the end."""

    def seconds(item):
        mark = item.get_closest_marker("slow")
        if mark is None:
            return 0.0
        assert not mark.args, f"{item.nodeid}: slow(seconds=...), by name"
        return mark.kwargs.get("seconds", 0.0)

    items.sort(key=seconds, reverse=True)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Skip what needs PyBullet where it is not installed."""
    if call.excinfo and find_spec("pybullet") is None and NEEDED in str(call.excinfo.value):
        with pytest.raises(pytest.skip.Exception) as skipped:
            pytest.skip("needs PyBullet")
        call.excinfo = skipped
    return (yield)


@pytest.fixture
def robot():
    return tc.load_robot("five-link")


@pytest.fixture(scope="session")
def gait():
    return tc.gait_at(tc.SlipParameters(), np.radians(66.0), 1.1)


@pytest.fixture(scope="session")
def default_gait():
    """What the five-link robot walks with unless told otherwise: ``gait``, but for rounding."""
    return tc.default_gait(tc.load_robot("five-link"))


@pytest.fixture(scope="session")
def brisk_gait():
    """1.2 m/s on average, for tests that draw many states and cannot make it for each."""
    return tc.gait_for_speed(tc.SlipParameters(), 1.2, touchdown_angle=np.radians(66.0))


@pytest.fixture(scope="session")
def paper_gait():
    """The paper's walking equilibrium: 0.9818 m and 826 J."""
    return tc.gait_from_energy(tc.SlipParameters(), 0.9818, 826.0)


@pytest.fixture(scope="session")
def long_walk(default_gait):
    """Twelve steps of the five-link robot on its default gait, recorded."""
    robot = tc.load_robot("five-link")
    return tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=12))


@pytest.fixture
def random_states():
    """Twenty states (q, v) of the five-link robot, seeded."""
    rng = np.random.default_rng(7)
    low = np.array([-1.0, 0.5, -0.5, -0.9, 0.2, -0.9, 0.2])
    high = np.array([1.0, 1.0, 0.5, 0.5, 1.2, 0.5, 1.2])
    return [(rng.uniform(low, high), rng.normal(0.0, 1.5, 7)) for _ in range(20)]


@pytest.fixture(scope="session")
def short_walk(default_gait):
    """Four steps of the five-link robot on its default gait, recorded."""
    robot = tc.load_robot("five-link")
    return tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=4))


@pytest.fixture
def refused(capfd):
    """Runs a command that must refuse what it is given; its one line on stderr."""

    def run(arguments):
        assert main(arguments) == 2
        captured = capfd.readouterr()
        assert captured.out == ""
        # The first command on a machine says that it compiles.
        (line,) = (x for x in captured.err.strip().splitlines() if not x.startswith("compiling"))
        return line

    return run


@pytest.fixture
def understood():
    """Parses a line that a page prints; refuses options that its command does not have."""

    def parse(line):
        program, *words = shlex.split(line)
        assert program == "template-control"
        return build_parser(words).parse_args(words)

    return parse


@pytest.fixture
def log(tmp_path, monkeypatch):
    """How the calls of ``sweep_work.logged`` are told; read with ``sweep_work.calls``."""
    path = tmp_path / "calls.log"
    monkeypatch.setenv("SWEEP_LOG", str(path))
    return path


@pytest.fixture
def command():
    """Runs a command in a process of its own; its status, and what it says on stderr.

    With None for ``stdout`` the process begins with a closed standard output.
    """

    def run(*words, stdout, stderr=subprocess.PIPE, **environment):
        line = [sys.executable, "-m", "template_control.cli.main", *words]
        if stdout is None:
            line = ["sh", "-c", 'exec "$@" >&-', "sh", *line]
        done = subprocess.run(
            line,
            stdout=stdout,
            stderr=stderr,
            text=True,
            timeout=120,
            env={**os.environ, **environment},
        )
        return done.returncode, done.stderr or ""

    return run
