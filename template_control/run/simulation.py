"""Run a robot: plant, controller and recorder in one loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import phase_control
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.references.apex_pose import ApexStart, apex_pose
from template_control.embedding.robot_route import robot_route
from template_control.embedding.section_report import SectionReport
from template_control.embedding.standing.pose import standing_pose
from template_control.errors import ParameterError
from template_control.estimation.imu import ImuOptions, ImuSensors
from template_control.plant.plant import Plant, open_plant, plant_name
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import Pose, state_at_vlo, state_in
from template_control.run.in_use import in_use
from template_control.run.metadata import about, outcome
from template_control.run.options import Push, SimulationOptions, check_pushes
from template_control.run.record import Record, RunInterrupted
from template_control.run.recorder import Recorder, Truth
from template_control.run.sensing import Senses, Sensors, TorqueDelay
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.section import APEX, REST, VLO
from template_control.slip.scenario.catching import CatchingRoute
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.slip.scenario.scenario import Scenario
from template_control.slip.similarity import Scale

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)

STEPS = 50
"""Steps of a run on a route that does not end, where the options do not say."""


@checked
def perturbed_start(gait: Gait, seed: int) -> tuple[float, float, float]:
    """The gait's state at its section, changed by up to 5 % in speed and 2 % of l0 in height.

    Args:
        gait: whose state is changed.
        seed: of the draws.

    Returns:
        dx/dt, y, dy/dt [m/s, m, m/s].
    """
    z, length = [*gait.state, 0.0][:3], gait.parameters.rest_length
    draw = np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    height = z[1] + 0.02 * draw[1] * length
    return float(z[0] * (1.0 + 0.05 * draw[0])), float(height), float(z[2])


@checked
def simulate(
    robot: PlanarBiped,
    route: Route | Scenario | Planner,
    options: SimulationOptions | None = None,
    progress: Callable[[int], None] | None = None,
    planners: Planners | None = None,
    automaton: Automaton = AUTOMATON,
) -> Record:
    """Run ``robot`` along a route and record it; a fall ends the run and raises nothing.

    Ctrl-C ends the run, and the loop it stands in; the exception carries what was recorded.

    Args:
        robot: model of the controller, and whose URDF the plant loads.
        route: which stride comes next and towards which state; or a scenario, which is put on
            the robot's template; or a planner, whose gait the robot keeps. A walk then breaks
            into a run where it cannot go on, and walks again
            (:class:`~template_control.slip.scenario.catching.CatchingRoute`).
        options: how the run goes.
        progress: called with the number of completed steps after each.
        planners: one for each kind of stride of the route; by default
            :func:`~template_control.embedding.planners.default.default_planners`.
        automaton: of the route's strides.

    Raises:
        RobotError: if the robot's legs do not reach the start.
        ParameterError: if there is no planner for a stride of the route, no pose to start in, or
            if another run uses the robot, the route or a planner at this moment.
        ScenarioError: if the scenario asks for what the robot cannot do.
        RunInterrupted: at Ctrl-C, with the record until then; a plain KeyboardInterrupt before
            the first sample.
    """
    o = options or SimulationOptions()
    if isinstance(route, Scenario):
        route = robot_route(robot, route)
    if isinstance(route, Planner):
        controller = _keeping(robot, route, o.embedding, automaton)
    else:
        chosen = planners or default_planners(route)
        controller = EmbeddingController(robot, chosen, o.embedding, route, automaton)
    recorder = Recorder(controller, o.record_every)
    last = _last_step(controller, o)
    with in_use(robot, controller.planning.route, *controller.planning.planners.values()):
        q, v = _start(controller, o)
        _LOG.info("%s in %s: %r", robot.name, plant_name(o.plant), controller.planner)
        # Before the run, which would be lost if this failed after it.
        metadata = about(controller, o)
        begin = time.perf_counter()
        stop: KeyboardInterrupt | None = None
        with open_plant(robot, o.plant) as plant:
            plant.reset(q, v)
            try:
                reason = _loop(plant, controller, recorder, o, (last, progress))
            except KeyboardInterrupt as error:
                if not recorder.rows:
                    raise
                reason, stop = "", error
        seconds = time.perf_counter() - begin
        if reason:
            _LOG.warning("%s fell: %s", robot.name, reason)
        metadata |= outcome(recorder, o.plant.time_step, reason, seconds)
        metadata["interrupted"] = stop is not None
        record = recorder.record(metadata)
    _LOG.info("%r in %.2f s of wall-clock time", record, seconds)
    if stop is not None:
        raise RunInterrupted(record) from stop
    return record


def _keeping(
    robot: PlanarBiped, planner: Planner, options: EmbeddingOptions, automaton: Automaton
) -> EmbeddingController:
    """A controller that keeps the planner's gait; a walk that cannot go on breaks into a run."""
    steady = SteadyRoute.of(planner.gait, automaton)
    if not options.catches or automaton is not AUTOMATON or steady.section is not VLO:
        return EmbeddingController(robot, planner, options, steady, automaton)
    caught = CatchingRoute(steady)
    return EmbeddingController(robot, default_planners(caught, planner), options, caught, automaton)


