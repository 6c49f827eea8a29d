"""Sweeps: order, seeds, failures, the file they go on from, and the executors they run on."""

import json
import math
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.embedding.lqr import LqrPlanner
from template_control.errors import SweepError
from template_control.plant.simulation import SimulationOptions, simulate
from template_control.robot.library import load_robot
from template_control.slip.gait import gait_at
from template_control.slip.parameters import SlipParameters
from template_control.slip.return_map import ReturnMap
from template_control.slip.scenario import Segment, example_one
from template_control.slip.scenario_run import simulate_scenario
from template_control.slip.vocabulary import MapKind, Outcome
from template_control.sweep import grid, item_seed, sample, sweep
from template_control.sweep_file import plain

P = SlipParameters()
COUNT = 60

quietly = partial(sweep, progress=False)


def square(x):
    return x * x


def drawn(x, seed):
    time.sleep(0.001 * (x % 3))  # later items may finish first
    return {"x": x, "seed": seed, "draw": np.random.default_rng(seed).uniform()}


def fragile(x):
    if x == 2:
        raise ValueError("two is too much")
    if x == 3:
        sys.exit("leaving")
    if x == 4:
        return object()
    return {"root": math.sqrt(x)}


def logged(x, pause=0.02):
    """Tells SWEEP_LOG that it ran, and in which process; cut short by Ctrl-C, as a robot's run."""
    try:
        time.sleep(pause)
    except KeyboardInterrupt:
        return {"square": -1, "pid": os.getpid()}
    with Path(os.environ["SWEEP_LOG"]).open("a") as log:
        log.write(f"{x} {os.getpid()}\n")
    return {"square": x * x, "pid": os.getpid()}


def deadly(x):
    """Kills its process once, at x = 7."""
    mark = Path(os.environ["SWEEP_LOG"] + ".mark")
    if x == 7 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return logged(x)


def walking_step(angle, speed):
    gait = gait_at(P, np.radians(angle), speed)
    mapped = ReturnMap(P, "w")(gait.vlo, gait.controls)
    return {"outcome": mapped.outcome, "error": np.max(np.abs(mapped.state - gait.vlo))}


def short_scenario(speed, kind):
    scenario = replace(
        example_one(MapKind[kind]), segments=(Segment("walk", speed=speed, steps=3),)
    )
    record = simulate_scenario(scenario)
    return {"completed": record.completed, "speed": record.section_state[-1, 0]}


def robot_run(speed):
    gait = gait_at(P, np.radians(66.0), speed)
    record = simulate(load_robot("five-link"), LqrPlanner(gait), SimulationOptions(steps=2))
    return {"fell": record.fell, "steps": record.steps, "distance": record.com[-1, 0]}


def alive(pid):
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False


def wait_until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


def lines(path):
    """Complete lines of a file."""
    return path.read_text().split("\n")[:-1] if path.exists() else []


def kept(path):
    """Indices of the items a results file holds."""
    return [json.loads(line)["index"] for line in lines(path)[1:]]


@pytest.fixture
def log(tmp_path, monkeypatch):
    """How the calls of ``logged`` are told; read with ``calls``."""
    path = tmp_path / "calls.log"
    monkeypatch.setenv("SWEEP_LOG", str(path))
    return path


def calls(log):
    """(x, pid) of the calls since the last look."""
    found = [tuple(map(int, line.split())) for line in lines(log)]
    log.unlink(missing_ok=True)
    return found


def test_grid_is_the_product_last_axis_fastest():
    assert grid(a=[1, 2], b=["x", "y"]) == [
        {"a": 1, "b": "x"},
        {"a": 1, "b": "y"},
        {"a": 2, "b": "x"},
        {"a": 2, "b": "y"},
    ]
    assert [type(item["v"]) for item in grid(v=np.linspace(0.0, 1.0, 2))] == [float, float]
    for axis in ("walk", 3.0):
        with pytest.raises(SweepError, match=r"axis gait is .* give a list"):
            grid(gait=axis)


