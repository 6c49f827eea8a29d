"""Time of a control tick, split into its parts, over a walk, a run or a walk in space, in PyBullet.

Run: python benchmarks/control_tick.py [steps] [--gait walk] [--gait run] [--gait free] [--whole]

Times are those of the thread: whatever else the machine does in between does not count. The gaits
take turns every few ticks, so that a machine which is slow for a while is so to all of them. A last
table compares their ticks. A clock costs time as well: with --whole there is none within a tick.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Generator, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from template_control.embedding.apex_pose import ApexStart, apex_pose
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.planners.lqr import LqrPlanner
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

GAITS = ("walk", "run", "free")
_WARM_UP = 3  # steps, while the compiled kernels load
_TURN = 20  # ticks
_TICK, _PHYSICS = "whole tick", "physics step (not in the tick)"

Times = dict[str, np.ndarray[Any, Any]]


def _plant(robot: Biped, options: PlantOptions) -> BulletPlant | FloatingBaseBulletPlant:
    if isinstance(robot, FloatingBaseBiped):
        return FloatingBaseBulletPlant(robot, options)
    assert isinstance(robot, PlanarBiped)
    return BulletPlant(robot, options)


def _timed(function: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    def call(*arguments: Any) -> Any:
        start = time.thread_time()
        result = function(*arguments)
        into[-1] += time.thread_time() - start
        return result

    return call


def _walking(robot: PlanarBiped) -> tuple[EmbeddingController, Any, Any]:
    """A controller that walks, started, and the state that it starts from."""
    gait = default_gait(robot)
    controller = EmbeddingController(robot, LqrPlanner(gait))
    q, v = state_at_vlo(robot, gait.vlo, 0, np.array([0.0, 0.05]), np.array([2.2, 0.0]))
    controller.start(0)
    return controller, q, v


def _running(robot: PlanarBiped, speed: float) -> tuple[EmbeddingController, Any, Any]:
    """As :func:`_walking`, at ``speed`` [m/s]."""
    gait = running_gait(SlipParameters(mass=robot.mass), speed)
    controller = EmbeddingController(robot, RunningPlanner(gait))
    controller.supervisor.begin(APEX)
    swing, automaton = controller.swings.other, controller.supervisor.automaton
    start = ApexStart(gait.apex, gait, swing, controller.first_pitch(), automaton)
    pose = apex_pose(robot, start)
    q, v = state_in(robot, pose)
    controller.start(pose.rear, pose.swung)
    return controller, q, v


def _free() -> tuple[EmbeddingController, Any, Any]:
    """As :func:`_walking`, of Bolt in space."""
    kind = FloatingBackend(load_floating_robot("bolt"))
    gait = gait_at(template_for(kind.robot), np.radians(68.0), 0.6)
    route = SteadyRoute.of(gait)
    controller = kind.controller(LqrPlanner(gait), FreeOptions(), route, AUTOMATON)
    q, v = kind.start(controller, Experiment())
    return controller, q, v


class Parts(NamedTuple):
    """Seconds of each part of a tick, a number a tick."""

    update: list[float]
    quadratic: list[float]
    solves: list[float]
    plans: list[float]
    ticks: list[float]
    physics: list[float]

    def times(self) -> Times:
        """The table's rows."""
        model, whole, solve, plan, tick, physics = (np.array(x) for x in self)
        return {
            "Pinocchio update": model,
            "references, events": tick - model - whole - plan,
            "plans": plan,
            "QP assembly": whole - solve,
            f"ProxQP, in {(solve > 0.0).mean():.1%} of the ticks": solve[solve > 0.0],
            _TICK: tick,
            _PHYSICS: physics,
        }


def _time_parts(controller: EmbeddingController, parts: Parts) -> None:
    """Put clocks into a controller, from outside: the library carries none."""
    robot, supervisor = controller.robot, controller.supervisor
    robot.update = _timed(robot.update, parts.update)  # type: ignore[method-assign]
    controller.qp.solve = _timed(controller.qp.solve, parts.quadratic)  # type: ignore[method-assign]
    for name in ("decide", "replan"):
        setattr(supervisor, name, _whole(getattr(supervisor, name), parts.plans))
    for workspace in (*controller.qp._workspaces, *controller.qp._braked):
        workspace.solve = _timed(workspace.solve, parts.solves)  # type: ignore[method-assign]


