"""CPU time of planners' decisions, in milliseconds and in walking steps of the template.

Run: python benchmarks/plan.py [--decisions 100] [--json plan.json]

A plan at VLO is that of a walk with push-off near its gait, a plan at apex that of a run. The plan
of several steps is made near one gait, to change the speed at VLO by 0.3 m/s, and after a push that
has changed dx/dt and dy/dt by up to 0.1 m/s. Times are those of the thread: what else the machine
does in between does not count, but a busy cache does.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from template_control.embedding import (
    AheadOptions,
    AheadPlanner,
    Context,
    Decision,
    LqrPlanner,
    RunningPlanner,
)
from template_control.slip import ReturnMap, SlipParameters, running_gait
from template_control.slip.gaits.walking_by_speed import walking_by_speed

Array = NDArray[np.float64]
Decide = Callable[[Context], Decision]

P = SlipParameters()
_STRIDES = 4000  # of the template in a batch
_NEAR, _FAR = (0.02, 0.001, 0.02), (0.1, 0.003, 0.1)  # largest deviations [m/s, m, m/s]
_CHANGE = 0.3  # of the speed [m/s]


def stride_time() -> float:
    """CPU time of a walking step with push-off [s]."""
    gait = walking_by_speed().gait_for(P, 0.9)
    step = ReturnMap(gait.parameters, gait.stride)
    z, u = np.tile(gait.vlo, (_STRIDES, 1)), np.tile(gait.controls, (_STRIDES, 1))
    step(z, u)
    begin = time.thread_time()
    step(z, u)
    return (time.thread_time() - begin) / _STRIDES


def contexts(
    state: Callable[[float], Array], speeds: tuple[float, float], off: Array, change: float
) -> Iterator[Context]:
    """Questions at speeds that are drawn, from states off the gait's."""
    rng = np.random.default_rng(0)
    while True:
        speed = rng.uniform(*speeds)
        z = state(speed)
        sign = 1.0 if rng.random() < 0.5 else -1.0
        target = np.array([z[0] + sign * change, *z[1:]])
        yield Context(z + rng.uniform(-1.0, 1.0, len(z)) * off[: len(z)], target)


def times(decide: Decide, questions: Iterator[Context], count: int) -> Array:
    """CPU time of each decision [s]; the first one, which may make a gait, does not count."""
    decide(next(questions))
    spent = []
    for _ in range(count):
        question = next(questions)
        begin = time.thread_time()
        decide(question)
        spent.append(time.thread_time() - begin)
    return np.array(spent)


def main() -> None:
    """Print a row for each kind of plan."""
    parser = argparse.ArgumentParser(description="CPU time of planners' decisions.")
    parser.add_argument("--decisions", type=int, default=100)
    parser.add_argument("--json", type=Path, help="file for the numbers")
    chosen = parser.parse_args()
    family = walking_by_speed()
    walk, run = family.gait_for(P, 0.9), running_gait(P, 3.0)

    def vlo(speed: float) -> Array:
        return family.gait_for(P, speed).vlo

    near, far = np.array(_NEAR), np.array(_FAR)
    kept = contexts(lambda _: walk.vlo, (0.9, 0.9), near, 0.0)
    at_apex = contexts(lambda _: run.apex, (run.apex[0], run.apex[0]), near, 0.0)
    plans: dict[str, tuple[Decide, Iterator[Context]]] = {
        "at VLO, push-off": (LqrPlanner(walk).decide, kept),
        "at apex": (RunningPlanner(run).decide, at_apex),
    }
    for steps in (2, 3, 4):
        for name, speeds, off, change in (
            ("near a gait", (0.9, 0.9), near, 0.0),
            ("to change the speed", (0.5, 1.2), near, _CHANGE),
            ("pushed", (0.5, 1.2), far, 0.0),
        ):
            planner = AheadPlanner(P, AheadOptions(steps=steps))
            asked = contexts(vlo, speeds, off, change)
            plans[f"{steps} steps ahead, {name}"] = planner.decide, asked
    unit, rows = stride_time(), {}
    print(f"a walking step takes {1e6 * unit:.1f} us")
    for name, (decide, questions) in plans.items():
        median, late = np.percentile(times(decide, questions, chosen.decisions), (50, 99))
        rows[name] = {"median": median / unit, "p99": late / unit, "median_ms": 1e3 * median}
        print(f"{name}: {median / unit:.0f} steps, {late / unit:.0f} at p99, {1e3 * median:.2f} ms")
    if chosen.json is not None:
        chosen.json.write_text(json.dumps({"step_us": 1e6 * unit, "plans": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