def test_samples_are_uniform_seeded_and_grow():
    items = sample(4000, 5, speed=(0.5, 1.5), angle=(-70.0, -60.0))
    speed, angle = np.array([[i["speed"], i["angle"]] for i in items]).T
    assert speed.min() >= 0.5
    assert speed.max() <= 1.5
    assert np.mean(speed) == pytest.approx(1.0, abs=0.02)
    assert np.var(angle) == pytest.approx(100.0 / 12.0, rel=0.05)
    assert abs(np.corrcoef(speed, angle)[0, 1]) < 0.05
    assert sample(10, 5, speed=(0.5, 1.5), angle=(-70.0, -60.0)) == items[:10]
    assert sample(10, 6, speed=(0.5, 1.5), angle=(-70.0, -60.0)) != items[:10]
    for bounds in ((1.0, 0.0), (0.0, math.inf), 3.0):
        with pytest.raises(SweepError, match=r"range speed is .* give"):
            sample(3, 0, speed=bounds)


@settings(max_examples=25, deadline=None)
@given(
    xs=st.lists(st.integers(0, 50), max_size=30),
    seed=st.integers(0, 2**40),
    in_flight=st.integers(1, 8),
)
def test_order_and_seeds_do_not_depend_on_how_it_runs(xs, seed, in_flight):
    items = [{"x": x} for x in xs]
    with ThreadPoolExecutor(3) as threads:
        result = quietly(drawn, items, executor=threads, seed=seed, in_flight=in_flight)
    seeds = [item_seed(seed, i) for i in range(len(xs))]
    assert result.items == tuple(items)
    assert list(result.seeds) == seeds
    assert list(result.results) == [drawn(x, s) for x, s in zip(xs, seeds, strict=True)]
    assert len(set(seeds)) == len(seeds)


def test_processes_give_what_threads_give():
    items = grid(x=range(20))
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        results = [quietly(drawn, items, executor=e, seed=3) for e in (threads, processes, None)]
    assert results[0] == results[1] == results[2]
    assert quietly(drawn, items, seed=4).seeds != results[0].seeds


def test_failures_are_recorded_with_their_reason(tmp_path):
    items = grid(x=[0, 1, 2, 3, 4, -5, 9])
    path = tmp_path / "s.jsonl"
    result = quietly(fragile, items, path)
    assert result.failures == {
        2: "ValueError: two is too much",
        3: "SystemExit: leaving",
        4: "TypeError: a object is no plain data: give numbers, texts, arrays, or lists and"
        " dictionaries of them",
        5: "ValueError: math domain error",
    }
    np.testing.assert_array_equal(
        result.column("root"), [0.0, 1.0, np.nan, np.nan, np.nan, np.nan, 3.0]
    )
    assert result.results[2] is None
    assert quietly(fragile, items, path) == result


def failing_until(x):
    if not Path(os.environ["SWEEP_LOG"] + ".mended").exists():
        raise RuntimeError("not yet")
    return logged(x, 0.0)["square"]


def test_failures_are_kept_unless_asked_for(tmp_path, log):
    path, items = tmp_path / "s.jsonl", grid(x=range(4))
    assert len(quietly(failing_until, items, path).failures) == 4
    Path(f"{log}.mended").touch()
    assert len(quietly(failing_until, items, path).failures) == 4
    assert calls(log) == []
    again = quietly(failing_until, items, path, retry_failed=True)
    assert not again.failures
    assert quietly(failing_until, items, path) == again
    assert len(calls(log)) == 4
    np.testing.assert_array_equal(again.column(), [0, 1, 4, 9])


def test_columns_are_arrays_or_refused():
    items = grid(x=[1, 2, 3])
    with ThreadPoolExecutor(1) as threads:
        run = partial(quietly, items=items, executor=threads)
        rows = run(lambda x: {"v": [x, math.nan if x == 2 else x]} if x < 3 else 1 / 0)
        np.testing.assert_array_equal(rows.column("v"), [[1, 1], [2, np.nan], [np.nan, np.nan]])
        assert run(lambda x: 1 / 0).column("v").shape == (3,)
        with pytest.raises(SweepError, match="item 0: 'w' is missing"):
            rows.column("w")
        with pytest.raises(SweepError, match="item 0: the result is missing or is no number"):
            run(lambda x: "text").column()
        with pytest.raises(SweepError, match="another shape"):
            run(lambda x: [0] * x).column()


