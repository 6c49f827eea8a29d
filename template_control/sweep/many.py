"""Runs of many experiments, each in a worker process that keeps its robots."""

from __future__ import annotations

import pickle
from collections.abc import Iterable
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import replace
from functools import lru_cache

from template_control import settings
from template_control.checks.checked import checked
from template_control.robot.biped import Biped
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import COMPILED, Experiment
from template_control.run.record import Record
from template_control.run.simulation import simulate
from template_control.sweep.executor import workers
from template_control.warm_up import ready

_ROBOTS = 8  # that a worker keeps


@checked
def simulate_many(
    experiments: Iterable[Experiment], executor: Executor | None = None
) -> list[Record]:
    """Run experiments side by side, each as ``simulate`` does, and record them.

    A worker loads a robot once, for all experiments with it, and what is compiled is so before the
    first of them. The world is new in each run: an engine keeps the contacts of the last one, and
    a run would depend on which came before it.

    Args:
        experiments: as a file could hold them: a worker process makes its own robots, planners and
            worlds.
        executor: where to run; None for one process a core, for the time of the call.

    Returns:
        The records, in the order of the experiments. With ``record_every`` they are smaller.

    Raises:
        ParameterError: if something in an experiment can be given in Python only.
        TemplateControlError: as ``simulate`` raises it, of the first experiment that cannot be run.
    """
    rows = list(experiments)
    for experiment in rows:
        settings.to_table(experiment)  # refuses what only this process has
    ready(COMPILED)
    with workers() if executor is None else nullcontext(executor) as pool:
        return list(pool.map(run_experiment, rows))


def run_experiment(experiment: Experiment) -> Record:
    """Run an experiment with the robot that this process has loaded before, if it has."""
    if isinstance(experiment.robot, RobotSpec):
        experiment = replace(experiment, robot=_robot(pickle.dumps(experiment.robot)))
    return simulate(experiment)


@lru_cache(maxsize=_ROBOTS)
def _robot(packed: bytes) -> Biped:
    """The robot of a pickled :class:`~template_control.robot.RobotSpec`, which has no hash."""
    spec: RobotSpec = pickle.loads(packed)
    return spec.load()
