"""A run that goes on, tick by tick, in whose course one may push, command and look."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import fields, replace
from inspect import GEN_CLOSED, getgeneratorstate
from math import copysign, degrees, hypot, inf
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Positive
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.planners.default import default_planners
from template_control.embedding.state import SectionReport
from template_control.errors import DivergedError, ParameterError
from template_control.plant.plant import Plant, open_plant, plant_name
from template_control.plant.world import WorldOptions
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.template import template_for
from template_control.run.experiment import Experiment, PreparedExperiment
from template_control.run.hand import Hand, plant_force
from template_control.run.metadata import plain
from template_control.run.record import Record
from template_control.run.recorder import Recorder
from template_control.run.sensing import ContactSensors, Senses, senses_of
from template_control.run.start import start
from template_control.run.velocity import VelocityCommand, VelocityProfile
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.whole_body.solver import Solution

_LOCK = Lock()
_TAKEN: set[int] = set()


@contextmanager
def exclusive(*parts: Any) -> Iterator[None]:
    """Keep a run's parts, each of which has one run's state, from the runs of all threads."""
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

_OTHER_TEMPLATE = 0.05
"""Share by which a template may differ from the robot's own: a choice of l0, not another robot."""
_FAILURES_BLOCK = 200  # ticks
_MANY_FAILURES = 0.5  # share of a block: in a stumble the QP fails for a few ticks


class Tick(NamedTuple):
    """A tick of a run, after the controller's and before the plant's step.

    Attributes:
        number: from 0.
        time: since the run's start [s].
        steps: that are done.
        q, v: (nq,), (nv,) the true state; overwritten by the next tick.
        force: (n, d) the ground's on each contact [N]; overwritten by the next tick.
        push: on the trunk, forward and to the left [N].
        solution: torques of the controller.
    """

    number: int
    time: float
    steps: int
    q: Array
    v: Array
    force: Array
    push: tuple[float, float]
    solution: Solution


