"""Time of what a free robot's tick, plan and section ask of the sideways motion.

Run: python benchmarks/next_foothold.py

The least of several rounds counts: a busy machine only adds to it.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from template_control.slip import (
    LateralLearnt,
    LateralOptions,
    LateralWish,
    Side,
    SlipParameters,
    gait_at,
    lateral_aim,
    lateral_cycle,
    lateral_gait,
    lateral_path,
    place,
    simulate_stride,
)
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.lateral.placing import LATERAL
from template_control.slip.maps.section import VLO
from template_control.warm_up import ready

_ROUNDS, _CALLS = 20, 200


def microseconds(call: Callable[[], object]) -> float:
    """Of one call [us]."""
    best = np.inf
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        for _ in range(_CALLS):
            call()
        best = min(best, time.perf_counter() - begin)
    return 1e6 * best / _CALLS


def main() -> None:
    """Print the times."""
    ready(LATERAL)
    p, options = SlipParameters(), LateralOptions()
    gait, wish = gait_at(p, np.radians(68.0), 1.05), LateralWish(0.2)
    stride = simulate_stride(p, STRIDE_START["w"], VLO.state(gait.vlo), gait.controls)
    lateral, strides = lateral_gait(gait), (stride, stride)
    cycle, path = lateral_cycle(lateral, wish), lateral_path(strides, p.gravity)
    aim = lateral_aim(lateral, cycle, Side.LEFT, LateralLearnt(), options)
    com, feet = cycle.states[0], np.zeros(2)
    for name, call in {
        "a tick: place, from VLO": lambda: place(path, aim, 0.0, com, feet),
        "a tick: place, at touchdown": lambda: place(path, aim, path.touchdown, com, feet),
        "a plan: lateral_path": lambda: lateral_path(strides, p.gravity),
        "a section: lateral_cycle": lambda: lateral_cycle(lateral, wish),
        "a gait: lateral_gait": lambda: lateral_gait(gait),
    }.items():
        print(f"{name:30s} {microseconds(call):8.1f} us")


if __name__ == "__main__":
    main()