def _ticks(gait: str, speed: float, split: bool, parts: Parts) -> Generator[int, None, None]:
    """Tick by tick, without an end; yields how many steps are over, less those of the warm-up.

    Args:
        gait: walk, run, or free: a walk in space.
        speed: of a run [m/s].
        split: time the parts of a tick too.
        parts: to which the times are added, once it is warm.
    """
    if gait == "free":
        controller, q, v = _free()
    else:
        planar = load_robot("five-link")
        controller, q, v = _walking(planar) if gait == "walk" else _running(planar, speed)
    robot = controller.robot
    if split:
        _time_parts(controller, parts)
    forces, dt, done = np.zeros((2, robot.directions)), 1e-3, 0
    touching = 5e-3 * robot.mass * robot.gravity
    with _plant(robot, PlantOptions(time_step=dt)) as plant:
        plant.reset(q, v)
        while True:
            plant.read(q, v)
            plant.contact_forces(forces)
            for part in parts:
                if done <= 0:
                    part.clear()
                part.append(0.0)
            start = time.thread_time()
            solution = controller.tick(q, v, forces[:, -1] > touching, dt, forces)
            parts.ticks[-1] = time.thread_time() - start
            start = time.thread_time()
            plant.step(solution.torque)
            parts.physics[-1] = time.thread_time() - start
            done = len(controller.reports) - _WARM_UP
            yield done


def measure(steps: int, gaits: Sequence[str], speed: float, split: bool) -> dict[str, Times]:
    """Seconds of every tick by part, of each gait.

    Args:
        steps: of the first gait; the others make about as many ticks.
        gaits: that take turns.
        speed: of a run [m/s].
        split: time the parts of a tick too.
    """
    parts = {gait: Parts([], [], [], [], [], []) for gait in gaits}
    under_way = [_ticks(gait, speed, split, parts[gait]) for gait in gaits]
    done = 0
    while done <= steps:
        for ticks in reversed(under_way):
            for _ in range(_TURN):
                done = next(ticks)
    for ticks in under_way:
        ticks.close()
    return {gait: times.times() for gait, times in parts.items()}


def _whole(function: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    """As :func:`_timed`, for functions that call each other: the outermost counts."""
    inside = False
    timed = _timed(function, into)

    def call(*arguments: Any) -> Any:
        nonlocal inside
        if inside:
            return function(*arguments)
        inside = True
        try:
            return timed(*arguments)
        finally:
            inside = False

    return call


def _print(title: str, parts: Times) -> None:
    whole = np.median(parts[_TICK])
    table = Table(title=f"{title}, {len(parts['whole tick'])} ticks")
    for name in ("part", "mean us", "median us", "p99 us", "median over whole tick"):
        table.add_column(name, justify="left" if name == "part" else "right")
    for name, seconds in parts.items():
        median, p99 = np.percentile(seconds, [50, 99])
        mean = f"{1e6 * seconds.mean():.1f}"
        table.add_row(
            name, mean, f"{1e6 * median:.1f}", f"{1e6 * p99:.1f}", f"{median / whole:.2f}"
        )
    Console().print(table)


def _compare(gaits: dict[str, Times]) -> None:
    """Ticks in units of the physics step, and of the first gait's tick."""
    table = Table(title="ticks compared")
    table.add_column("gait")
    for name in ("mean over physics step", "mean over the first", "median over the first"):
        table.add_column(name, justify="right")
    physics = np.concatenate([parts[_PHYSICS] for parts in gaits.values()]).mean()
    ticks = {gait: parts[_TICK] for gait, parts in gaits.items()}
    first = next(iter(ticks.values()))
    for gait, tick in ticks.items():
        means = tick.mean() / physics, tick.mean() / first.mean()
        ratios = *means, np.median(tick) / np.median(first)
        table.add_row(gait, *(f"{ratio:.3f}" for ratio in ratios))
    Console().print(table)


def main() -> None:
    """Print a table for each gait, and one of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("steps", nargs="?", type=int, default=200)
    parser.add_argument("--gait", action="append", choices=GAITS, help="walk, run if none")
    parser.add_argument("--speed", type=float, default=3.0, help="of the run [m/s]")
    parser.add_argument("--whole", action="store_true", help="time whole ticks only")
    options = parser.parse_args()
    gaits = measure(options.steps, options.gait or GAITS[:2], options.speed, not options.whole)
    if not options.whole:
        for gait, parts in gaits.items():
            _print(f"control tick, {gait}", parts)
    _compare(gaits)


if __name__ == "__main__":
    main()