numbers = st.floats() | st.integers() | st.booleans() | st.none() | st.text()
data = st.recursive(
    numbers | st.floats().map(np.float64) | st.integers(-9, 9).map(np.int32),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text(max_size=3), inner, max_size=3)
        | st.lists(st.floats(), min_size=1, max_size=3).map(np.array)
    ),
    max_leaves=8,
)


@given(value=data)
def test_plain_data_survive_json(value):
    once = plain(value)
    # repr tells NaN from None and 1 from 1.0 and True; equality does not.
    assert repr(json.loads(json.dumps(once))) == repr(once)
    assert repr(plain(once)) == repr(once)


def test_numpy_and_not_finite_numbers_survive_the_file(tmp_path):
    def function(x):
        return {"a": np.array([[x, np.nan], [np.inf, -np.inf]]), 3: np.bool_(True), "e": P.mass}

    items = [{"x": np.float64(1.5)}, {"x": math.inf}]
    with ThreadPoolExecutor(1) as threads:
        run = partial(quietly, function, items, tmp_path / "s.jsonl", threads)
        first, second = run(), run()
    for result in (first, second):
        expected = {"a": [[1.5, math.nan], [math.inf, -math.inf]], "3": True, "e": 80.0}
        assert repr(result.results[0]) == repr(expected)
        assert result.column("a").shape == (2, 2, 2)


KILLED = """
from concurrent.futures import ProcessPoolExecutor
from template_control.sweep import grid, sweep
from test_sweep import COUNT, logged
sweep(logged, grid(x=range(COUNT)), {path!r}, {executor}, seed=1, progress=False)
"""


