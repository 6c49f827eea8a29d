"""Control ticks over steps of the physics, of planar and floating-base robots.

Run: python benchmarks/control_tick.py [steps] [--gait walk] [--gait run] [--gait free] [--json]

``walk`` and ``run`` at 3 m/s are five-link's in the plane, ``free`` is Bolt's walk with a floating
base, ``go2`` that robot's trot, ``g1`` its walk with arms and waist held, and ``g1-29`` that with
all joints.

All in PyBullet. Ticks and physics steps take turns in one process, and the gaits take turns
every few ticks, so that a machine which is slow for a while is so to all of them: only ratios of
medians are printed. For each gait:

tick_over_step: a whole control tick over the engine's own step for this robot.
tick_over_first: over the tick of the first gait that is asked for, by default ``walk``.
loop_over_step: a simulated millisecond of ``simulate``, with its full record, over that step.
real_time_factor: simulated seconds per second of ``simulate``, plans and record included. Both are
    times of the thread.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Generator

import numpy as np
from rich.console import Console
from rich.table import Table

import template_control as tc
from template_control.embedding.options import FREE_PLANNER
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Planner
from template_control.embedding.planners.running import RunningPlanner
from template_control.plant.bullet import PlantOptions
from template_control.robot.biped import Biped
from template_control.robot.library import load_floating_robot, load_robot
from template_control.robot.template import default_gait, template_for
from template_control.run.experiment import Experiment
from template_control.run.live import LiveRun
from template_control.slip.gaits.gait import gait_at
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.parameters import SlipParameters

_WARM_UP = 3  # steps, while the compiled kernels load
_TURN = 20  # ticks
_RUN = 20  # steps of the run whose loop is timed
_DT = 1e-3  # [s]


def _walk_planner(robot: Biped) -> Planner:
    return LqrPlanner(default_gait(robot))


def _run_planner(robot: Biped) -> Planner:
    return RunningPlanner(running_gait(SlipParameters(mass=robot.mass), 3.0))


def _free_planner(robot: Biped) -> Planner:
    return LqrPlanner(gait_at(template_for(robot), np.radians(68.0), 0.6), FREE_PLANNER)


def _usual_planner(robot: Biped) -> None:
    """That which a run of the robot has by itself."""


GAITS: dict[str, tuple[Callable[[], Biped], Callable[[Biped], Planner | None]]] = {
    "walk": (lambda: load_robot("five-link"), _walk_planner),
    "run": (lambda: load_robot("five-link"), _run_planner),
    "free": (lambda: load_floating_robot("bolt"), _free_planner),
    "go2": (lambda: load_floating_robot("go2"), _usual_planner),
    "g1": (lambda: load_floating_robot("g1"), _usual_planner),
    "g1-29": (lambda: load_floating_robot("g1", upper_body=True), _usual_planner),
}


def start(gait: str) -> LiveRun:
    """A run at its start, in which nobody has asked for a tick."""
    load, planner = GAITS[gait]
    robot = load()
    world = PlantOptions(time_step=_DT)
    return LiveRun(Experiment(robot=robot, planner=planner(robot), world=world))


def ticks_of(run: LiveRun, ticks: list[float], steps: list[float]) -> Generator[int, None, None]:
    """Tick by tick, without an end; yields how many strides are over, less those of the warm-up."""
    controller, plant, clock = run.controller, run.plant, time.perf_counter
    robot = controller.robot
    q, v = np.zeros(robot.model.nq), np.zeros(robot.nv)
    forces = np.zeros((len(robot.feet), robot.contact_rows))
    touching = 5e-3 * robot.mass * robot.gravity
    with run:
        while True:
            plant.read(q, v)
            plant.contact_forces(forces)
            felt = np.ascontiguousarray(forces[:, : robot.directions])
            touch = felt[:, -1] > touching
            begin = clock()
            solution = controller.tick(q, v, touch, _DT, felt)
            between = clock()
            plant.step(solution.torque)
            end = clock()
            done = len(controller.supervisor.log) + 1 - _WARM_UP
            if done > 0:
                ticks.append(between - begin)
                steps.append(end - between)
            yield done


def _loop(gait: str, robot: Biped) -> float:
    """Seconds that a tick of ``simulate`` takes this thread, whatever else the machine does."""
    planner = GAITS[gait][1](robot)
    motion = None if planner is None else planner.gait
    experiment = Experiment(robot=robot, motion=motion, planner=planner, steps=_RUN)
    begin = time.thread_time()
    record = tc.simulate(experiment)
    assert not record.fell, record.fall_reason
    return (time.thread_time() - begin) / (float(record.time[-1]) / _DT)


def measure(count: int, gaits: list[str]) -> dict[str, dict[str, float]]:
    """Ratios of each gait.

    Args:
        count: strides of the first gait; the others make about as many ticks.
        gaits: that take turns.
    """
    runs = {gait: start(gait) for gait in gaits}
    times: dict[str, tuple[list[float], list[float]]] = {gait: ([], []) for gait in gaits}
    under_way = [ticks_of(runs[gait], *times[gait]) for gait in gaits]
    done = 0
    while done <= count:
        for ticks in reversed(under_way):
            for _ in range(_TURN):
                done = next(ticks)
    for ticks in under_way:
        ticks.close()
    found = {}
    for gait, (tick, step) in times.items():
        step_time = float(np.median(step))
        loop = min(_loop(gait, runs[gait].controller.robot) for _ in range(2))
        found[gait] = {
            "tick_over_step": float(np.median(tick)) / step_time,
            "tick_over_first": float(np.median(tick)) / float(np.median(times[gaits[0]][0])),
            "mean_tick_over_step": float(np.mean(tick)) / step_time,
            "loop_over_step": loop / step_time,
            "real_time_factor": _DT / loop,
            "tick_microseconds": 1e6 * float(np.median(tick)),
            "step_microseconds": 1e6 * step_time,
        }
    return found


def main() -> None:
    """Print the ratios of each gait."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("steps", nargs="?", type=int, default=40)
    parser.add_argument("--gait", action="append", choices=GAITS, help="all if none")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    found = measure(options.steps, options.gait or list(GAITS))
    if options.json:
        print(json.dumps(found, indent=1))
        return
    table = Table(title="control ticks in units of the physics step")
    table.add_column("gait")
    for name in next(iter(found.values())):
        table.add_column(name, justify="right")
    for gait, numbers in found.items():
        table.add_row(gait, *(f"{number:.3g}" for number in numbers.values()))
    Console().print(table)


if __name__ == "__main__":
    main()
