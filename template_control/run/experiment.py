"""Experiment: one description of a run, made by Python, a TOML file and the command line alike.

``walk`` writes one next to every run, ``run.toml``; ``walk --config run.toml`` repeats the run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from template_control import settings, storage
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Count, Index, NotNegative, Positive
from template_control.embedding.free.motion import Course
from template_control.embedding.options import (
    KINDS,
    EmbeddingOptions,
    RobotKind,
    kind_of,
    robot_kind,
)
from template_control.embedding.planners.ahead import AheadOptions, AheadPlanner
from template_control.embedding.planners.default import default_planners, first_speed
from template_control.embedding.planners.lqr import WALK, LqrOptions, LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.planners.running import RunningOptions, RunningPlanner
from template_control.embedding.tick import CONTROL
from template_control.errors import ParameterError
from template_control.estimation.delay import DELAY
from template_control.estimation.imu import ImuOptions
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.plant.plant import Plant, check_world, default_plant
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.spec import RobotSpec
from template_control.robot.start import Pose
from template_control.robot.template import check_apex, walk_limits
from template_control.run.options import FallOptions, HeadingCommand, Push, check_pushes
from template_control.run.recorder import RECORD
from template_control.run.robot_route import check_feasibility, robot_route, standing_options
from template_control.run.sensing import SensorOptions
from template_control.run.specs import GaitSpec, OwnPlanner, PlannerSpec
from template_control.run.velocity import (
    VelocityCommand,
    VelocityProfile,
    course_at,
    velocity_route,
)
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.gait import Gait, WalkingGait
from template_control.slip.gaits.running_gait import RunningGait
from template_control.slip.gaits.walking_by_speed import walking_gait
from template_control.slip.planning.pressure import PRESSURE
from template_control.slip.scenario.route import Route
from template_control.slip.scenario.scenario import STAND_HEIGHT, Scenario, Segment
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.slip.scenario.speed_route import SpeedRoute
from template_control.warm_up import ready

COMPILED = (*WALK, *CONTROL, *RECORD, *DELAY, *PRESSURE)
"""Compiled functions of a walk and its record; of two processes one compiles the first."""

STEPS = 50  # steps of a run on a route that does not end, where the experiment does not say

_STAND = 2.0  # a walk's first and last stand [s]
_LONGEST_DELAY = 1.0  # [s]


@dataclass(frozen=True)
class Experiment(Checked):
    """All that a run depends on; the same library repeats it to the last bit.

    Each field holds options, which TOML can say, or an object of Python in their place.

    Attributes:
        robot: a shipped robot's name or a URDF's path; or its options; or the model.
        motion: a gait to keep, or a scenario, which is put on the robot's template, or a route, or
            velocities; None: the gait of the planner, or the robot's own
            walk. A walk breaks into another stride where it cannot go on, and walks again
            (:class:`~template_control.embedding.recovery.Recovery`).
        planner: its options; or a planner; or one for each kind of stride of a route. None: ahead
            where a planar robot has a scenario that walks only, deadbeat for a run, else lqr, tuned
            for the kind of robot; for a route
            :func:`~template_control.embedding.planners.default.default_planners`.
        controller: tuning of the embedding; None: that of the robot's kind.
        world: options of a plant, or a plant of one's own: the run resets it, and leaves it open.
        pushes: on the trunk.
        frictions: times from the run's start, rising [s], and the friction of the ground from each
            of them on; a plant needs ``set_friction`` for it, which PyBullet's and MuJoCo's have.
        sensors: what the controller gets to know of the state: all of it, with noise; or what
            encoders, IMU and contacts make of it. The plant and the record have the true one.
        delay: from a measurement to the torques computed from it [s], a whole number of
            physics steps.
        start: (3,) dx/dt, y, dy/dt to start in [m/s, m, m/s], dy/dt 0 at apex; None for the
            motion's.
        seed: the start is the gait's changed by :func:`perturbed_start`, drawn with this seed.
        pose: CoM and feet to start with; None: over the stance foot at VLO, and at apex with the
            feet where the gait has them. A stride in which one leg lands again and again needs it.
        course: where a floating-base robot goes; a planar one has none.
        falls: when the robot counts as fallen.
        strict: whether a scenario is refused whose walk wants a speed or a change of speed that
            cannot be had; else the nearest is taken.
        steps: largest number of steps from section to section. None: the run goes to the end of
            the motion, or makes 50 steps where it has no end.
        record_every: keep every n-th sample.
        automaton: of the strides.

    Raises:
        ParameterError: if a value is of a wrong type or out of its range, the world is no plant,
            the delay is not a whole number of physics steps up to 1 s, a push comes after the last
            step, the times of frictions do not rise, or there is both a start and a seed.
    """

    robot: RobotSpec | Biped | str = field(default_factory=RobotSpec)
    motion: GaitSpec | Scenario | VelocityProfile | VelocityCommand | Gait | Route | None = None
    planner: PlannerSpec | Planner | Planners | None = None
    controller: EmbeddingOptions | None = None
    world: PlantOptions | MujocoOptions | IdealOptions | Plant = field(
        default_factory=default_plant
    )
    pushes: tuple[Push, ...] = ()
    frictions: tuple[tuple[NotNegative, Positive], ...] = ()
    sensors: SensorOptions | ImuOptions = field(default_factory=SensorOptions)
    delay: NotNegative = 0.0
    start: tuple[float, float, float] | None = None
    seed: Index | None = None
    pose: Pose | None = None
    course: HeadingCommand = field(default_factory=HeadingCommand)
    falls: FallOptions = field(default_factory=FallOptions)
    strict: bool = False
    steps: Count | None = None
    record_every: Count = 1
    automaton: Automaton = field(default=AUTOMATON, metadata=settings.PYTHON_ONLY)

    def __post_init__(self) -> None:
        if isinstance(self.robot, str):
            object.__setattr__(self, "robot", RobotSpec(self.robot))
        check_world(self.world)
        super().__post_init__()
        if self.steps is not None:
            check_pushes(self.pushes, self.steps)
        if self.seed is not None and self.start is not None:
            raise ParameterError("a seed does not go with a start: leave one out")
        times = [time for time, _ in self.frictions]
        if sorted(set(times)) != times:
            raise ParameterError(f"Experiment.frictions has the times {times}: give rising ones")
        step = self.world.time_step
        whole = abs(self.delay / step - self.delay_ticks) < 1e-6
        if not (whole and self.delay <= _LONGEST_DELAY):
            raise ParameterError(
                f"delay is {self.delay!r} s: give a multiple of the time step, {step:g} s, from 0"
                f" to {_LONGEST_DELAY:g} s"
            )

    @property
    def free(self) -> bool:
        """True if the robot has a floating base."""
        if isinstance(self.robot, RobotSpec):
            return self.robot.free
        return isinstance(self.robot, FloatingBaseBiped)

    @property
    def robot_name(self) -> str:
        """Name of the robot; of one's own the path of its URDF."""
        return self.robot.model if isinstance(self.robot, RobotSpec) else str(self.robot)

    @property
    def tuning(self) -> EmbeddingOptions:
        """The controller's, the given one or its kind's default."""
        return self.controller or EmbeddingOptions.of_kind(self.robot_kind)

    @property
    def robot_kind(self) -> RobotKind:
        """Kind of the robot."""
        robot = self.robot
        if isinstance(robot, RobotSpec):
            return kind_of(free=robot.free, flat=robot.stands_flat, trots=robot.trots)
        assert isinstance(robot, Biped)
        return robot_kind(robot)

    @property
    def delay_ticks(self) -> int:
        """The delay in physics steps."""
        return round(self.delay / self.world.time_step)

    def resolved(self) -> Experiment:
        """The same experiment with the motion, planner and tuning used where none was given."""
        motion, planner = self.motion, self.planner
        if motion is None and (planner is None or isinstance(planner, PlannerSpec)):
            motion = GaitSpec()
        if planner is None and not isinstance(motion, Route | VelocityProfile | VelocityCommand):
            planner = self._default_planner(motion)
        return replace(self, motion=motion, planner=planner, controller=self.tuning)

    def _default_planner(self, motion: GaitSpec | Scenario | Gait | None) -> PlannerSpec:
        runs = motion.name == "run" if isinstance(motion, GaitSpec) else None
        if runs or isinstance(motion, RunningGait):
            return RunningOptions()
        kind = KINDS[self.robot_kind]
        ahead = False
        if isinstance(motion, Scenario):
            ahead = motion.has_any_speed(kind.bears) and (kind.bears or not self.free)
        elif isinstance(motion, GaitSpec):
            own = motion.name == "walk" and motion.touchdown_angle is None
            stands = motion.from_stand or motion.to_stand
            ahead = own and (kind.walks_ahead or (kind.bears and stands))
        return kind.ahead if ahead else kind.lqr

    def with_(self, keys: Mapping[str, Any]) -> Experiment:
        """The same experiment with some keys set, named as in its TOML file.

        Args:
            keys: values by dotted key, such as ``{"world.friction": 0.5, "steps": 20}``.

        Raises:
            ParameterError: naming the key, if it is unknown or its value does not fit.
        """
        base = self
        first = {k: v for k, v in keys.items() if k.partition(".")[0] in ("robot", "motion")}
        if first:
            if base.motion is None:
                base = replace(base, motion=base.resolved().motion)
            base = settings.changed(base, first)
            if base.tuning.kind != base.robot_kind:
                base = replace(base, controller=None)  # the other kind of robot's
        rest = {k: v for k, v in keys.items() if k not in first}
        own = "world.robot" not in rest and any(k.startswith("world.robot.") for k in rest)
        if own and getattr(base.world, "robot", 0) is None:
            rest = {"world.robot": base.robot, **rest}  # the controller's, but for these keys
        missing = {
            name: getattr(base.resolved(), name)
            for name in ("planner", "controller")
            if getattr(base, name) is None and any(k.startswith(f"{name}.") for k in rest)
        }
        return settings.changed(replace(base, **missing), rest)

    def prepare(self) -> PreparedExperiment:
        """The same experiment with robot, motion and planner as objects.

        Raises:
            TemplateControlError: if one of them is not to be had, or they do not go together.
        """
        e = self.resolved()
        robot = e.robot.load() if isinstance(e.robot, RobotSpec) else e.robot
        assert isinstance(robot, Biped)
        if not e.free:
            _check_plane(robot, e)
        # Before the gait is looked for, which would compile a part of it alone.
        ready(COMPILED)
        motion, steps, velocity = e.motion, e.steps, None
        if isinstance(motion, VelocityProfile | VelocityCommand):
            velocity, motion = velocity_route(robot, motion, e.course)
        if isinstance(motion, GaitSpec):
            scale = e.tuning.qp.torque_scale
            if motion.apex_height is not None:
                check_apex(robot, motion.run_speed(robot), motion.apex_height, scale)
            gait = motion.of(robot, scale)
            if motion.from_stand or motion.to_stand:
                motion, steps = _with_stands(motion, gait, e), None
            else:
                motion = gait
        found: Gait | Route
        planner: Planner | Planners
        if isinstance(motion, Scenario | Route):
            if e.seed is not None:
                raise ParameterError("a seed does not go with a scenario or route: leave one out")
            found, planner = e._route(robot, motion)
            start = e.start
        else:
            found, planner = e._kept(motion, robot)
            start = e.start if e.seed is None else perturbed_start(found, e.seed)
        if e.strict:
            _check_strictly(found, planner)
        given = {f.name: getattr(e, f.name) for f in fields(e)}
        new = {"robot": robot, "motion": found, "planner": planner, "start": start, "steps": steps}
        changes = None if velocity is None or velocity is e.motion else e.motion
        rest = {"seed": None, "strict": False, "velocity": velocity, "changes": changes}
        return PreparedExperiment(**given | new | rest)

    def _kept(self, motion: Gait | None, robot: Biped) -> tuple[Gait, Planner]:
        """The gait that is kept, and its planner."""
        planner = self.planner
        if isinstance(planner, PlannerSpec):
            assert motion is not None
            made = _planner(planner, motion, robot)
            return made.gait if isinstance(made, AheadPlanner) else motion, made
        if not isinstance(planner, Planner):
            raise ParameterError("planners by kind of stride need a motion that is a route")
        if motion is not None and motion is not planner.gait:
            raise ParameterError("a planner keeps its own gait: leave the motion out")
        return planner.gait, planner

    def _route(self, robot: Biped, motion: Scenario | Route) -> tuple[Route, Planners]:
        """The route that is followed, and its planners."""
        planner = self.planner
        if isinstance(motion, Scenario):
            push_off = None if isinstance(planner, Mapping) else _pushes_off(planner)
            motion = robot_route(robot, motion, push_off)
        any_speed = isinstance(motion, SpeedRoute) or (
            isinstance(motion, ScenarioRoute) and motion.pushes_off
        )
        if planner is None and any_speed:
            planner = KINDS[self.tuning.kind].ahead
        if isinstance(planner, Mapping):
            return motion, planner
        if isinstance(planner, AheadOptions):
            speed, limits = first_speed(motion), walk_limits(robot)
            planner = AheadPlanner(motion.parameters, planner, speed, limits=limits)
        elif isinstance(planner, PlannerSpec):
            gait = walking_gait(motion.parameters, first_speed(motion))
            planner = _planner(planner, gait, robot)
        return motion, default_planners(motion, planner, standing=standing_options(robot))

    @checked
    def save(self, path: str | Path) -> Path:
        """Write it as TOML, :meth:`resolved`, every number included.

        Raises:
            RecordError: if the file cannot be written.
            ParameterError: if something in it can be given in Python only.
        """
        head = "# template-control walk --config FILE repeats this run; so does run, for a run.\n"
        return storage.write_text(path, head + settings.text(settings.to_table(self.resolved())))

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Experiment:
        """Read what :meth:`save` wrote, or a file that has only some of its keys.

        Raises:
            ParameterError: naming the file and the key, if it cannot be read, has an unknown key
                or a value of another type or out of its range.
        """
        return settings.read(Experiment, path)