class LiveRun:
    """A run that goes on as long as somebody asks for its next tick.

    It is the loop of :func:`~template_control.simulate`, one tick at a time, and goes on without an
    end where neither its motion nor ``steps`` has one::

        command = tc.run.VelocityCommand(0.6)
        with tc.run.LiveRun(tc.Experiment("five-link", motion=command)) as run:
            for tick in run:
                if tick.number == 2000:
                    run.hand.push(15.0)
        again = tc.simulate(run.experiment())

    Args:
        experiment: robot, motion, planner, controller, world and disturbances.
        most: largest number of steps, where neither the experiment nor its motion has an end.
        keep: how much of the run's end is kept for its record [s]; None: all of it.

    Raises:
        TemplateControlError: as :func:`~template_control.simulate` raises it.

    Attributes:
        controller: of the robot.
        plant: the world.
        hand: pushes, friction and velocity while the run goes on.
        recorder: of the run so far.
        reason: why the robot fell; "" if it did not.
        endless: whether neither the experiment nor its motion has an end.
    """

    @checked
    def __init__(
        self, experiment: Experiment, most: float = inf, keep: Positive | None = None
    ) -> None:
        self._given = experiment
        self._o = o = experiment.prepare()
        if not isinstance(o.robot, PlanarBiped | FloatingBaseBiped):
            raise ParameterError(
                f"{o.robot!r} is of no kind that can be run: give a planar or a free biped"
            )
        self.controller = _controller(o)
        supervisor = self.controller.supervisor
        self.endless = o.steps is None and supervisor.route.endless
        self._last = most if self.endless else o.steps or inf
        self.reason = ""
        with ExitStack() as stack:
            parts = (o.motion, supervisor.route, *supervisor.planners.values())
            stack.enter_context(exclusive(o.robot, *parts, *o.planners.values()))
            _check_template(o.robot, self.controller.parameters)
            q, v = start(self.controller, o)
            senses = senses_of(self.controller, o.sensors, o.world.time_step)
            _LOG.info("%s in %s: %r", o.robot.name, plant_name(o.world), self.controller.planner)
            dt = o.world.time_step
            kept = None if keep is None else max(round(keep / dt), 1)
            self.recorder = Recorder(self.controller, o.record_every, _conditions(o), keep=kept)
            self.plant = stack.enter_context(open_plant(o.robot, o.world))
            self.plant.reset(q, v)
            self.hand = Hand(o, self.plant)
            # The robot's model is given back as one that goes where it faces.
            stack.callback(setattr, o.robot, "facing", 0.0)
            self._held = stack.pop_all()
        self._ticks = self._loop(senses)

    def __iter__(self) -> Iterator[Tick]:
        return self

    def __next__(self) -> Tick:
        return next(self._ticks)

    def __enter__(self) -> LiveRun:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def finish(self, progress: Callable[[int], None] | None = None) -> None:
        """Go on to the end; ``progress`` gets the number of completed steps after each."""
        done = 0
        for tick in self._ticks:
            if tick.steps > done:
                done = tick.steps
                if progress is not None:
                    progress(done)

    @property
    def ended(self) -> bool:
        """Whether there is no further tick."""
        return getgeneratorstate(self._ticks) == GEN_CLOSED

    def close(self) -> None:
        """End the run, and give back its plant, robot and planners; the record stays."""
        self._ticks.close()
        self._held.close()

    def record(self, *, interrupted: bool = False, error: str = "") -> Record:
        """The run so far, or as much of its end as is kept.

        Arguments as for :meth:`~template_control.run.Recorder.record`.
        """
        return self.recorder.record(self.reason, interrupted=interrupted, error=error)

    def experiment(self) -> Experiment:
        """The experiment that repeats the run so far to the last bit.

        What was done by hand is planned in it. The step that has begun is completed.

        Raises:
            ParameterError: if the run was given a prepared experiment.
        """
        if isinstance(self._given, PreparedExperiment):
            raise ParameterError(
                "the run was given a prepared experiment: give it as it is written"
            )
        hand, supervisor = self.hand, self.controller.supervisor
        again = replace(
            self._given,
            pushes=tuple(hand.pushes),
            frictions=tuple(hand.frictions),
            steps=len(supervisor.log) + 1 if self.endless else self._o.steps,
        )
        if not hand.velocities:
            return again
        x, y, z = self._o.start or supervisor.route.start.tolist()
        motion = self._given.motion
        assert isinstance(motion, VelocityProfile | VelocityCommand)
        profile = VelocityProfile(
            tuple(hand.velocities), foreseen=False, gaits=motion.gaits, changes=motion.changes
        )
        return replace(again, motion=profile, start=(x, y, z))

    def _loop(self, senses: Senses) -> Generator[Tick, None, None]:
        """The ticks of the run; ``reason`` says why the robot fell, if it does."""
        o, plant, controller, hand = self._o, self.plant, self.controller, self.hand
        robot, supervisor, recorder = controller.robot, controller.supervisor, self.recorder
        dt = o.world.time_step
        torques: deque[Array] = deque(maxlen=o.delay_ticks + 1)  # until they act
        q, v = robot.neutral(), np.zeros(robot.nv)
        forces = np.zeros((len(robot.feet), robot.contact_rows))
        linear = forces[:, : robot.directions]  # without the moments of soles
        contacts = ContactSensors(o.sensors, o.falls.contact_force * robot.mass * robot.gravity)
        thrown = o.falls.thrown * controller.parameters.speed_unit
        done, tick, failures = 0, 0, QpFailures(robot.name)
        begun: list[tuple[float, float]] = []
        while done < self._last and not supervisor.arrived:
            now, along, lateral = tick * dt, 0.0, 0.0
            if not hand.idle:
                hand.act(now)
            plant.read(q, v)
            plant.contact_forces(forces)
            begin = time.perf_counter()
            try:
                touching, felt = contacts.measure(np.ascontiguousarray(linear))
                sensed = senses.measure(q, v, touching)
                speed = hypot(*sensed[1].tolist()[: robot.directions])
                if speed > thrown and recorder.ticks:
                    raise DivergedError(f"the base moves at {speed:.3g} m/s")
                solution = controller.tick(*sensed, touching, dt, felt)
            except DivergedError as error:
                self.reason = f"the simulation diverged at {now:.3f} s: {error}"
                return
            seconds = time.perf_counter() - begin
            failures.tick(solution.solved, now)
            senses.expect(solution.acceleration)
            if len(begun) <= len(supervisor.log):
                # A step that changes into another stride keeps its pushes where they were.
                begun.append((supervisor.begun_at, controller.planner.gait.step_duration))
            if not hand.idle:
                along, lateral = hand.force(now, begun)
            size = copysign(hypot(along, lateral), along)
            recorder.tick(q, v, forces, solution, time=now, push=size, seconds=seconds)
            reason = _fallen(plant, controller, q, o, now)
            if reason:
                self.reason = f"{reason} at {now:.3f} s, in step {done + 1}"
                return
            if len(supervisor.log) > done:
                done = len(supervisor.log)
                _log_section(controller.reports[-1], done)
            push = along, lateral
            yield Tick(tick, now, done, q, v, forces, push=push, solution=solution)
            try:
                force = plant_force(robot, *push) if along or lateral else ()
                if not torques:
                    torques.extend([solution.torque] * o.delay_ticks)
                torques.append(solution.torque)
                plant.step(torques[0], *force)
            except DivergedError as error:
                self.reason = f"the simulation diverged at {now:.3f} s: {error}"
                return
            tick += 1