def start_killed(path, executor="None"):
    """The sweep of ``logged`` in a process of its own, which leads a process group."""
    tests = str(Path(__file__).parent)
    paths = os.pathsep.join([tests, str(Path(tests).parent), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-c", KILLED.format(path=str(path), executor=executor)],
        env={**os.environ, "PYTHONPATH": paths},
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


@pytest.mark.parametrize(
    ("number", "send", "executor"),
    [
        (signal.SIGKILL, os.kill, "None"),
        pytest.param(signal.SIGTERM, os.kill, "None", marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, os.kill, "None", marks=pytest.mark.slow),
        (signal.SIGINT, os.killpg, "None"),  # as a terminal does
        pytest.param(signal.SIGINT, os.killpg, "ProcessPoolExecutor(2)", marks=pytest.mark.slow),
    ],
)
def test_a_killed_sweep_goes_on_where_it_stopped(tmp_path, log, number, send, executor):
    path = tmp_path / "s.jsonl"
    process = start_killed(path, executor)
    wait_until(lambda: len(kept(path)) >= COUNT // 3)
    send(process.pid, number)
    _, error = process.communicate(timeout=30)
    assert process.returncode == -number
    if executor == "None":
        assert error.count(b"Traceback") == (number == signal.SIGINT)
    finished = kept(path)
    assert COUNT // 3 <= len(finished) < COUNT
    workers = {pid for _, pid in calls(log)}
    wait_until(lambda: not any(map(alive, workers)))  # it left no processes behind
    calls(log)
    result = quietly(logged, grid(x=range(COUNT)), path, seed=1)
    assert sorted(x for x, _ in calls(log)) == sorted(set(range(COUNT)) - set(finished))
    np.testing.assert_array_equal(result.column("square"), np.arange(COUNT) ** 2)
    assert sorted(kept(path)) == list(range(COUNT))
    assert quietly(logged, grid(x=range(COUNT)), path, seed=1) == result
    assert calls(log) == []


def test_a_torn_last_line_is_dropped_wherever_it_is_torn(tmp_path, log):
    path, items = tmp_path / "s.jsonl", grid(x=range(3))
    with ThreadPoolExecutor(1) as threads:
        run = partial(quietly, partial(logged, pause=0.0), items, path, threads)
        whole = run()
        content = path.read_bytes()
        ends = [i + 1 for i, byte in enumerate(content) if byte == ord("\n")]
        calls(log)
        for cut in range(len(content)):
            path.write_bytes(content[:cut])
            assert run() == whole
            assert len(calls(log)) == sum(cut < end for end in ends[1:])
            assert path.read_bytes() == content


def test_a_dead_worker_process_ends_the_sweep_with_what_is_safe(tmp_path, log):
    path, items = tmp_path / "s.jsonl", grid(x=range(20))
    with pytest.raises(SweepError, match=r"of 20 results are safe in .*: run the same sweep again"):
        quietly(deadly, items, path)
    safe = kept(path)
    assert 0 < len(safe) < 20
    calls(log)
    result = quietly(deadly, items, path)
    np.testing.assert_array_equal(result.column("square"), np.arange(20) ** 2)
    assert sorted(x for x, _ in calls(log)) == sorted(set(range(20)) - set(safe))
    Path(f"{log}.mark").unlink()
    with pytest.raises(SweepError, match="nothing is kept: give a path"):
        quietly(deadly, items)


def test_an_executor_that_was_shut_down_is_told():
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(SweepError, match=r"broke down .*shutdown"):
        quietly(square, grid(x=range(3)), executor=pool)


def other(x):
    return x


@pytest.mark.parametrize(
    ("change", "culprit"),
    [
        ({"function": other}, r"another sweep \(function test_sweep.square, not test_sweep.other"),
        ({"function": partial(square)}, r"another sweep \(function"),
        ({"seed": 1}, r"another sweep \(seed 0, not 1\)"),
        ({"items": grid(x=range(4))}, r"another sweep \(items 3, not 4\)"),
        ({"items": grid(x=[0, 1, 3])}, r"another sweep \(other items\)"),
    ],
)
def test_a_file_of_another_sweep_is_left_alone(tmp_path, change, culprit):
    arguments = {"function": square, "items": grid(x=range(3)), "path": tmp_path / "s.jsonl"}
    with ThreadPoolExecutor(1) as threads:
        quietly(**arguments, executor=threads)
        content = arguments["path"].read_bytes()
        with pytest.raises(SweepError, match=culprit) as error:
            quietly(**{**arguments, **change}, executor=threads)
    assert "give another path" in str(error.value)
    assert "\n" not in str(error.value)
    assert arguments["path"].read_bytes() == content


@pytest.mark.parametrize("content", ["x,y\n1,2\n", "diary", '{"format": "else"}\n', "[]\n", "\n"])
def test_a_file_that_is_no_sweep_is_left_alone(tmp_path, content):
    path = tmp_path / "notes.txt"
    path.write_text(content)
    with pytest.raises(SweepError, match=r"notes.txt holds no sweep: give another path"):
        quietly(square, grid(x=range(3)), path)
    assert path.read_text() == content


@pytest.mark.parametrize("line", ["junk", "3", '{"index": 9, "result": 0}', '{"index": 1}'])
def test_a_line_that_is_no_result_is_named(tmp_path, line):
    path, items = tmp_path / "s.jsonl", grid(x=range(3))
    quietly(square, items, path)
    content = lines(path)
    content[2] = line
    path.write_text("\n".join(content) + "\n")
    with pytest.raises(SweepError, match=r"line 3 is no result: delete the line"):
        quietly(square, items, path)
    del content[2]
    path.write_text("\n".join(content) + "\n")
    np.testing.assert_array_equal(quietly(square, items, path).column(), [0, 1, 4])


def test_paths_that_cannot_be_written_are_named(tmp_path):
    items = grid(x=range(3))
    for path, why in ((tmp_path, "is no file"), (tmp_path / "none" / "s", "No such file")):
        with pytest.raises(SweepError, match=why):
            quietly(square, items, path)


def test_a_file_another_process_writes_is_refused(tmp_path, log):
    path = tmp_path / "s.jsonl"
    process = start_killed(path)
    try:
        wait_until(lambda: kept(path))
        with pytest.raises(SweepError, match="is being written by another sweep: wait"):
            quietly(logged, grid(x=range(COUNT)), path, seed=1)
        process.communicate(timeout=30)
    finally:
        process.kill()
    assert sorted(kept(path)) == list(range(COUNT))


def test_a_full_disk_ends_the_sweep_and_loses_nothing(tmp_path):
    path, items = tmp_path / "s.jsonl", grid(x=range(40))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with ThreadPoolExecutor(1) as threads:
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1500, hard))
            with pytest.raises(SweepError, match=r"cannot write to .*s.jsonl: File too large"):
                quietly(square, items, path, threads)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert 5 < len(kept(path)) < 40
        result = quietly(square, items, path, threads)
    np.testing.assert_array_equal(result.column(), np.arange(40) ** 2)
    assert max(Counter(kept(path)).values()) == 1


@pytest.mark.parametrize(
    ("function", "items", "options", "culprit"),
    [
        (square, [{"y": 1}], {}, "item 0 does not fit the function: missing .*'x'"),
        (square, [{"x": 1}, {"x": 1, "y": 1}], {}, "item 1 does not fit"),
        (square, [{"x": 1, "seed": 1}], {}, "item 0 is .* without 'seed'"),
        (square, [3], {}, "item 0 is 3: give a dictionary"),
        (square, [], {"seed": -1}, "seed is -1"),
        (square, [], {"in_flight": 0}, "in_flight 0"),
        (lambda x: x, [{"x": 1}], {}, "define it at the top level of a module"),
        (3, [{"x": 1}], {}, "3 shows no parameters: give a function"),
        (square, [{"x": P}], {"path": "s"}, "item 0 cannot be told in a file: a SlipParameters"),
        (partial(other, P), [{}], {"path": "s"}, "the function cannot be told in a file"),
    ],
)
def test_bad_input_is_named(tmp_path, monkeypatch, function, items, options, culprit):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SweepError, match=culprit):
        quietly(function, items, **options)
    assert not any(tmp_path.iterdir())


