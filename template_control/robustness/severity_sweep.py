"""Severity sweep: every disturbance raised until a robot's walk or run breaks.

All disturbances are raised together, one level after the other, each level a sweep whose
trials are on disk as they finish. A disturbance is left out from the level on where all trials
fall, or more than half of them twice running; so it goes past the level where none succeeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from template_control import settings
from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.embedding.planners.planner import Context
from template_control.errors import ParameterError, RobotError, SweepError
from template_control.plant.plant import plant_name
from template_control.robot.spec import RobotSpec
from template_control.robustness.disturbances import (
    AFTER,
    ALL,
    BEGIN,
    DISTURBANCES,
    Disturbance,
    engine,
)
from template_control.robustness.findings import Finding, Level, Robustness
from template_control.robustness.fingerprint import fingerprint
from template_control.run.experiment import Experiment, PreparedExperiment
from template_control.run.record import Record
from template_control.run.simulation import simulate
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.gaits.gait import Gait
from template_control.slip.gaits.running_gait import RunningGait
from template_control.slip.maps.return_map import ReturnMap
from template_control.sweep.sweep import Item, SweepOptions, sweep


def template_limit(
    disturbance: Disturbance, where: PreparedExperiment, strides: int, settled: float
) -> float | None:
    """The severest level [SI] up to which the template comes back to its gait from its section.

    It is back if after ``strides`` the relative errors of speed and height are below ``settled``. 0
    if it does not come back from the mildest; None where it has no limit of its own, as to
    friction.
    """
    if disturbance.kick is None:
        return None
    last = 0.0
    for level in disturbance.levels_for(where.gait.parameters):
        kick = disturbance.kick(where, level)[: len(where.gait.state)]
        if not _returns(where, where.gait.state + kick, strides, settled):
            break
        last = level
    return last


def _returns(where: PreparedExperiment, z: Array, strides: int, settled: float) -> bool:
    gait, planner = where.gait, where.kept
    step = ReturnMap(gait.parameters, gait.stride)
    planner.reset()
    for _ in range(strides):
        z, outcome = step.step(z, planner.decide(Context(z)).controls)
        if outcome is not Outcome.SECTION:
            return False
    return bool((abs(z[:2] / gait.state[:2] - 1.0) < settled).all())


SETTLED = 0.02
"""Relative error of speed and height (:func:`gait_errors`) below which a robot is on its gait."""

_LAST = 5  # steps these are averaged over
_QUICK_LEVELS, _QUICK_TRIALS = 2, 2
_BY_NAME = {d.name: d for d in ALL}


def gait_errors(record: Record, gait: Gait) -> tuple[float, float]:
    """Relative errors of a robot's speed and height over its last 5 steps, from its gait's.

    Mean forward speed, of a run dx/dt at its apexes, which is what a run is asked for; and mean
    height at the section. The record has at least 5 steps and no fall.
    """
    at_section, height = record.section_state[-_LAST:].mean(axis=0)[:2] / gait.state[:2]
    if isinstance(gait, RunningGait):
        return float(at_section - 1.0), float(height - 1.0)
    x = np.interp(record.section_time[[-1 - _LAST, -1]], record.time, record.com[:, 0])
    speed = (x[1] - x[0]) / (record.section_time[-1] - record.section_time[-1 - _LAST])
    pace = gait.step_length / gait.step_duration
    return float(speed / pace - 1.0), float(height - 1.0)


@checked
def trial(
    experiment: Experiment | dict[str, Any], disturbance: str, level: float, number: int
) -> dict[str, Any]:
    """One walk or run under one disturbance, as a sweep's worker runs it.

    Args:
        experiment: undisturbed; or its table, as :func:`~.settings.to_table` makes it.
        disturbance: name of the disturbance.
        level: the disturbance's size for this robot [SI].
        number: of the trial, from 0; trials of a level differ by it.

    Returns:
        fell, reason (of the fall), steps, and speed_error and height_error, None after a fall.

    Raises:
        ParameterError: if there is no such disturbance.
    """
    if not isinstance(experiment, Experiment):
        experiment = settings.from_table(Experiment, experiment)
    if disturbance not in _BY_NAME:
        raise ParameterError(f"disturbance is {disturbance!r}: give one of {', '.join(_BY_NAME)}")
    where = experiment.prepare()
    record = simulate(_BY_NAME[disturbance].experiment(where, level, number))
    errors = (None, None) if record.fell else gait_errors(record, where.gait)
    return {
        "fell": record.fell,
        "reason": record.fall_reason,
        "steps": record.steps,
        "speed_error": errors[0],
        "height_error": errors[1],
    }


@checked
def measure(
    experiment: str | RobotSpec | Experiment,
    names: Sequence[str] | None = None,
    folder: Path | None = None,
    executor: Executor | None = None,
    quick: bool = False,
    progress: bool = True,
) -> Robustness:
    """Raise disturbances until the robot's walk or run breaks.

    Args:
        experiment: what is disturbed: a gait that is kept, in a physics engine; or a robot, which
            keeps its own walk.
        names: of the disturbances; None for all that it can have.
        folder: for the trials' results, from which the same call goes on; None keeps them in
            memory. They are those of this code and this URDF: after a change of either all
            trials are run again.
        executor: where to run the trials; None for one process a core.
        quick: two levels of two trials each, to see that everything works.
        progress: show a bar a level on stderr.

    Raises:
        ParameterError: if there is no such disturbance, or a planar robot cannot have it.
        RobotError: if there is no such robot or it falls without a disturbance.
        GaitError: if no run has this speed.
        SweepError: if a trial fails for another reason than a fall, or files do not fit.
    """
    if not isinstance(experiment, Experiment):
        experiment = Experiment(experiment)
    known = {d.name: d for d in (ALL if experiment.free else DISTURBANCES)}
    wanted = set(known if names is None else names)
    if not wanted or not wanted <= set(known):
        raise ParameterError(f"disturbances are {sorted(wanted)}: give some of {list(known)}")
    engine(experiment)
    table = settings.to_table(experiment.resolved())
    where = experiment.prepare()
    gait = where.gait
    undisturbed = _undisturbed(where, experiment.robot_name)
    chosen = [d for name, d in known.items() if name in wanted]
    if quick:
        chosen = [replace(d, levels=d.levels[:_QUICK_LEVELS], trials=_QUICK_TRIALS) for d in chosen]
    levels = {d.name: d.levels_for(gait.parameters) for d in chosen}
    stem = fingerprint(where.robot, [(d.name, d.levels, d.trials) for d in chosen], table)
    found = {
        d.name: Finding(d, template=template_limit(known[d.name], where, AFTER, SETTLED))
        for d in chosen
    }
    for index in range(max(len(of) for of in levels.values())):
        going = {
            d.name: d for d in chosen if index < len(levels[d.name]) and not found[d.name].broken
        }
        items: list[Item] = [
            {"experiment": table, "disturbance": name, "level": levels[name][index], "number": i}
            for name, d in going.items()
            for i in range(d.trials)
        ]
        if not items:
            break
        done = sweep(
            trial,
            items,
            None if folder is None else folder / f"trials-{stem}-{index + 1:02d}.jsonl",
            executor,
            options=SweepOptions(progress, label=f"level {index + 1}", retry_failed=True),
        )
        for i, reason in done.failures.items():
            raise SweepError(f"trial {items[i]} came to no end: {reason}")
        results = iter(done.results)
        for name, d in going.items():
            of_level = [next(results) for _ in range(d.trials)]
            level = _judged(d, levels[name][index], of_level)
            found[name] = replace(found[name], levels=(*found[name].levels, level))
    errors = gait_errors(undisturbed, gait)
    findings = tuple(found[d.name] for d in chosen)
    return Robustness(where.robot.name, gait, *errors, findings, plant_name(where.world))


def _undisturbed(where: PreparedExperiment, robot: str) -> Record:
    record = simulate(replace(where, steps=BEGIN + 1 + AFTER))
    if record.fell:
        raise RobotError(
            f"{robot} falls without a disturbance ({record.fall_reason}):"
            " there is no robustness to measure; make it go first"
        )
    return record


def _judged(disturbance: Disturbance, level: float, results: list[dict[str, Any]]) -> Level:
    """Count the trials of one level; what lasts may take a robot off its gait."""
    fell = sum(r["fell"] for r in results)
    errors = [(r["speed_error"], r["height_error"]) for r in results if not r["fell"]]
    off_gait = disturbance.passing * sum(max(map(abs, pair)) > SETTLED for pair in errors)
    return Level(level, len(results) - fell - off_gait, fell, off_gait)
