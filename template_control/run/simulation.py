"""Simulation of a robot: plant, controller and recorder in one loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from math import copysign, cos, degrees, hypot, sin
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.walk_kernels import WALK
from template_control.embedding.robot_template import template_for
from template_control.embedding.state import SectionReport
from template_control.errors import DivergedError, ParameterError
from template_control.estimation.delay import DELAY
from template_control.plant.plant import Plant, plant_name
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.run.backends import FloatingBackend, PlanarBackend, RobotBackend
from template_control.run.experiment import STEPS, Experiment, PreparedExperiment
from template_control.run.metadata import conditions
from template_control.run.old import accepts_old_call
from template_control.run.options import Push, check_pushes
from template_control.run.record import Record, RunInterrupted, keep, one_line
from template_control.run.recorder import RECORD, Recorder
from template_control.run.sensing import ContactSensors, Senses, TorqueDelay
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.warm_up import ready

Array = NDArray[np.float64]

_LOCK = Lock()
_TAKEN: set[int] = set()


@contextmanager
def exclusive(*parts: Any) -> Iterator[None]:
    """Keep a run's parts (robot, route, planners) from other runs: each keeps one run's state.

    A ParameterError if another run, maybe of another thread, uses one of them.
    """
    keys = {id(part) for part in parts}
    with _LOCK:
        for part in parts:
            if id(part) in _TAKEN:
                raise ParameterError(
                    f"this {type(part).__name__} is in use by another run: give each run that"
                    " goes on at the same time its own"
                )
        _TAKEN.update(keys)
    try:
        yield
    finally:
        with _LOCK:
            _TAKEN.difference_update(keys)


_LOG = logging.getLogger(__name__)
QP_FAILURES = logging.getLogger(f"{__name__}.failures")
"""Logger of the warning that the QP has no solution in many ticks."""

COMPILED = (*WALK, *RECORD, *DELAY)
"""Compiled functions of a walk and its record."""

_OTHER_TEMPLATE = 0.05
"""Share by which a template may differ from the robot's own: a choice of l0, not another robot."""
_FAILURES_BLOCK = 200  # ticks
_MANY_FAILURES = 0.5  # share of a block: in a stumble the QP fails for a few ticks


@accepts_old_call
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
    ready(COMPILED)
    o = experiment.prepare()
    robot, backend = o.robot, _backend(o.robot)
    controller = _controller(backend, o)
    last = _last_step(controller, o)
    supervisor = controller.supervisor
    parts = (o.motion, supervisor.route, *supervisor.planners.values(), *o.planners.values())
    with exclusive(robot, *parts):
        _check_template(robot, controller.parameters)
        q, v = backend.start(controller, o)
        senses = backend.senses(controller, o)
        _LOG.info("%s in %s: %r", robot.name, plant_name(o.world), controller.planner)
        recorder = Recorder(controller, o.record_every, conditions(o))

        def ended(reason: str = "", stop: BaseException | None = None) -> Record:
            if reason:
                _LOG.warning("%s fell: %s", robot.name, reason)
            interrupted = isinstance(stop, KeyboardInterrupt)
            error = "" if stop is None or interrupted else one_line(stop)
            record = recorder.record(reason, interrupted=interrupted, error=error)
            _LOG.info("%r in %.2f s of wall-clock time", record, record.wall_seconds)
            return record

        with backend.plant(o.world) as plant:
            plant.reset(q, v)
            try:
                return ended(
                    _loop(
                        plant,
                        backend,
                        senses,
                        controller,
                        recorder,
                        o,
                        last=last,
                        progress=progress,
                    )
                )
            except KeyboardInterrupt as stop:
                if not recorder.ticks:
                    raise
                raise RunInterrupted(ended(stop=stop)) from stop
            except Exception as error:
                if recorder.ticks:
                    with suppress(Exception):  # what failed may be asked once more for the record
                        keep(error, ended(stop=error))
                raise


def _check_template(robot: Biped, given: SlipParameters) -> None:
    """Check that a route's template is one of this robot; a ParameterError names both if not.

    Mass, gravity and rest length are compared.
    """
    own = template_for(robot)
    for name in ("mass", "gravity", "rest_length"):
        if abs(getattr(given, name) / getattr(own, name) - 1.0) > _OTHER_TEMPLATE:
            raise ParameterError(
                f"the gait or route is for a template of {_told(given)}, and that of {robot.name}"
                f" has {_told(own)}: give one for template_for(robot)"
            )


def _told(p: SlipParameters) -> str:
    return f"{p.mass:.4g} kg, l0 = {p.rest_length:.4g} m and g = {p.gravity:.4g} m/s^2"


def _backend(robot: Biped) -> RobotBackend:
    """Parts of a run that depend on the robot's base; a ParameterError if it is of neither kind."""
    if isinstance(robot, PlanarBiped):
        return PlanarBackend(robot)
    if isinstance(robot, FloatingBaseBiped):
        return FloatingBackend(robot)
    raise ParameterError(f"{robot!r} is of no kind that can be run: give a planar or a free biped")


def _controller(backend: RobotBackend, o: PreparedExperiment) -> EmbeddingController:
    """Follows a route or keeps a planner's gait."""
    options, automaton, planner, motion = o.tuning, o.automaton, o.planner, o.motion
    if isinstance(planner, Mapping):
        assert isinstance(motion, Route)
        return backend.controller(planner, options, motion, automaton)
    steady = SteadyRoute.of(planner.gait, automaton)
    if options.catches and automaton is AUTOMATON and steady.section is VLO:
        return backend.controller(default_planners(steady, planner), options, steady, automaton)
    return backend.controller(planner, options, steady, automaton)