@dataclass(frozen=True)
class PreparedExperiment(Experiment):
    """An experiment whose robot, motion and planner are objects.

    Attributes:
        robot: the model; its last update is overwritten by a run.
        motion: the gait that is kept, or the route.
        planner: of this gait, or of each kind of stride of this route.
        velocity: what the route's speed is of, a command that a run sets where the motion is a
            profile that is not foreseen; None: the course is the experiment's.
        changes: the profile that this command follows; None: it follows none.
    """

    robot: Biped
    motion: Gait | Route
    planner: Planner | Planners
    velocity: VelocityProfile | VelocityCommand | None = None
    changes: VelocityProfile | None = None

    def prepare(self) -> PreparedExperiment:
        """Itself."""
        return self

    def heading(self, time: float) -> Course:
        """Where a floating-base robot is to go at a ``time`` from the run's start [s]."""
        if self.velocity is None:
            return Course(self.course.side_speed, self.course.rate(time))
        return course_at(self.velocity, time, self.robot)

    @property
    def planners(self) -> Planners:
        """By kind of stride."""
        if isinstance(self.planner, Mapping):
            return self.planner
        return {self.planner.gait.stride: self.planner}

    @property
    def gait(self) -> Gait:
        """The gait that is kept, or of a route the first planner's."""
        return next(iter(self.planners.values())).gait

    @property
    def kept(self) -> Planner:
        """The planner of the gait that is kept.

        Raises:
            ParameterError: if a route is followed.
        """
        if isinstance(self.planner, Mapping):
            raise ParameterError("the motion is a route: give a gait to keep")
        return self.planner


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


