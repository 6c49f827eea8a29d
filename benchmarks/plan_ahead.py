"""Time of a planner's decision, in milliseconds and in template steps, near a gait and off it.

Run: python benchmarks/plan_ahead.py [--decisions 100]

The speed changes by 0.3 m/s where it says so; a push has changed dx/dt by 0.1 m/s, and dy/dt by as
much. Times are those of the thread: whatever else the machine does in between does not count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from template_control.embedding.ahead.options import AheadOptions
from template_control.embedding.ahead.planner import AheadPlanner
from template_control.embedding.planners.planner import Planner
from template_control.embedding.planners.walking.lqr import LqrPlanner
from template_control.slip.gaits.walking_by_speed import walking_by_speed
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_P = SlipParameters()
_SPEED = 1.0  # mean speed of the gait [m/s]
_STEPS = 2000
_SMALL, _PUSH = np.array([0.01, 0.001, 0.01]), np.array([0.1, 0.0, 0.1])
_CHANGE = np.array([0.3, 0.0, 0.0])


def _seconds(call: Callable[[], object]) -> float:
    start = time.thread_time()
    call()
    return time.thread_time() - start


def _decisions(planner: Planner, spread: Array, change: Array, count: int) -> Array:
    """Times of decisions about a gait, in which ``spread`` is drawn and ``change`` is wanted."""
    gait = walking_by_speed().gait_for(_P, _SPEED)
    rng = np.random.default_rng(0)
    states = gait.vlo + spread * rng.choice((-1.0, 1.0), (count, 3)) * rng.uniform(
        0.5, 1, (count, 3)
    )
    target = gait.vlo + change
    planner.decide(states[0], target)
    return np.array([_seconds(partial(planner.decide, z, target)) for z in states])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Time of a planner's decision.")
    parser.add_argument("--decisions", type=int, default=100)
    count = parser.parse_args().decisions
    gait = walking_by_speed().gait_for(_P, _SPEED)
    step = ReturnMap(_P, "wp")

    def steps() -> None:
        for _ in range(_STEPS):
            step.evaluate(gait.vlo, gait.controls)

    steps()
    unit = min(_seconds(steps) for _ in range(5)) / _STEPS
    table = Table(title=f"A template step takes {1e6 * unit:.1f} us")
    for name in ("planner", "state", "median ms", "p99 ms", "median steps", "p99 steps"):
        table.add_column(name, justify="left" if name in ("planner", "state") else "right")
    planners: dict[str, Planner] = {
        "lqr": LqrPlanner(gait),
        **{f"ahead, {n} steps": AheadPlanner(_P, AheadOptions(steps=n)) for n in (2, 3, 4)},
    }
    none = np.zeros(3)
    for name, planner in planners.items():
        for state, spread, change in (
            ("near the gait", _SMALL, none),
            ("speed is to change", _SMALL, _CHANGE),
            ("pushed", _PUSH, none),
        ):
            if name == "lqr" and change.any():
                continue  # it would make another gait
            seconds = _decisions(planner, spread, change, count)
            median, late = np.percentile(seconds, [50, 99])
            cells = (1e3 * median, 1e3 * late, median / unit, late / unit)
            table.add_row(name, state, *(f"{x:.2f}" if x < 10 else f"{x:.0f}" for x in cells))
    Console().print(table)


if __name__ == "__main__":
    main()