def _start(controller: EmbeddingController, o: SimulationOptions) -> tuple[Array, Array]:
    """Start the controller where the run begins, and tell (q, v) there.

    Raises:
        ParameterError: if the route begins at an apex of a stride whose legs do not take turns,
            and no pose is given.
    """
    robot, route, pose = controller.robot, controller.planning.route, o.pose
    z = route.start if o.start is None else np.array(o.start)
    if pose is None and route.section == APEX:
        pose = _apex_pose(controller, z[: APEX.dimension])
    if pose is None and route.section == REST:
        pose = standing_pose(route.parameters)
    if pose is not None:
        q, v = state_in(robot, pose)
        controller.start(pose.rear, pose.swung)
        return q, v
    # Mid-swing: beside the stance foot, passing it at twice the CoM's speed.
    swing = np.array([0.0, controller.options.swing.clearance])
    pitch = controller.first_pitch()
    q, v = state_at_vlo(robot, z, 0, swing, np.array([2.0 * z[0], 0.0]), pitch)
    controller.start()
    return q, v


def _apex_pose(controller: EmbeddingController, z: Array) -> Pose:
    """The pose at an apex ``z`` (2,) in which the route's first gait has its feet."""
    planning, o = controller.planning, controller.options
    planner, node = planning.begin(APEX)
    gait = planner.gait
    pitch = controller.first_pitch()
    swing = phase_control(o.phases, node).swing or o.swing
    return apex_pose(controller.robot, ApexStart(z, gait, swing, pitch, planning.automaton))


def _last_step(controller: EmbeddingController, o: SimulationOptions) -> float:
    """How many steps the run has at most.

    Raises:
        ParameterError: if a push comes after the last of them.
    """
    if o.steps is not None:
        return o.steps  # the options have looked at the pushes
    if not controller.planning.route.endless:
        return np.inf
    check_pushes(o.pushes, STEPS)
    return STEPS


def _loop(
    plant: Plant,
    controller: EmbeddingController,
    recorder: Recorder,
    o: SimulationOptions,
    until: tuple[float, Callable[[int], None] | None],
) -> str:
    """Run until the steps are done ("") or the robot falls (why).

    ``until`` holds the number of steps, and what is called with those done.
    """
    last, progress = until
    robot, planning = controller.robot, controller.planning
    dt = o.plant.time_step
    sensors, delay = _senses(controller, o), TorqueDelay(o.delay_ticks)
    q, v, forces = np.zeros(robot.nv), np.zeros(robot.nv), np.zeros((2, 2))
    threshold = o.falls.contact_force * robot.mass * robot.gravity
    done, tick = 0, 0
    begun: list[tuple[float, float]] = []
    while done < last and not planning.arrived:
        now = tick * dt
        plant.read(q, v)
        plant.contact_forces(forces)
        start = time.perf_counter()
        try:
            touching = forces[:, 1] > threshold
            solution = controller.tick(*sensors.measure(q, v, touching), touching, dt, forces)
        except ParameterError as error:
            return f"the simulation diverged at {now:.3f} s: {error}"
        seconds = time.perf_counter() - start
        sensors.expect(solution.acceleration)
        if not sensors.exact:
            robot.update(q, v)  # what is recorded is true
        if len(begun) < len(controller.reports):
            # A step that changes into another stride keeps its pushes where they were.
            begun.append((controller.reports[-1].time, controller.planner.gait.step_duration))
        push = _push(o.pushes, begun, now)
        recorder.tick(Truth(now, q, v, forces, push), solution, seconds)
        reason = _fallen(plant, controller, q, o, now)
        if reason:
            return f"{reason} at {now:.3f} s, in step {done + 1}"
        if len(controller.reports) - 1 > done:
            done = len(controller.reports) - 1
            _tell(controller.reports[-1], done)
            if progress is not None:
                progress(done)
        try:
            plant.step(delay.pass_on(solution.torque), push)
        except ParameterError as error:
            return f"the simulation diverged at {now:.3f} s: {error}"
        tick += 1
    return ""


def _senses(controller: EmbeddingController, o: SimulationOptions) -> Senses:
    """What tells the controller the state."""
    robot, parameters = controller.robot, controller.parameters
    if isinstance(o.sensors, ImuOptions):
        return ImuSensors(o.sensors, robot, Scale.of(parameters), o.plant.time_step)
    return Sensors(o.sensors, robot, parameters.rest_length)


def _tell(report: SectionReport, number: int) -> None:
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


def _push(pushes: tuple[Push, ...], begun: list[tuple[float, float]], now: float) -> float:
    """Force of the pushes that act at time ``now`` [N].

    ``begun`` holds when each step began, and the duration of its gait's steps [s].
    """
    total = 0.0
    for push in pushes:
        if push.step < len(begun):
            time, duration = begun[push.step]
            begin = time + push.phase * duration
            if begin <= now < begin + push.duration:
                total += push.impulse / push.duration
    return total


def _fallen(
    plant: Plant, controller: EmbeddingController, q: Array, o: SimulationOptions, now: float
) -> str:
    falls, length = o.falls, controller.parameters.rest_length
    hip = controller.robot.hip_height(q) - o.plant.ground_height(q[0])
    if hip < falls.height * length:
        return f"the hip was {hip:.2f} m above the ground"
    if abs(q[2]) > falls.pitch:
        return f"the trunk pitched to {np.degrees(q[2]):.0f} degrees"
    patience = falls.patience * controller.planner.gait.step_duration
    if now - controller.reports[-1].time > patience:
        return "the robot stopped walking"
    if plant.trunk_touches_ground():
        return "the trunk touched the ground"
    return ""