def _check_plane(robot: Biped, e: Experiment) -> None:
    """Refuse what only a floating-base robot can have."""
    had = "has no course" if e.course != HeadingCommand() else ""
    if isinstance(e.motion, VelocityProfile) and any(any(row[2:]) for row in e.motion.velocities):
        had = "has no velocity to the left"
    if any(push.direction for push in e.pushes):
        had = "a push has a direction"
    if had:
        raise ParameterError(
            f"{robot.name} is held in its plane, and {had}: leave it out, or take a floating-base"
            " robot"
        )


def _with_stands(spec: GaitSpec, gait: WalkingGait | RunningGait, e: Experiment) -> Scenario:
    """A walk that begins or ends in a stand, as a scenario."""
    assert isinstance(gait, WalkingGait)  # a GaitSpec of a run has no stands
    if spec.from_stand and (e.start is not None or e.pose is not None):
        raise ParameterError("a start does not go with from stand: leave one out")
    speed, height, vertical = gait.vlo.tolist()
    stand = Segment("stand", duration=_STAND)
    walk = Segment("walk", speed=speed, steps=e.steps or STEPS)
    return Scenario(
        segments=(*(stand,) * spec.from_stand, walk, *(stand,) * spec.to_stand),
        parameters=gait.parameters,
        start=(speed, height, vertical),
        vlo=(height, vertical),
        apex_height=height,
        stand_height=STAND_HEIGHT * gait.parameters.rest_length,
        name=gait.name,
    )