_APART = ("robot", "motion", "planner", "automaton")
_NAMES = {"world": "plant", "controller": "embedding"}  # in records of all versions


def _conditions(o: Experiment) -> dict[str, Any]:
    """Conditions of a simulation; a plant of one's own is not data."""
    given = {f.name: getattr(o, f.name) for f in fields(o) if f.name not in _APART}
    options = {_NAMES.get(name, name): value for name, value in given.items()}
    if not isinstance(o.world, WorldOptions):
        options["plant"] = {}
    return {"plant": plant_name(o.world), "options": plain(options)}


def _check_template(robot: Biped, given: SlipParameters) -> None:
    """Check that the mass, gravity and rest length of a route's template are the robot's."""
    own = template_for(robot)
    for name in ("mass", "gravity", "rest_length"):
        if abs(getattr(given, name) / getattr(own, name) - 1.0) > _OTHER_TEMPLATE:
            raise ParameterError(
                f"the gait or route is for a template of {_text(given)}, and that of {robot.name}"
                f" has {_text(own)}: give one for template_for(robot)"
            )


def _text(p: SlipParameters) -> str:
    return f"{p.mass:.4g} kg, l0 = {p.rest_length:.4g} m and g = {p.gravity:.4g} m/s^2"


def _controller(o: PreparedExperiment) -> EmbeddingController:
    """Follows a route or keeps a planner's gait."""
    options, automaton, planner, motion = o.tuning, o.automaton, o.planner, o.motion
    if isinstance(planner, Mapping):
        assert isinstance(motion, Route)
        return EmbeddingController(o.robot, planner, options, motion, automaton)
    steady = SteadyRoute.of(planner.gait, automaton)
    if options.catches and automaton is AUTOMATON and steady.section is VLO:
        planner = default_planners(steady, planner)
    return EmbeddingController(o.robot, planner, options, steady, automaton)


def _log_section(report: SectionReport, number: int) -> None:
    """Log what was decided at a section, and where the template cannot do it."""
    decision, z, section = report.decision, report.state, report.section.name
    now, wanted, u = f"{report.time:.3f} s, step {number}", report.target, decision.controls
    _LOG.debug("%s: at %s %s, wanted %s, controls %s", now, section, z, wanted, u)
    if not decision.feasible:
        _LOG.warning("%s: no stride of the template starts from %s at %s", now, z, section)
    elif not decision.nominal:
        _LOG.info("%s: the planner left its own law", now)


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
    supervisor, patience = controller.supervisor, falls.patience
    duration = controller.planner.gait.step_duration
    lasts, longest = now - supervisor.begun_at, patience * duration
    if lasts > longest:
        # A stop may be planned to take longer; one that is planned again and again is none.
        rests = supervisor.planned_at + supervisor.time_of(Event.REST) + duration
        if not (now < rests < inf and lasts < 2.0 * longest):
            return "the robot stopped walking"
    if plant.trunk_touches_ground():
        return "the trunk touched the ground"
    return ""


class QpFailures:
    """Counts the ticks without a solved QP; warns once, with the robot's name, if they are many."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._ticks = self._failed = 0
        self._warned = False

    def tick(self, solved: bool, now: float) -> None:
        """Count one tick at the time ``now`` [s]."""
        if self._ticks == _FAILURES_BLOCK:
            self._ticks = self._failed = 0
        self._ticks += 1
        self._failed += not solved
        if self._failed > _MANY_FAILURES * _FAILURES_BLOCK and not self._warned:
            self._warned = True
            QP_FAILURES.warning(
                "%s at %.3f s: the QP had no solution in %d of the last %d ticks, which keep the"
                " torques of the last one that had; what follows is no controlled motion",
                self._name,
                now,
                self._failed,
                self._ticks,
            )
