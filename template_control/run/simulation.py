"""Walk a robot: plant, controller and recorder in one loop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.planner import Planner
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.plant import Plant, open_plant, plant_name
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import state_at_vlo
from template_control.run.record import Record
from template_control.run.recorder import Recorder
from template_control.run.sensing import SensorOptions, Sensors, TorqueDelay
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.gaits.gait import WalkingGait

Array = NDArray[np.float64]

_CONTACT_FORCE = 0.005  # of the weight: what a foot must carry to count as touching
_FALL_HEIGHT = 0.35  # of the template's rest length: hip nearer to the ground than that
_FALL_PITCH = np.radians(60.0)
_PATIENCE = 4.0  # step durations without a VLO
_LONGEST_DELAY = 1.0  # [s]


@dataclass(frozen=True)
class Push:
    """A horizontal force on the trunk.

    Attributes:
        impulse: [N s], forward positive.
        step: the push begins in this step (0 is the first) ...
        phase: ... this share of the gait's step duration after its VLO.
        duration: [s].
    """

    impulse: float
    step: int = 10
    phase: float = 0.0
    duration: float = 0.1


@dataclass(frozen=True)
class SimulationOptions:
    """How a run goes.

    Attributes:
        steps: VLO to VLO, how many to walk.
        plant: the world; the type of its options says which.
        embedding: the controller's tuning.
        start: (3,) VLO state to start in; None for the gait's.
        pushes: disturbances.
        sensors: noise on the state the controller gets; the plant and the record have the
            true one.
        delay: from a measurement to the torques computed from it [s], a whole number of
            physics steps.
        record_every: keep every n-th sample.
    """

    steps: int = 50
    plant: PlantOptions | IdealOptions = field(default_factory=PlantOptions)
    embedding: EmbeddingOptions = field(default_factory=EmbeddingOptions)
    start: tuple[float, float, float] | None = None
    pushes: tuple[Push, ...] = ()
    sensors: SensorOptions = field(default_factory=SensorOptions)
    delay: float = 0.0
    record_every: int = 1

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ParameterError(f"steps is {self.steps}: give at least 1")
        if self.record_every < 1:
            raise ParameterError(f"record_every is {self.record_every}: give at least 1")
        step = self.plant.time_step
        whole = np.isfinite(self.delay) and abs(self.delay / step - self.delay_ticks) < 1e-6
        if not (whole and 0.0 <= self.delay <= _LONGEST_DELAY):
            raise ParameterError(
                f"delay is {self.delay!r} s: give a multiple of the time step, {step:g} s, from 0"
                f" to {_LONGEST_DELAY:g} s"
            )

    @property
    def delay_ticks(self) -> int:
        """The delay in physics steps."""
        return round(self.delay / self.plant.time_step) if np.isfinite(self.delay) else 0


def perturbed_start(gait: WalkingGait, seed: int) -> tuple[float, float, float]:
    """The gait's VLO state with up to 5 % more or less speed and 2 % of l0 in height, drawn."""
    z, length = gait.vlo, gait.parameters.rest_length
    draw = np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    height = z[1] + 0.02 * draw[1] * length
    return float(z[0] * (1.0 + 0.05 * draw[0])), float(height), float(z[2])


def simulate(
    robot: PlanarBiped,
    planner: Planner,
    options: SimulationOptions | None = None,
    progress: Callable[[int], None] | None = None,
) -> Record:
    """Walk ``robot`` and record it; a fall ends the run, is recorded and raises nothing.

    Ctrl-C ends the run too; what was walked by then is returned, marked ``interrupted``.

    Args:
        robot: model of the controller, and whose URDF the plant loads.
        planner: chooses the steps; owns the gait.
        options: how the run goes.
        progress: called with the number of completed steps after each.

    Raises:
        RobotError: if the robot's legs do not reach the gait's VLO.
    """
    o = options or SimulationOptions()
    gait = planner.gait
    controller = EmbeddingController(robot, planner, o.embedding)
    recorder = Recorder(controller, o.record_every)
    z = np.array(o.start) if o.start is not None else gait.vlo
    length = gait.parameters.rest_length
    # Mid-swing: beside the stance foot, passing it at twice the CoM's speed.
    swing = np.array([0.0, controller.options.swing.clearance])
    q, v = state_at_vlo(robot, z, 0, swing, np.array([2.0 * z[0], 0.0]), o.embedding.trunk_pitch)
    controller.start(0)
    begin = time.perf_counter()
    interrupted = False
    with open_plant(robot, o.plant) as plant:
        plant.reset(q, v)
        try:
            reason = _loop(plant, controller, recorder, o, length, progress)
        except KeyboardInterrupt:
            if not recorder.rows:
                raise
            reason, interrupted = "", True
    seconds = time.perf_counter() - begin
    metadata = _metadata(controller, recorder, o, reason, seconds)
    metadata["interrupted"] = interrupted
    return recorder.record(metadata)


