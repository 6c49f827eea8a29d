"""Names and calls of version 0.1 that describe a run; each makes an :class:`~.Experiment`."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any, ParamSpec

from template_control.checks.fitting import shown
from template_control.embedding.planners.planner import Planner
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.plant.plant import default_plant
from template_control.robot.biped import Biped
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.run.record import Record
from template_control.run.specs import GaitSpec

P = ParamSpec("P")


def SimulationOptions(
    steps: int | None = None, plant: Any = None, embedding: Any = None, **others: Any
) -> Experiment:
    """An experiment of version 0.1's options, for ``simulate(robot, route, options)``."""
    given = others if plant is None else {"world": plant, **others}
    return Experiment(steps=steps, controller=embedding, **given)


class RunConfig:
    """An experiment of version 0.1's parts."""

    load = Experiment.load

    def __new__(  # type: ignore[misc]
        cls,
        robot: RobotSpec | None = None,
        gait: GaitSpec | None = None,
        planner: Any = None,
        simulation: Experiment | None = None,
        scenario: Any = None,
    ) -> Experiment:
        """See :class:`~.Experiment`."""
        new = {"robot": robot or RobotSpec(), "motion": scenario or gait, "planner": planner}
        return (simulation or Experiment()).with_(new)


def Subject(robot: Any = "five-link", speed: float | None = None, plant: str = "pybullet") -> Any:
    """An experiment of what version 0.1 disturbed, with a kind of engine.

    ``speed`` is of a run, or of a floating-base robot's walk [m/s].
    """
    free = isinstance(robot, RobotSpec) and robot.free
    world = MujocoOptions() if plant == MujocoOptions.kind else PlantOptions()
    name = "walk" if speed is None or free else "run"
    return Experiment(robot, GaitSpec(name, speed), world=world)  # type: ignore[arg-type]


def Situation(robot: Any, gait: Any, planner: Any, plant: Any = None) -> Any:
    """A prepared experiment of version 0.1's situation, whose planner keeps the gait."""
    return Experiment(robot, planner=planner, world=plant or default_plant()).prepare()


def accepts_old_call(simulate: Callable[P, Record]) -> Callable[P, Record]:
    """Let ``simulate`` take the arguments that it had in version 0.1 as well."""

    @wraps(simulate)
    def with_old_call(*args: P.args, **named: P.kwargs) -> Record:
        if "robot" not in named and not (args and isinstance(args[0], Biped)):
            return simulate(*args, **named)
        warnings.warn(
            "simulate(robot, route, options) is deprecated: use simulate(Experiment(robot, ...))",
            DeprecationWarning,
            stacklevel=2,
        )
        return simulate(*_experiment(*args, **named))  # type: ignore[call-arg, arg-type]

    return with_old_call


def _experiment(
    robot: Any,
    route: Any,
    options: Experiment | None = None,
    progress: Any = None,
    planners: Any = None,
    **automaton: Any,
) -> tuple[Experiment, Any]:
    """An experiment and its progress of the arguments of version 0.1."""
    if not isinstance(options, Experiment | None):
        raise ParameterError(f"simulate: options is {shown(options)}: give SimulationOptions")
    kept = isinstance(route, Planner)
    planner, motion = (route, None) if kept else (planners, route)
    new = {"robot": robot, "motion": motion, "planner": planner, **automaton}
    return replace(options or Experiment(), **new), progress
