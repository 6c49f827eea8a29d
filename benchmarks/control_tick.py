"""Control ticks over steps of the physics, for a walk, a run and a walk on a floating base.

Run: python benchmarks/control_tick.py [steps] [--gait walk] [--gait run] [--gait free] [--json]

All gaits in PyBullet. Ticks and physics steps take turns in one process, and the gaits take turns
every few ticks, so that a machine which is slow for a while is so to all of them: only ratios of
medians are told. For each gait:

tick_over_step: a whole control tick over the engine's own step.
loop_over_step: a simulated millisecond of ``simulate``, with its full record, over that step.
real_time_factor: simulated seconds per second of ``simulate``, plans and record included. Both are
    times of the thread.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Generator
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

import template_control as tc
from template_control.embedding.apex_pose import ApexStart, apex_pose
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.options import FREE_PLANNER, FreeOptions
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Planner
from template_control.embedding.planners.running import RunningPlanner
from template_control.embedding.robot_template import default_gait, template_for
from template_control.plant.bullet import BulletPlant, FloatingBaseBulletPlant, PlantOptions
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import load_floating_robot, load_robot
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import state_at_vlo, state_in
from template_control.run.backends import FloatingBackend
from template_control.run.experiment import Experiment
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.gaits.gait import gait_at
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.maps.section import APEX
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute

_WARM_UP = 3  # steps, while the compiled kernels load
_TURN = 20  # ticks
_RUN = 20  # steps of the run whose loop is timed
_DT = 1e-3  # [s]


class Start(NamedTuple):
    """A controller that has been started, and the state that it starts from."""

    controller: EmbeddingController
    q: Any
    v: Any


def _walk_planner(robot: Biped) -> LqrPlanner:
    return LqrPlanner(default_gait(robot))


def _run_planner(robot: Biped) -> Planner:
    return RunningPlanner(running_gait(SlipParameters(mass=robot.mass), 3.0))


def _free_planner(robot: Biped) -> Planner:
    return LqrPlanner(gait_at(template_for(robot), np.radians(68.0), 0.6), FREE_PLANNER)


def _walk() -> Start:
    robot = load_robot("five-link")
    planner = _walk_planner(robot)
    controller = EmbeddingController(robot, planner)
    swing = np.array([0.0, 0.05]), np.array([2.2, 0.0])
    q, v = state_at_vlo(robot, default_gait(robot).vlo, 0, *swing)
    controller.start(0)
    return Start(controller, q, v)


def _run() -> Start:
    robot = load_robot("five-link")
    planner = _run_planner(robot)
    controller = EmbeddingController(robot, planner)
    controller.supervisor.begin(APEX)
    swing, pitch = controller.swings.other, controller.first_pitch()
    pose = apex_pose(robot, ApexStart(planner.gait.state, planner.gait, swing, pitch, AUTOMATON))
    q, v = state_in(robot, pose)
    controller.start(pose.rear, pose.swung)
    return Start(controller, q, v)


def _free() -> Start:
    backend = FloatingBackend(load_floating_robot("bolt"))
    planner = _free_planner(backend.robot)
    route = SteadyRoute.of(planner.gait)
    controller = backend.controller(planner, FreeOptions(), route, AUTOMATON)
    return Start(controller, *backend.start(controller, Experiment(backend.robot).prepare()))


GAITS: dict[str, tuple[Callable[[], Start], Callable[[Biped], Planner]]] = {
    "walk": (_walk, _walk_planner),
    "run": (_run, _run_planner),
    "free": (_free, _free_planner),
}


def _plant(robot: Biped) -> BulletPlant | FloatingBaseBulletPlant:
    options = PlantOptions(time_step=_DT)
    if isinstance(robot, FloatingBaseBiped):
        return FloatingBaseBulletPlant(robot, options)
    assert isinstance(robot, PlanarBiped)
    return BulletPlant(robot, options)


def ticks_of(start: Start, ticks: list[float], steps: list[float]) -> Generator[int, None, None]:
    """Tick by tick, without an end; yields how many strides are over, less those of the warm-up."""
    controller, q, v = start
    robot, clock = controller.robot, time.perf_counter
    forces = np.zeros((2, robot.directions))
    touching = 5e-3 * robot.mass * robot.gravity
    with _plant(robot) as plant:
        plant.reset(q, v)
        while True:
            plant.read(q, v)
            plant.contact_forces(forces)
            touch = forces[:, -1] > touching
            begin = clock()
            solution = controller.tick(q, v, touch, _DT, forces)
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
    experiment = Experiment(robot=robot, motion=planner.gait, planner=planner, steps=_RUN)
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
    starts = {gait: GAITS[gait][0]() for gait in gaits}
    times: dict[str, tuple[list[float], list[float]]] = {gait: ([], []) for gait in gaits}
    under_way = [ticks_of(starts[gait], *times[gait]) for gait in gaits]
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
        loop = min(_loop(gait, starts[gait].controller.robot) for _ in range(2))
        found[gait] = {
            "tick_over_step": float(np.median(tick)) / step_time,
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