def _loop(
    plant: Plant,
    controller: EmbeddingController,
    recorder: Recorder,
    o: SimulationOptions,
    length: float,
    progress: Callable[[int], None] | None,
) -> str:
    """Run until the steps are done ("") or the robot falls (why)."""
    robot, gait = controller.robot, controller.planner.gait
    dt = o.plant.time_step
    sensors, delay = Sensors(o.sensors, robot, length), TorqueDelay(o.delay_ticks)
    q, v, forces = np.zeros(robot.nv), np.zeros(robot.nv), np.zeros((2, 2))
    threshold = _CONTACT_FORCE * robot.mass * robot.gravity
    patience = _PATIENCE * gait.step_duration
    done, now, tick = 0, 0.0, 0
    while done < o.steps:
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
        push = _push(o.pushes, controller, gait.step_duration, now)
        recorder.tick(now, q, v, forces, solution, push, seconds)
        reason = _fallen(plant, controller, q, o.plant.ground_height(q[0]), length, patience, now)
        if reason:
            return f"{reason} at {now:.3f} s, in step {done + 1}"
        if len(controller.steps) - 1 > done:
            done = len(controller.steps) - 1
            if progress is not None:
                progress(done)
        try:
            plant.step(delay.pass_on(solution.torque), push)
        except ParameterError as error:
            return f"the simulation diverged at {now:.3f} s: {error}"
        tick += 1
    return ""


def _push(
    pushes: tuple[Push, ...], controller: EmbeddingController, duration: float, now: float
) -> float:
    """Force of the pushes that act at time ``now`` [N]."""
    total = 0.0
    for push in pushes:
        if push.step < len(controller.steps):
            begin = controller.steps[push.step].time + push.phase * duration
            if begin <= now < begin + push.duration:
                total += push.impulse / push.duration
    return total


def _fallen(
    plant: Plant,
    controller: EmbeddingController,
    q: Array,
    ground: float,
    length: float,
    patience: float,
    now: float,
) -> str:
    hip = controller.robot.hip_height(q) - ground
    if hip < _FALL_HEIGHT * length:
        return f"the hip was {hip:.2f} m above the ground"
    if abs(q[2]) > _FALL_PITCH:
        return f"the trunk pitched to {np.degrees(q[2]):.0f} degrees"
    if now - controller.steps[-1].time > patience:
        return "the robot stopped walking"
    if plant.trunk_touches_ground():
        return "the trunk touched the ground"
    return ""


def _metadata(
    controller: EmbeddingController,
    recorder: Recorder,
    o: SimulationOptions,
    reason: str,
    seconds: float,
) -> dict[str, Any]:
    robot, gait = controller.robot, controller.planner.gait
    parameters = asdict(gait.parameters)
    metadata = {
        "robot": robot.name,
        "urdf": robot.urdf,
        "mass": robot.mass,
        "joints": list(robot.joint_names),
        "torque_limit": controller.qp.torque_limit.tolist(),
        "feet": list(robot.feet),
        "legs": [list(leg) for leg in robot.legs],
        "trunk_com": robot.trunk_com,
        "nodes": [node.name for node in AUTOMATON.nodes],
        "gait": gait.name,
        "template": parameters,
        "gait_vlo": gait.vlo.tolist(),
        "gait_controls": gait.controls.tolist(),
        "gait_mean_speed": gait.mean_speed,
        "planner": type(controller.planner).__name__,
        "plant": plant_name(o.plant),
        "options": asdict(o),
        "fall_reason": reason,
        "wall_seconds": seconds,
        "duration": recorder.ticks * o.plant.time_step,
        "ticks": recorder.ticks,
        "summary": recorder.summary(),
    }
    # As it will be read back: JSON knows lists, not tuples.
    return dict(json.loads(json.dumps(metadata)))
