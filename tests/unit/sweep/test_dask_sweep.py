"""Sweeps on a real local Dask cluster, whose workers die."""

import math
import os
import signal
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import partial

import numpy as np
import pytest
from sweep_work import COUNT, P, alive, drawn, kept, logged, quietly, wait_until, walking_step

from template_control.errors import SweepError
from template_control.storage import to_jsonable
from template_control.sweep import Study, run_study
from template_control.sweep.sweep import grid

# Starting a cluster and its workers takes longest. Of several processes that run tests, one runs
# all of these, and they share it.
pytestmark = [pytest.mark.slow(seconds=12), pytest.mark.xdist_group("dask")]


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
    assert list(result.results) == to_jsonable(values)


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


def test_an_item_that_kills_dask_workers_is_a_failure(dask, tmp_path, monkeypatch):
    # By default Dask gives up only after the fourth worker.
    monkeypatch.setattr(dask.cluster.scheduler, "allowed_failures", 0)
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


def test_a_study_is_the_same_on_dask(dask):
    study = Study(experiment={"steps": 1}, grid={"delay": (0.002,)}, figures=("mean_speed",))
    with ThreadPoolExecutor(1) as thread:
        alone = run_study(study, executor=thread)
    spread = run_study(study, executor=dask.get_executor())
    assert spread.results == alone.results
    assert not spread.failures
