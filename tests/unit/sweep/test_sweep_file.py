"""The file of a sweep: what survives in it, and what goes on from it."""

import json
import math
import os
import resource
import signal
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from places import ROOT, TESTS
from sweep_work import (
    COUNT,
    P,
    alive,
    calls,
    kept,
    lines,
    logged,
    other,
    quietly,
    square,
    wait_until,
)

from template_control.errors import SweepError
from template_control.storage import to_jsonable
from template_control.sweep.sweep import grid


def deadly(x):
    """Kills its process once, at x = 7."""
    mark = Path(os.environ["SWEEP_LOG"] + ".mark")
    if x == 7 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return logged(x)


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
    once = to_jsonable(value)
    # repr tells NaN from None and 1 from 1.0 and True; equality does not.
    assert repr(json.loads(json.dumps(once))) == repr(once)
    assert repr(to_jsonable(once)) == repr(once)


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
from template_control.sweep import grid
from sweep_work import COUNT, logged, quietly
quietly(logged, grid(x=range(COUNT)), {path!r}, {executor}, seed=1)
"""


def start_killed(path, executor="None"):
    """The sweep of ``logged`` in a process of its own, which leads a process group."""
    paths = os.pathsep.join([str(TESTS), str(ROOT), os.environ.get("PYTHONPATH", "")])
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


@pytest.mark.slow(seconds=1)
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


@pytest.mark.parametrize(
    ("change", "culprit"),
    [
        (
            {"function": other},
            r"another sweep \(function sweep_work.square, not sweep_work.other",
        ),
        ({"function": partial(square)}, r"another sweep \(function"),
        ({"seed": 1}, r"another sweep \(seed 0, not 1\)"),
        ({"items": grid(x=[0, 1, 3])}, r"another sweep \(another item 2\)"),
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


@pytest.mark.parametrize("line", ["junk", "3", '{"index": -1, "result": 0}', '{"index": 1}'])
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


@pytest.mark.slow(seconds=1)
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