def test_no_items_give_no_results(tmp_path):
    for _ in range(2):
        result = quietly(square, [], tmp_path / "s.jsonl")
        assert result.items == result.results == ()
        assert result.column().shape == (0,)


def test_the_bar_is_on_stderr(capfd):
    sweep(fragile, grid(x=[1, 2, 9]), label="roots")
    out, error = capfd.readouterr()
    assert out == ""
    for text in ("roots", "3/3", "1 failed"):
        assert text in error


class Counting(ThreadPoolExecutor):
    """Counts the calls it has and has not finished."""

    def __init__(self):
        super().__init__(2)
        self.now = self.most = 0
        self.lock = threading.Lock()

    def _count(self, change):
        with self.lock:
            self.now += change
            self.most = max(self.most, self.now)

    def submit(self, *arguments, **keywords):
        self._count(1)
        future = super().submit(*arguments, **keywords)
        future.add_done_callback(lambda _: self._count(-1))
        return future


def test_no_more_items_than_asked_are_with_the_executor():
    with Counting() as pool:
        result = quietly(square, grid(x=range(500)), executor=pool, in_flight=7)
    assert 2 <= pool.most <= 7
    np.testing.assert_array_equal(result.column(), np.arange(500) ** 2)


def test_steps_of_the_template_in_processes():
    result = quietly(walking_step, grid(angle=[64.0, 66.0, 68.0], speed=[1.1, 40.0]))
    assert sorted(result.failures) == [1, 3, 5]  # no gait at 40 m/s
    assert all(reason.startswith("GaitError: ") for reason in result.failures.values())
    assert np.all(result.column("outcome")[::2] == Outcome.SECTION)
    assert np.max(result.column("error")[::2]) < 1e-9


def test_scenarios_in_processes():
    items = grid(speed=[1.1, 1.15], kind=["PAPER", "IMPROVED"])
    result = quietly(short_scenario, items)
    assert np.all(result.column("completed") == 1.0)
    assert np.all(result.column("speed")[2:] > result.column("speed")[:2])  # faster as asked
    assert list(result.results) == [plain(short_scenario(**item)) for item in items]


@pytest.mark.slow
def test_robot_runs_in_processes():
    items = grid(speed=[1.05, 1.1])
    result = quietly(robot_run, items)
    assert np.all(result.column("steps") == 2)
    assert not np.any(result.column("fell"))
    assert list(result.results) == [plain(robot_run(**item)) for item in items]


