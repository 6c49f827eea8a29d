"""Run a robot: plant, controller and recorder in one loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from template_control.checked import checked
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.robot_route import robot_route
from template_control.embedding.section_report import SectionReport
from template_control.errors import ParameterError
from template_control.plant.plant import Plant, open_plant, plant_name
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import state_at_vlo, state_in
from template_control.run.in_use import in_use
from template_control.run.metadata import about, outcome
from template_control.run.options import Push, SimulationOptions, check_pushes
from template_control.run.record import Record
from template_control.run.recorder import Recorder, Truth
from template_control.run.sensing import Sensors, TorqueDelay
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.maps.section import VLO
from template_control.slip.scenario.route import Route
from template_control.slip.scenario.scenario import Scenario

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)

_STEPS = 50  # of a run on a route that does not end, where the options do not say


@checked
def perturbed_start(gait: WalkingGait, seed: int) -> tuple[float, float, float]:
    """The gait's VLO state with up to 5 % more or less speed and 2 % of l0 in height, drawn.

    Args:
        gait: whose VLO state is changed.
        seed: of the draws.

    Returns:
        dx/dt, y, dy/dt [m/s, m, m/s].
    """
    z, length = gait.vlo, gait.parameters.rest_length
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

    Ctrl-C ends the run too; what was done by then is returned, marked ``interrupted``.

    Args:
        robot: model of the controller, and whose URDF the plant loads.
        route: which stride comes next and towards which state; or a scenario, which is put on
            the robot's template; or a planner, whose gait the robot keeps.
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
    """
    o = options or SimulationOptions()
    if isinstance(route, Scenario):
        route = robot_route(robot, route)
    if isinstance(route, Planner):
        controller = EmbeddingController(robot, route, o.embedding, automaton=automaton)
    else:
        chosen = planners or default_planners(route)
        controller = EmbeddingController(robot, chosen, o.embedding, route, automaton)
    recorder = Recorder(controller, o.record_every)
    last = _last_step(controller, o)
    with in_use(robot, controller.planning.route, *controller.planning.planners.values()):
        q, v = _start(controller, o)
        controller.start(0 if o.pose is None else o.pose.rear)
        _LOG.info("%s in %s: %r", robot.name, plant_name(o.plant), controller.planner)
        # Before the run, which would be lost if this failed after it.
        metadata = about(controller, o)
        begin = time.perf_counter()
        interrupted = False
        with open_plant(robot, o.plant) as plant:
            plant.reset(q, v)
            try:
                reason = _loop(plant, controller, recorder, o, (last, progress))
            except KeyboardInterrupt:
                if not recorder.rows:
                    raise
                reason, interrupted = "", True
        seconds = time.perf_counter() - begin
        if reason:
            _LOG.warning("%s fell: %s", robot.name, reason)
        metadata |= outcome(recorder, o.plant.time_step, reason, seconds)
        metadata["interrupted"] = interrupted
        record = recorder.record(metadata)
    _LOG.info("%r in %.2f s of wall-clock time", record, seconds)
    return record


def _start(controller: EmbeddingController, o: SimulationOptions) -> tuple[Array, Array]:
    """(q, v) that the run begins in.

    Raises:
        ParameterError: if the route does not begin at VLO and no pose is given.
    """
    robot, route = controller.robot, controller.planning.route
    if o.pose is not None:
        return state_in(robot, o.pose)
    if route.section != VLO:
        raise ParameterError(
            f"the route begins at {route.section.name}, and only at VLO it is clear where the"
            " feet are: give SimulationOptions a pose"
        )
    z = np.array(o.start) if o.start is not None else route.start
    # Mid-swing: beside the stance foot, passing it at twice the CoM's speed.
    swing = np.array([0.0, controller.options.swing.clearance])
    pitch = controller.options.trunk_pitch
    return state_at_vlo(robot, z, 0, swing, np.array([2.0 * z[0], 0.0]), pitch)


def _last_step(controller: EmbeddingController, o: SimulationOptions) -> float:
    """How many steps the run has at most.

    Raises:
        ParameterError: if a push comes after the last of them.
    """
    if o.steps is not None:
        return o.steps  # the options have looked at the pushes
    if not controller.planning.route.endless:
        return np.inf
    check_pushes(o.pushes, _STEPS)
    return _STEPS


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
    length = controller.parameters.rest_length
    sensors, delay = Sensors(o.sensors, robot, length), TorqueDelay(o.delay_ticks)
    q, v, forces = np.zeros(robot.nv), np.zeros(robot.nv), np.zeros((2, 2))
    threshold = o.falls.contact_force * robot.mass * robot.gravity
    done, tick = 0, 0
    while done < last and not planning.arrived:
        now = tick * dt
        plant.read(q, v)
        plant.contact_forces(forces)
        start = time.perf_counter()
        try:
            solution = controller.tick(*sensors.measure(q, v), forces[:, 1] > threshold, dt)
        except ParameterError as error:
            return f"the simulation diverged at {now:.3f} s: {error}"
        seconds = time.perf_counter() - start
        if sensors.noisy:
            robot.update(q, v)  # what is recorded is true
        push = _push(o.pushes, controller, now)
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


def _push(pushes: tuple[Push, ...], controller: EmbeddingController, now: float) -> float:
    """Force of the pushes that act at time ``now`` [N]."""
    total = 0.0
    for push in pushes:
        if push.step < len(controller.reports):
            duration = controller.planner.gait.step_duration
            begin = controller.reports[push.step].time + push.phase * duration
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
