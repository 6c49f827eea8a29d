"""Steps of passive walking a second and core, and how sweeps of them scale.

Run: python benchmarks/sweep_scaling.py [--json]

Every item is a batch of exact VLO-to-VLO steps. The same items run in a plain loop, on one
process, on two, and on a local Dask cluster of two workers (pip install -e '.[dask]'), all in
one run and taking turns, so that a busy machine slows all alike. Ratios to one process are
taken turn by turn, or between the best turns; the spread is from quartile to quartile. On a
machine with fewer than two idle cores the scaling tells what the others left; steps per second
of the workers' CPU time tell whether the work itself got slower. An item costs a process pool
some 0.1 ms, Dask 1 to 3 ms, and Dask's scheduler works on the same two cores.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import ExitStack
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Column, Table

from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.gaits.gait import gait_at
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.sweep.sweep import SweepOptions, grid, sweep

try:
    import distributed
except ImportError:
    distributed = None

_P = SlipParameters()
_STEPS = 20_000  # a batch
_BATCHES, _TURNS = 16, 5
_WIDTHS = np.array([0.1, 0.008, 0.05])  # [m/s, m, m/s] around the gait's VLO
_GAIT = gait_at(_P, np.radians(66.0), 1.1)

_BASE = "sweep, 1 process"

Row = dict[str, Any]
Way = Callable[[], NDArray[np.float64]]
"""Runs all items; CPU time [s] and steps that reached the next VLO of each (batches, 2)."""


class Turn(NamedTuple):
    """All items once.

    Attributes:
        wall, cpu: time passed; the workers' CPU time [s].
        reached: share of the steps that reached the next VLO.
    """

    wall: float
    cpu: float
    reached: float


def batch(vlo: list[float], controls: list[float], steps: int, seed: int) -> tuple[float, int]:
    """Steps from states drawn around a gait's VLO: CPU time [s], how many reached the next."""
    start = time.process_time()
    draws = np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 3))
    mapped = ReturnMap(_P, "w")(vlo + _WIDTHS * draws, np.tile(controls, (steps, 1)))
    reached = int(np.sum(mapped.outcome == Outcome.SECTION))
    return time.process_time() - start, reached


def _items() -> list[Row]:
    gait = {"vlo": [_GAIT.vlo.tolist()], "controls": [_GAIT.controls.tolist()]}
    return grid(**gait, steps=[_STEPS] * _BATCHES)


def _loop() -> NDArray[np.float64]:
    return np.array([batch(**item, seed=i) for i, item in enumerate(_items())])


def _sweep(executor: Executor) -> NDArray[np.float64]:
    quiet = SweepOptions(progress=False)
    return sweep(batch, _items(), executor=executor, options=quiet).column()


def take_turns(methods: dict[str, Way]) -> dict[str, list[Turn]]:
    """The turns of every method."""
    turns: dict[str, list[Turn]] = {name: [] for name in methods}
    for _ in range(1 + _TURNS):
        for name, method in methods.items():
            start = time.perf_counter()
            cpu, reached = np.sum(method(), axis=0)
            wall = time.perf_counter() - start
            turns[name].append(Turn(wall, float(cpu), float(reached) / (_BATCHES * _STEPS)))
    # The first starts workers and loads the compiled kernels.
    return {name: taken[1:] for name, taken in turns.items()}


def measure() -> dict[str, Row]:
    """A row for every way to run the items."""
    with ExitStack() as stack:
        one, two = (stack.enter_context(ProcessPoolExecutor(n)) for n in (1, 2))
        cores = {"plain loop": 1, _BASE: 1, "sweep, 2 processes": 2}
        ways: list[Way] = [_loop, partial(_sweep, one), partial(_sweep, two)]
        if distributed is not None:
            cluster = distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
            )
            client = distributed.Client(stack.enter_context(cluster))
            cores["sweep, Dask cluster of 2"] = 2
            ways.append(partial(_sweep, stack.enter_context(client).get_executor()))
        turns = take_turns(dict(zip(cores, ways, strict=True)))
    rows = {name: _summary(turns[name], turns[_BASE], n) for name, n in cores.items()}
    return rows if distributed is not None else rows | {"no Dask: pip install -e '.[dask]'": {}}


def _summary(turns: list[Turn], base: list[Turn], cores: int) -> Row:
    wall, base_wall = np.array([t.wall for t in turns]), np.array([t.wall for t in base])
    low, median, high = np.percentile(wall, [25, 50, 75])
    steps = _BATCHES * _STEPS
    return {
        "steps/s": steps / median,
        "per core": steps / median / cores,
        "per CPU s": steps / np.median([t.cpu for t in turns]),
        "over 1": np.median(base_wall / wall),
        "best turn": base_wall.min() / wall.min(),
        "spread %": 1e2 * (high / low - 1.0),
        "reached": np.mean([t.reached for t in turns]),
    }


def _text(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:,.0f}" if value >= 1e3 else f"{value:.3g}"


def main() -> None:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(description="Time sweeps of passive walking steps.")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    as_json = parser.parse_args().json
    rows = measure()
    about = {"cores": os.cpu_count(), "load": os.getloadavg()[0]}
    if as_json:
        print(json.dumps({**about, "rows": rows}, default=float))
        return
    keys = list(next(iter(rows.values())))
    columns = (Column(key, justify="right") for key in keys)
    table = Table(Column("", no_wrap=True), *columns, title="passive walking, VLO to VLO")
    for name, row in rows.items():
        table.add_row(name, *(_text(row.get(key)) for key in keys))
    console = Console(markup=False, width=100)
    console.print(table)
    console.print(", ".join(f"{key}: {value:.3g}" for key, value in about.items()))


if __name__ == "__main__":
    main()