def fatal(x):
    """Kills every worker it is tried on, at x = 1."""
    if x == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def untouched(value):
    return value


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """A client of a local Dask cluster: two worker processes."""
    distributed = pytest.importorskip("distributed")
    cluster_of = partial(distributed.LocalCluster, processes=True, dashboard_address=None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SWEEP_LOG", str(tmp_path_factory.mktemp("dask") / "calls.log"))
        with (
            cluster_of(n_workers=2, threads_per_worker=1) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client


def test_dask_gives_what_processes_give(dask):
    items = grid(x=range(20))
    executor = dask.get_executor()
    assert quietly(drawn, items, executor=executor, seed=3) == quietly(drawn, items, seed=3)
    items = grid(angle=[64.0, 66.0], speed=[1.1, 40.0])
    assert quietly(walking_step, items, executor=executor) == quietly(walking_step, items)
    values = [[1, (2, 3)], {"a": [None, "x"]}, "('x', 0)", [math.inf], asdict(P)]
    result = quietly(untouched, grid(value=values), executor=executor)
    assert list(result.results) == plain(values)


def test_dask_retries_what_failed(dask, tmp_path):
    """Dask holds outcomes of equal calls; a new sweep must not get the old one's."""
    mark, executor = tmp_path / "mended", dask.get_executor()

    def mended(x, mark):
        if not os.path.exists(mark):
            raise RuntimeError("not yet")
        return x

    run = partial(quietly, mended, grid(x=range(3), mark=[str(mark)]), tmp_path / "s", executor)
    assert len(run().failures) == 3
    mark.touch()
    assert not run(retry_failed=True).failures


def test_a_killed_dask_worker_costs_no_result(dask, tmp_path):
    path, victim = tmp_path / "s.jsonl", []

    def slow(x):
        time.sleep(0.05)
        return {"square": x * x, "pid": os.getpid()}

    def kill():
        wait_until(lambda: len(kept(path)) >= COUNT // 3)
        pid = next(iter(dask.run(os.getpid).values()))
        os.kill(pid, signal.SIGKILL)
        victim.append((pid, len(kept(path))))

    killer = threading.Thread(target=kill)
    killer.start()
    result = quietly(slow, grid(x=range(COUNT)), path, dask.get_executor())
    killer.join()
    (pid, finished) = victim[0]
    assert finished < COUNT
    assert not alive(pid)
    assert not result.failures
    np.testing.assert_array_equal(result.column("square"), np.arange(COUNT) ** 2)
    # It had done some of them, and others did the rest.
    assert 0 < np.sum(result.column("pid") == pid) < COUNT
    assert sorted(kept(path)) == list(range(COUNT))


@pytest.mark.slow
def test_an_item_that_kills_dask_workers_is_a_failure(dask, tmp_path):
    run = partial(quietly, fatal, grid(x=range(4)), tmp_path / "s", dask.get_executor())
    failures = run().failures
    # Dask may blame a call that shared the worker; one at a time, only the culprit is left.
    assert 1 in failures
    assert all(reason.startswith("KilledWorker: ") for reason in failures.values())
    result = run(retry_failed=True, in_flight=1)
    assert list(result.failures) == [1]
    np.testing.assert_array_equal(result.column(), [0, np.nan, 2, 3])


def test_a_lost_dask_cluster_ends_the_sweep_with_what_is_safe(dask, tmp_path, log):
    from distributed import Client

    path, items = tmp_path / "s.jsonl", grid(x=range(COUNT))
    client = Client(dask.scheduler.address)

    def close():
        wait_until(lambda: len(kept(path)) >= COUNT // 3)
        client.close()

    closer = threading.Thread(target=close)
    closer.start()
    with pytest.raises(SweepError, match=rf"of {COUNT} results are safe in .*: run the same"):
        quietly(logged, items, path, client.get_executor())
    closer.join()
    result = quietly(logged, items, path, dask.get_executor())
    np.testing.assert_array_equal(result.column("square"), np.arange(COUNT) ** 2)
    assert max(Counter(kept(path)).values()) == 1