def _pushes_off(planner: PlannerSpec | Planner | None) -> bool:
    if isinstance(planner, Planner):
        return planner.gait.stride == StrideKind.WALK_PUSH_OFF
    return isinstance(planner, AheadOptions)


def _planner(spec: PlannerSpec, gait: Gait, robot: Biped) -> Planner:
    """The planner of a gait."""
    if isinstance(spec, OwnPlanner):
        return spec.make(gait)
    if isinstance(gait, RunningGait) and isinstance(spec, RunningOptions):
        return RunningPlanner(gait, spec)
    if isinstance(gait, WalkingGait):
        if isinstance(spec, LqrOptions):
            return LqrPlanner(gait, spec)
        if isinstance(spec, ModifiedOptions):
            return ModifiedPlanner(gait, spec)
        if isinstance(spec, AheadOptions):
            speed, limits = float(gait.vlo[0]), walk_limits(robot)
            return AheadPlanner(gait.parameters, spec, speed, limits=limits)
    raise ParameterError(f"planner {spec.kind} does not plan gait {gait.name}: leave one out")


def _check_strictly(motion: Gait | Route, planner: Planner | Planners) -> None:
    """Refuse a walk that cannot be had as it is wanted."""
    ahead = next(iter(planner.values())) if isinstance(planner, Mapping) else planner
    if not isinstance(motion, ScenarioRoute) or not isinstance(ahead, AheadPlanner):
        raise ParameterError(
            "strict goes with a scenario that only walks, and with planner ahead: leave it out"
        )
    check_feasibility(motion, ahead)
