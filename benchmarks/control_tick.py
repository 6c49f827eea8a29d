"""Time of a control tick, split into its parts, over a walk in PyBullet.

Run: python benchmarks/control_tick.py [steps]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.robot.library import load_robot
from template_control.robot.start import state_at_vlo
from template_control.slip.gaits.gait import gait_at
from template_control.slip.parameters import SlipParameters

_WARM_UP = 3  # steps, while the compiled kernels load


def _timed(function: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    def call(*arguments: Any) -> Any:
        start = time.perf_counter()
        result = function(*arguments)
        into[-1] += time.perf_counter() - start
        return result

    return call


def measure(steps: int) -> dict[str, np.ndarray[Any, Any]]:
    """Seconds of every tick by part: pinocchio, references, assembly, solve, tick, physics."""
    robot = load_robot("five-link")
    gait = gait_at(SlipParameters(mass=robot.mass), np.radians(66.0), 1.1)
    controller = EmbeddingController(robot, LqrPlanner(gait))
    q, v = state_at_vlo(robot, gait.vlo, 0, np.array([0.0, 0.05]), np.array([2.2, 0.0]))
    controller.start(0)
    update: list[float] = []
    quadratic: list[float] = []
    # Timed from outside, on the instances, so that the library carries no clocks.
    robot.update = _timed(robot.update, update)  # type: ignore[method-assign]
    controller.qp.solve = _timed(controller.qp.solve, quadratic)  # type: ignore[method-assign]
    ticks: list[float] = []
    solves: list[float] = []
    physics: list[float] = []
    forces, dt, warm = np.zeros((2, 2)), 1e-3, 0
    with BulletPlant(robot, PlantOptions(time_step=dt)) as plant:
        plant.reset(q, v)
        while len(controller.reports) <= steps + _WARM_UP:
            if len(controller.reports) <= _WARM_UP:
                warm = len(ticks)
            plant.read(q, v)
            plant.contact_forces(forces)
            update.append(0.0)
            quadratic.append(0.0)
            start = time.perf_counter()
            solution = controller.tick(q, v, forces[:, 1] > 4.0, dt)
            ticks.append(time.perf_counter() - start)
            solves.append(solution.solve_seconds)
            start = time.perf_counter()
            plant.step(solution.torque)
            physics.append(time.perf_counter() - start)
    tick, model, whole, solve = (np.array(x)[warm:] for x in (ticks, update, quadratic, solves))
    return {
        "Pinocchio update": model,
        "references, events, plans": tick - model - whole,
        "QP assembly": whole - solve,
        "QP solve": solve,
        "whole tick": tick,
        "physics step (not in the tick)": np.array(physics)[warm:],
    }


def main() -> None:
    """Print the table."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    parts = measure(steps)
    whole = np.median(parts["whole tick"])
    table = Table(title=f"control tick over {steps} steps, {len(parts['whole tick'])} ticks")
    for name in ("part", "median us", "p99 us", "median over whole tick"):
        table.add_column(name, justify="left" if name == "part" else "right")
    for name, seconds in parts.items():
        median, p99 = np.percentile(seconds, [50, 99])
        table.add_row(name, f"{1e6 * median:.1f}", f"{1e6 * p99:.1f}", f"{median / whole:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
