"""How a run goes: the world, the start, what disturbs it, and when it counts as a fall."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.ranges import Count, Index, NotNegative, Positive, Range
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.options import EmbeddingOptions
from template_control.errors import ParameterError
from template_control.estimation.imu import ImuOptions
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.plant.plant import Plant, check_world
from template_control.robot.start import Pose
from template_control.run.sensing import SensorOptions
from template_control.slip.similarity import tuned

_LONGEST_DELAY = 1.0  # [s]


Phase = Annotated[float, Range(0.0, 1.0)]
"""Share of a step's duration."""


@dataclass(frozen=True)
class Push(Checked):
    """A horizontal force on the trunk.

    Attributes:
        impulse: force times duration, forward positive [N s].
        step: number of the step in which the push begins; 0 is the first.
        phase: time from this step's VLO to the push, over the gait's step duration.
        duration: how long the force acts [s].
        direction: of a free robot, from forward to the left [rad].
    """

    impulse: float
    step: Index = 10
    phase: Phase = 0.0
    duration: Positive = 0.1
    direction: float = 0.0


@dataclass(frozen=True)
class FallOptions(Checked):
    """When a foot touches the ground, and when a robot counts as fallen.

    Attributes:
        contact_force: share of the weight that a foot must carry to count as touching. Less is
            the rattle of a contact solver.
        height: share of the template's rest length. A robot whose hips are nearer to the ground
            has fallen.
        thrown: multiple of sqrt(g l0). Where the base is said to move faster, the simulation or
            what is sensed of it has diverged.
        pitch: a trunk that leans further than this has fallen [rad].
        patience: number of the gait's step durations that may pass without a section.
    """

    contact_force: NotNegative = tuned(0.005)
    height: NotNegative = tuned(0.35)
    thrown: Positive = tuned(30.0)
    pitch: Positive = tuned(float(np.radians(60.0)))
    patience: Positive = tuned(4.0)


def check_pushes(pushes: tuple[Push, ...], steps: int) -> None:
    """Check that a run is long enough for its pushes.

    Args:
        pushes: of the run.
        steps: that it has at most.

    Raises:
        ParameterError: naming the push that would never come.
    """
    for push in pushes:
        if push.step >= steps:
            raise ParameterError(
                f"a push is in step {push.step}, and the run has steps 0 to {steps - 1}: give an"
                " earlier step or a longer run"
            )


TurningRate = Annotated[float, Range(-2.0, 2.0)]


@dataclass(frozen=True)
class HeadingCommand(Checked):
    """Where a free robot goes, and how wide it steps.

    Attributes:
        turning_rate: of the heading, to the left positive [rad/s].
        turns: times [s] and the turning rate [rad/s] from each of them on; the times rise.
        step_width: distance aside between left and right footholds [m]; None: the one of the
            embedding's options, by the robot's size.
    """

    turning_rate: TurningRate = 0.0
    step_width: Positive | None = None
    turns: tuple[tuple[NotNegative, TurningRate], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        times = [time for time, _ in self.turns]
        if sorted(set(times)) != times:
            raise ParameterError(f"HeadingCommand.turns has the times {times}: give rising ones")

    def rate(self, time: float) -> float:
        """Turning rate at a time [rad/s].

        Args:
            time: from the run's start [s].
        """
        return next((rate for at, rate in reversed(self.turns) if time >= at), self.turning_rate)


@dataclass(frozen=True)
class SimulationOptions(Checked):
    """How a run goes.

    Attributes:
        steps: largest number of steps from section to section. None: the run goes to the end of
            the route, or makes 50 steps where the route has no end.
        plant: the world; the type of its options says which. Or a plant of one's own: the run
            resets it, and leaves it open.
        embedding: the controller's tuning, of a free robot FreeOptions; None: the robot's own
            default, :meth:`tuning`.
        start: (3,) dx/dt, y, dy/dt to start in [m/s, m, m/s], dy/dt 0 at apex; None for the
            route's.
        pose: CoM and feet to start with; None: over the stance foot at VLO, and at apex with the
            feet where the gait has them. A stride in which one leg lands again and again needs it.
        pushes: disturbances.
        sensors: what the controller gets to know of the state: all of it, with noise; or what
            encoders, IMU and contacts make of it. The plant and the record have the true one.
        delay: from a measurement to the torques computed from it [s], a whole number of
            physics steps.
        record_every: keep every n-th sample.
        falls: when the robot counts as fallen.
        course: where a free robot goes; a planar one has none.

    Raises:
        ParameterError: if a value is of a wrong type or out of its range, the plant is none, the
            delay is not a whole number of physics steps up to 1 s, or a push comes after the
            last step.
    """

    steps: Count | None = None
    plant: PlantOptions | MujocoOptions | IdealOptions | Plant = field(default_factory=PlantOptions)
    embedding: EmbeddingOptions | FreeOptions | None = None
    start: tuple[float, float, float] | None = None
    pose: Pose | None = None
    pushes: tuple[Push, ...] = ()
    sensors: SensorOptions | ImuOptions = field(default_factory=SensorOptions)
    delay: NotNegative = 0.0
    record_every: Count = 1
    falls: FallOptions = field(default_factory=FallOptions)
    course: HeadingCommand = field(default_factory=HeadingCommand)

    def __post_init__(self) -> None:
        check_world(self.plant)
        super().__post_init__()
        if self.steps is not None:
            check_pushes(self.pushes, self.steps)
        step = self.plant.time_step
        whole = abs(self.delay / step - self.delay_ticks) < 1e-6
        if not (whole and self.delay <= _LONGEST_DELAY):
            raise ParameterError(
                f"delay is {self.delay!r} s: give a multiple of the time step, {step:g} s, from 0"
                f" to {_LONGEST_DELAY:g} s"
            )

    def tuning(self, free: bool) -> EmbeddingOptions:
        """The controller's tuning, the given one or the robot's own.

        Args:
            free: whether nothing holds the robot.
        """
        return self.embedding or (FreeOptions() if free else EmbeddingOptions())

    def for_robot(self, free: bool) -> SimulationOptions:
        """These options with the tuning that is used.

        Args:
            free: whether nothing holds the robot.
        """
        return replace(self, embedding=self.tuning(free))

    @property
    def delay_ticks(self) -> int:
        """The delay in physics steps."""
        return round(self.delay / self.plant.time_step)
