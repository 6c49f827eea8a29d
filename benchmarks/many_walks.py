"""Walks side by side: `simulate_many` on one process and on two.

Run: python benchmarks/many_walks.py [WALKS] [--json]

Each walk has 20 steps, a push of its own and a record of every 20th tick. Both ways take turns, so
that a busy machine slows both alike; each has its workers loaded before.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import Executor
from statistics import median

import numpy as np

from template_control.run.experiment import Experiment
from template_control.run.options import Push
from template_control.sweep.executor import workers
from template_control.sweep.many import simulate_many

_TURNS, _STEPS, _THIN = 4, 20, 20


def walks(number: int) -> list[Experiment]:
    """Walks of the five-link robot, each with a push that is drawn."""
    impulses = np.random.default_rng(0).uniform(-15.0, 15.0, number)
    return [
        Experiment(steps=_STEPS, pushes=(Push(float(x), step=3),), record_every=_THIN)
        for x in impulses
    ]


def seconds(rows: list[Experiment], pool: Executor) -> float:
    """Time that the walks take [s]."""
    begin = time.perf_counter()
    fallen = sum(record.fell for record in simulate_many(rows, pool))
    if fallen:
        raise SystemExit(f"{fallen} of {len(rows)} walks fell")
    return time.perf_counter() - begin


def main() -> None:
    """Measure, and print or dump the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("walks", nargs="?", type=int, default=200)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = walks(max(options.walks // _TURNS, 2))
    taken: dict[int, list[float]] = {1: [], 2: []}
    with workers(1) as one, workers(2) as two:
        for pool in (one, two, two):
            simulate_many(rows[:2], pool)
        for _ in range(_TURNS):
            for number, pool in ((1, one), (2, two)):
                taken[number].append(seconds(rows, pool))
    ratio = median(a / b for a, b in zip(taken[1], taken[2], strict=True))
    each = {n: median(found) / len(rows) for n, found in taken.items()}
    if options.json:
        print(json.dumps({"seconds_a_walk": each, "two_over_one": ratio}))
    else:
        print(f"{len(rows) * _TURNS} walks of {_STEPS} steps, seconds a walk:")
        print("\n".join(f"  {n} process{'es' * (n > 1)}: {s:.3f}" for n, s in each.items()))
        print(f"two processes make {ratio:.2f} times as many (median of {_TURNS} turns)")


if __name__ == "__main__":
    main()
