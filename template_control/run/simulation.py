"""Simulation of a robot from a run's start to its end."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress

from template_control.checks.checked import checked
from template_control.run.experiment import STEPS, Experiment
from template_control.run.live import LiveRun
from template_control.run.options import check_pushes
from template_control.run.record import Record, RunInterrupted, keep, one_line

_LOG = logging.getLogger(__name__)


@checked
def simulate(experiment: Experiment, progress: Callable[[int], None] | None = None) -> Record:
    """Run an experiment and record it; a fall ends the run and raises nothing.

    Ctrl-C ends the run, and the loop it stands in; so does an error of the route, of a planner or
    of a task. What was recorded until then is the attribute ``record`` of the exception
    (:func:`~.record.recorded`).

    Args:
        experiment: robot, motion, planner, controller, world and disturbances.
        progress: called with the number of completed steps after each.

    Raises:
        RobotError: if there is no such robot, or its legs do not reach the start.
        ParameterError: if there is no planner for a stride of the route, or no pose to start in; if
            the template of the motion is another robot's; if another run uses the robot, the route
            or a planner at this moment; if one of these answers with what makes no stride.
        ScenarioError: if the scenario asks for what the robot cannot do.
        RunInterrupted: at Ctrl-C, with the record until then; a plain KeyboardInterrupt before
            the first sample.
    """
    with LiveRun(experiment, STEPS) as run:
        if run.endless:
            check_pushes(experiment.pushes, STEPS)
        try:
            run.finish(progress)
            return _ended(run)
        except KeyboardInterrupt as stop:
            if not run.recorder.ticks:
                raise
            raise RunInterrupted(_ended(run, stop)) from stop
        except Exception as error:
            if run.recorder.ticks:
                with suppress(Exception):  # what failed may be asked once more for the record
                    keep(error, _ended(run, error))
            raise


def _ended(run: LiveRun, stop: BaseException | None = None) -> Record:
    """Record of a run that has ended, by itself or by an exception."""
    name = run.controller.robot.name
    if run.reason and stop is None:
        _LOG.warning("%s fell: %s", name, run.reason)
    interrupted = isinstance(stop, KeyboardInterrupt)
    error = "" if stop is None or interrupted else one_line(stop)
    record = run.record(interrupted=interrupted, error=error)
    _LOG.info("%r in %.2f s of wall-clock time", record, record.wall_seconds)
    return record