def _last_step(controller: EmbeddingController, o: PreparedExperiment) -> float:
    """Number of steps that the run has at most; a ParameterError if a push comes after the last."""
    if o.steps is not None:
        return o.steps  # the options have looked at the pushes
    if not controller.supervisor.route.endless:
        return np.inf
    check_pushes(o.pushes, STEPS)
    return STEPS


def _loop(
    plant: Plant,
    backend: RobotBackend,
    senses: Senses,
    controller: EmbeddingController,
    recorder: Recorder,
    o: PreparedExperiment,
    *,
    last: float,
    progress: Callable[[int], None] | None,
) -> str:
    """Run until the ``last`` step is done ("") or the robot falls (why)."""
    robot, supervisor = controller.robot, controller.supervisor
    dt = o.world.time_step
    delay = TorqueDelay(o.delay_ticks)
    q, v = robot.neutral(), np.zeros(robot.nv)
    forces = np.zeros((len(robot.feet), robot.directions))
    contacts = ContactSensors(o.sensors, o.falls.contact_force * robot.mass * robot.gravity)
    thrown = o.falls.thrown * controller.parameters.speed_unit
    done, tick, failures = 0, 0, QpFailures(robot.name)
    begun: list[tuple[float, float]] = []
    while done < last and not supervisor.arrived:
        now = tick * dt
        plant.read(q, v)
        plant.contact_forces(forces)
        start = time.perf_counter()
        try:
            touching, felt = contacts.measure(forces)
            sensed = senses.measure(q, v, touching)
            speed = hypot(*sensed[1][: robot.directions].tolist())
            if speed > thrown and recorder.ticks:
                return f"the simulation diverged at {now:.3f} s: the base moves at {speed:.3g} m/s"
            solution = controller.tick(*sensed, touching, dt, felt)
        except DivergedError as error:
            return f"the simulation diverged at {now:.3f} s: {error}"
        seconds = time.perf_counter() - start
        failures.tick(solution.solved, now)
        senses.expect(solution.acceleration)
        if len(begun) <= len(supervisor.log):
            # A step that changes into another stride keeps its pushes where they were.
            begun.append((supervisor.begun_at, controller.planner.gait.step_duration))
        along, lateral = _push(o.pushes, begun, now) if o.pushes else (0.0, 0.0)
        size = copysign(hypot(along, lateral), along)
        recorder.tick(q, v, forces, solution, time=now, push=size, seconds=seconds)
        reason = _fallen(plant, controller, q, o, now)
        if reason:
            return f"{reason} at {now:.3f} s, in step {done + 1}"
        if len(supervisor.log) > done:
            done = len(supervisor.log)
            _log_section(controller.reports[-1], done)
            if progress is not None:
                progress(done)
        try:
            push = backend.force(along, lateral) if o.pushes else ()
            plant.step(delay.pass_on(solution.torque), *push)
        except DivergedError as error:
            return f"the simulation diverged at {now:.3f} s: {error}"
        tick += 1
    return ""


def _log_section(report: SectionReport, number: int) -> None:
    """Log what was decided at a section, and where the template cannot do it."""
    decision = report.decision
    _LOG.debug(
        "%.3f s, step %d: at %s %s, wanted %s, controls %s",
        report.time,
        number,
        report.section.name,
        report.state,
        report.target,
        decision.controls,
    )
    if not decision.feasible:
        _LOG.warning(
            "%.3f s, step %d: no stride of the template starts from %s at %s",
            report.time,
            number,
            report.state,
            report.section.name,
        )
    elif not decision.nominal:
        _LOG.info("%.3f s, step %d: the planner left its own law", report.time, number)


def _push(
    pushes: tuple[Push, ...], begun: list[tuple[float, float]], now: float
) -> tuple[float, float]:
    """Force of the pushes that act at time ``now``, forward and to the left [N].

    ``begun`` holds when each step began, and the duration of its gait's steps [s].
    """
    along = lateral = 0.0
    for push in pushes:
        if push.step < len(begun):
            time, duration = begun[push.step]
            begin = time + push.phase * duration
            if begin <= now < begin + push.duration:
                force = push.impulse / push.duration
                along += force * cos(push.direction)
                lateral += force * sin(push.direction)
    return along, lateral


def _fallen(
    plant: Plant, controller: EmbeddingController, q: Array, o: PreparedExperiment, now: float
) -> str:
    falls, length, robot = o.falls, controller.parameters.rest_length, controller.robot
    hip = robot.hip_height(q) - o.world.ground_height(float(q[0]))
    if hip < falls.height * length:
        return f"the hip was {hip:.2f} m above the ground"
    tilt = robot.tilt(q)
    if tilt > falls.pitch:
        return f"the trunk tilted to {degrees(tilt):.0f} degrees"
    patience = falls.patience * controller.planner.gait.step_duration
    if now - controller.supervisor.begun_at > patience:
        return "the robot stopped walking"
    if plant.trunk_touches_ground():
        return "the trunk touched the ground"
    return ""


class QpFailures:
    """Counts the ticks without a solved QP; warns once, with the robot's name, if they are many."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._ticks = self._failed = 0
        self._told = False

    def tick(self, solved: bool, now: float) -> None:
        """Count one tick at the time ``now`` [s]."""
        if self._ticks == _FAILURES_BLOCK:
            self._ticks = self._failed = 0
        self._ticks += 1
        self._failed += not solved
        if self._failed > _MANY_FAILURES * _FAILURES_BLOCK and not self._told:
            self._told = True
            QP_FAILURES.warning(
                "%s at %.3f s: the QP had no solution in %d of the last %d ticks, which keep the"
                " torques of the last one that had; what follows is no controlled motion",
                self._name,
                now,
                self._failed,
                self._ticks,
            )
