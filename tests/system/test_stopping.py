"""Ctrl-C, SIGTERM and SIGKILL: everything stops at once, and what was done is kept and said."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from places import TESTS
from sweep_work import alive, hold, square, wait_until

import template_control as tc
from template_control.cli import plots
from template_control.cli.main import main
from template_control.run.record import Record, RunInterrupted
from template_control.sweep import executor
from template_control.sweep.executor import workers

SECONDS = 2.0


def allowed():
    """[s] in which a command stops: two, times the processes that wait for each core."""
    return SECONDS * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def group(leader):
    """Processes of the group that ``leader`` leads, but for those that only wait to be buried."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, number = (folder / "stat").read_text().rsplit(")", 1)[1].split()[:3]
        except OSError:
            continue
        if int(number) == leader and state != "Z":
            found.append(int(folder.name))
    return found


def processor_time(pid):
    """[s] of processors that a process and its dead children have used."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def bury(process):
    """[s] of processors that a process and its dead children have used, once it has ended.

    Other children of this process, which end when they like, do not count.
    """
    used = []

    def has_ended():
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            used.append(usage.ru_utime + usage.ru_stime)
        return pid

    wait_until(has_ended, 60)
    return used[0]


def test_ctrl_c_ends_a_loop_of_runs(robot, default_gait):
    def impatient(_):
        raise KeyboardInterrupt

    def run(_):
        return tc.simulate(
            tc.Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=5), impatient
        )

    with pytest.raises(RunInterrupted) as stop:
        _ = [run(i) for i in range(3)]
    assert isinstance(stop.value, KeyboardInterrupt)
    assert stop.value.record.steps == 1
    assert stop.value.record.interrupted


def test_ctrl_c_while_figures_are_drawn_keeps_the_run_and_its_table(tmp_path, capfd, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(plots, "save_figures", interrupted)
    assert main(["walk", "--steps", "1", "--output", str(tmp_path)]) == 130
    told = capfd.readouterr()
    assert "mean speed" in told.out
    assert "interrupted: not all files are written" in told.err.splitlines()[-1]
    assert Record.load(tmp_path / "run.npz").steps == 1


def test_an_error_kills_workers_whatever_they_do():
    pids, before = [], set(threading.enumerate())

    def work():
        with workers(2) as pool:
            pids.extend(pool.submit(os.getpid).result() for _ in range(4))
            for _ in range(4):
                pool.submit(hold, 60.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    # A thread of the pool that still ends as Python exits leaves a traceback.
    assert all(thread.daemon for thread in set(threading.enumerate()) - before)
    wait_until(lambda: not any(map(alive, pids)), allowed())


def test_a_worker_that_dies_at_an_interrupt_leaves_no_traceback(monkeypatch):
    broken = []
    monkeypatch.setattr(threading, "excepthook", broken.append)
    # The executor's thread is to notice before it is told of the end.
    monkeypatch.setattr(executor, "wait", lambda *_: time.sleep(0.2))

    def impatient(*_):
        for process in multiprocessing.active_children():
            process.kill()
        raise KeyboardInterrupt

    calls = ((i, {"x": i}) for i in range(50))
    with pytest.raises(KeyboardInterrupt), workers(1) as pool:
        executor.run_calls(square, calls, pool, 40, impatient, lambda: None)
    assert not broken


@pytest.mark.slow(seconds=2)
def test_workers_end_with_their_parent_once_a_compiled_call_returns():
    code = """
import os
from sweep_work import hold
from template_control.sweep.executor import workers
with workers(2) as pool:
    print(*{pool.submit(os.getpid).result() for _ in range(8)}, flush=True)
    list(pool.map(hold, [0.5] * 100))
"""
    paths = [str(TESTS), os.getcwd(), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        start_new_session=True,
    )
    pids = [int(word) for word in process.stdout.readline().split()]
    assert pids
    wait_until(lambda: len(group(process.pid)) == 3)
    time.sleep(0.2)  # the workers are to be in the call
    process.kill()
    process.communicate()
    wait_until(lambda: not group(process.pid), allowed())


DEAF = {
    "callback": "ctypes.CFUNCTYPE(None)(stop)()",
    "finaliser": "Dying()",
    "fork": "os.register_at_fork(after_in_parent=stop); os.fork() or os._exit(0)",
}


@pytest.mark.parametrize("deaf", DEAF)
def test_an_interrupt_that_python_swallows_comes_again(deaf):
    code = f"""
import ctypes, os, signal, sys, time, types
from template_control.cli import main
def stop():
    os.kill(os.getpid(), signal.SIGTERM)
    for _ in range(1000): pass
class Dying:
    def __del__(self): stop()
def run(_):
    {DEAF[deaf]}
    print("swallowed", flush=True)
    time.sleep(60.0)
stub = types.ModuleType("stub")
stub.add_options, stub.run = lambda parser: None, run
sys.modules["template_control.stub"] = stub
main._PLACES["walk"] = "stub:"
sys.argv = ["template-control", "walk"]
sys.exit(main.main())
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "swallowed\n"
    sent = time.monotonic()
    _, told = process.communicate(timeout=50)
    assert time.monotonic() - sent < allowed()
    assert process.returncode == 130
    assert told == "template-control: interrupted, nothing is kept\n"


def catches(pid, number):
    """Whether a process has a handler of its own for a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    return bool(caught >> (number - 1) & 1)


COMMANDS = {
    "walk": ["walk", "--steps", "200"],
    "robustness": ["robustness", "--quick", "--disturbance", "friction"],
    "fig12": ["reproduce", "fig12"],
}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
LATEST = 5.0  # [s] after a command has begun that it is stopped


def moments(seed):
    """(Command, signal, moment [s]): each command meets two signals, each signal two commands."""
    pairs = [(n, SIGNALS[(i + k) % 3]) for i, n in enumerate(COMMANDS) for k in range(2)]
    moments = np.random.default_rng(seed).uniform(0.0, LATEST, len(pairs))
    return [(*pair, float(at)) for pair, at in zip(pairs, moments, strict=True)]


@pytest.mark.slow(seconds=5)
@pytest.mark.parametrize(("name", "number", "at"), moments(seed=12))
def test_a_command_stops_at_any_moment_and_spoils_nothing(tmp_path, short_walk, name, number, at):
    good = short_walk.save(tmp_path / "run.npz")
    (tmp_path / "fig12.png").write_bytes(b"a good one")
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "template_control.cli.main", *COMMANDS[name]),
            *("--output", str(tmp_path)),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_until(lambda: catches(process.pid, signal.SIGTERM))
    time.sleep(at)
    used = sum(map(processor_time, group(process.pid)))
    process.send_signal(number)
    in_all = bury(process)
    wait_until(lambda: not group(process.pid), 60)
    assert in_all - used < SECONDS
    told = process.stderr.read()
    process.stdout.close()
    process.stderr.close()
    if number == signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 130
        assert "Traceback" not in told
        last = told.strip().splitlines()[-1]
        assert last.startswith("template-control: interrupted")
        assert f"the run up to here is in {good}" in last or Record.load(good).steps == 4
    assert Record.load(good).steps >= 0
    assert (tmp_path / "fig12.png").read_bytes() == b"a good one"
    for path in tmp_path.glob("trials-*.jsonl"):
        whole = path.read_bytes().rpartition(b"\n")[0].splitlines()
        assert all(json.loads(line) for line in whole)
