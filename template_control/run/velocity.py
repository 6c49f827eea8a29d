"""Velocity commands: forward, and of a floating base to the left, and turning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, hypot, nan, pi
from typing import ClassVar

import numpy as np

from template_control.checks.checked import Checked, checked
from template_control.checks.fitting import check
from template_control.checks.ranges import NotNegative, Positive
from template_control.embedding.free.motion import Course
from template_control.embedding.options import RobotKind, robot_kind
from template_control.errors import GaitError, ParameterError
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.template import (
    can_run,
    can_stand,
    default_gait,
    template_for,
    walking_speeds,
)
from template_control.run.options import ForwardSpeed, HeadingCommand, SideSpeed, TurningRate
from template_control.run.specs import SOLE_RUN
from template_control.slip.gaits.walking_by_speed import gaits_by_speed
from template_control.slip.scenario.scenario import Gait
from template_control.slip.scenario.speed_route import GaitChangeOptions, SpeedRoute
from template_control.slip.similarity import Scale

_FASTEST_RUN = 0.96  # over sqrt(g l0): 3 m/s for l0 = 1 m, where five-link has run 1000 steps
_FASTEST_WALK = 0.38
"""Mean speed over sqrt(g l0) above which a floating base that can run no longer walks: it has the
room to turn and to step to the left there."""

_SLOWEST: Mapping[RobotKind, float] = {
    "planar": 0.0,
    # A slower step lasts longer than 2 sqrt(l0 / g), and what is off to the side grows by nearly
    # tenfold in it. Bolt fell on its way down to 0.24 in 3 of 12 trials, at 0.2 as it turned, and
    # at 0.16 straight on.
    "free": 0.27,
    # Here the family's slow gaits begin, with other legs and steps a quarter shorter. On its way
    # down to them G1 fell, as it turned or went sideways.
    "soles": 0.15,
    "trot": 0.19,  # with slower walks Go2 fell as it turned
}
"""Mean speed over sqrt(g l0) of the slowest walk that a kind of robot is commanded."""

_FASTEST_ON_SOLES = 0.31
"""The same of the fastest walk on flat feet: G1 keeps 0.79 m/s for a minute, and falls after 80
steps of 0.9 m/s, in whose swings its hips are at the end of their range."""

_TAKE_OFF_ON_SOLES = 0.27  # dx/dt over sqrt(g l0) at the VLO where their runs begin: G1 ran with it

Velocity = tuple[float, float, float]
"""Forward and to the left [m/s], and turning to the left [rad/s], in the heading frame."""


_BACKWARD = 0.19
"""Fastest mean speed backward over sqrt(g l0): 0.6 m/s for l0 = 1 m, as planar robots walked."""

# Bolt and five-link-3d kept them, and changes between them, for 40 s.
_LEFT = 0.03  # of sqrt(g l0)
_TURNING = 0.1  # of sqrt(g / l0)


@dataclass(frozen=True)
class VelocityProfile(Checked):
    """Velocities by time, each kept until the next; those of a planar robot are forward.

    The motion of an :class:`~template_control.run.Experiment`: the robot moves at any speed of its
    gaits. Footholds and heading follow from one step to the next; the forward speed
    changes as fast as the planner finds steps. Robots that can stand go backward too, at a
    negative speed: they stop, and start the other way. Those that cannot hop below their slowest
    walk, if run is among their gaits: slowly forward, on the spot and backward.

    Attributes:
        velocities: times, rising from 0 [s], each with the mean velocity forward and to the left
            [m/s], and the turning rate to the left [rad/s].
        duration: of the run [s]; None: the profile does not end the run.
        foreseen: whether a step is planned for the velocity that is wanted at its end. If not, the
            robot learns of a velocity when its time has come, as from a :class:`VelocityCommand`.
        gaits: that the robot may have, of which the forward velocity chooses one as
            :class:`~template_control.SpeedRoute` does.
        changes: of the gait.

    Raises:
        ParameterError: if the first time is not 0, or the times do not rise.
    """

    kind: ClassVar[str] = "velocity"

    velocities: tuple[tuple[NotNegative, ForwardSpeed, SideSpeed, TurningRate], ...]
    duration: Positive | None = None
    foreseen: bool = True
    gaits: tuple[Gait, ...] = ("walk",)
    changes: GaitChangeOptions = field(default_factory=GaitChangeOptions)

    def __post_init__(self) -> None:
        super().__post_init__()
        times = [row[0] for row in self.velocities]
        if not times or times[0] != 0.0 or sorted(set(times)) != times:
            raise ParameterError(
                f"VelocityProfile.velocities has the times {times}: give rising ones, the first 0"
            )

    def at(self, time: float) -> Velocity:
        """The velocity wanted at a ``time`` from the run's start [s]."""
        return next(row[1:] for row in reversed(self.velocities) if time >= row[0])


class VelocityCommand:
    """A velocity that may be set at any time; of a planar robot it is forward.

    The motion of an :class:`~template_control.run.Experiment` without an end. What is set holds
    from the next section on.

    Args:
        forward: mean velocity ahead [m/s].
        left: to the left [m/s].
        turning: rate of the heading, to the left [rad/s].
        gaits, changes: as of a :class:`VelocityProfile`.
    """

    @checked
    def __init__(
        self,
        forward: float,
        left: float = 0.0,
        turning: float = 0.0,
        *,
        gaits: tuple[Gait, ...] = ("walk",),
        changes: GaitChangeOptions | None = None,
    ) -> None:
        self.gaits, self.changes = gaits, changes or GaitChangeOptions()
        self.set(forward, left, turning)

    def set(self, forward: float, left: float = 0.0, turning: float = 0.0) -> None:
        """Want another velocity from now on.

        As :class:`VelocityCommand`. A ParameterError if a number is out of its range; the velocity
        stays.
        """
        self._velocity: Velocity = (
            check("the commanded forward speed", forward, ForwardSpeed, ParameterError),
            check("the commanded speed to the left", left, SideSpeed, ParameterError),
            check("the commanded turning rate", turning, TurningRate, ParameterError),
        )

    def __repr__(self) -> str:
        forward, left, turning = self._velocity
        gaits = ", ".join(self.gaits)
        return f"<VelocityCommand {forward:g} m/s, left {left:g} m/s, {turning:g} rad/s: {gaits}>"

    def at(self, time: float) -> Velocity:
        """The present velocity, whatever the ``time`` [s]."""
        return self._velocity


@dataclass(frozen=True)
class VelocityRange:
    """Velocities that a robot can be commanded.

    Attributes:
        speeds: slowest and fastest mean speed forward [m/s].
        first: speed of its own walk, or the nearest in this range [m/s].
        left: largest speed to the left and to the right [m/s]; 0 of a planar robot.
        turning: largest rate of the heading to both sides [rad/s]; 0 of a planar robot.
        stands: whether it can stand, at the speed 0.
        backward: fastest mean speed backward [m/s]; 0 of one that can neither stand in between nor
            hop.
        run: fastest speed of its runs [m/s]; 0 where it does not run.
    """

    speeds: tuple[float, float]
    first: float
    left: float = 0.0
    turning: float = 0.0
    stands: bool = True
    run: float = 0.0
    backward: float = 0.0

    @classmethod
    def of(cls, robot: Biped) -> VelocityRange:
        """The velocities of a ``robot``, to a centimetre per second; its update is overwritten."""
        p = template_for(robot)
        unit = p.speed_unit
        try:
            low, high = walking_speeds(robot)
        except GaitError:
            low, high = gaits_by_speed(p).speeds
        low = max(low, _SLOWEST[robot_kind(robot)] * unit)
        if robot.patches:
            high = min(high, _FASTEST_ON_SOLES * unit)
        speeds = float(np.ceil(100.0 * low)) / 100.0, float(np.floor(100.0 * high)) / 100.0
        first = min(max(round(default_gait(robot).mean_speed, 2), speeds[0]), speeds[1])
        run = round(_FASTEST_RUN * unit, 2) if can_run(robot) else 0.0
        stands = can_stand(robot)
        backward = round(_BACKWARD * unit, 2) if stands or run else 0.0
        left, turning = round(_LEFT * unit, 2), round(_TURNING * p.gravity / unit, 2)
        if not isinstance(robot, FloatingBaseBiped):
            left = turning = 0.0
        return cls(speeds, first, left, turning, stands, run, backward)

    @property
    def gaits(self) -> tuple[Gait, ...]:
        """Gaits of a command in this range."""
        have: dict[Gait, bool] = {"stand": self.stands, "walk": True, "run": self.run > 0.0}
        return tuple(gait for gait, has in have.items() if has)


def course_at(velocity: VelocityProfile | VelocityCommand, time: float, robot: Biped) -> Course:
    """Where a robot is to go at a time [s].

    One on pairs of feet, or held in its plane, goes along the velocity, and its trunk faces
    elsewhere. One on two flat feet goes so backward only: to the left it places its feet. One on
    two points hops backward.
    """
    forward, left, turning = velocity.at(time)
    if not _places(robot):
        return Course(0.0, turning, -atan2(left, forward) if forward or left else nan)
    if forward < 0.0 and can_stand(robot):
        return Course(-left, turning, pi)
    return Course(left, turning, 0.0 if forward else nan)


def _places(robot: Biped) -> bool:
    """Whether a robot goes to the left by where it places its feet, and along its course else."""
    return isinstance(robot, FloatingBaseBiped) and not robot.paired


def _hops(robot: Biped, gaits: Sequence[Gait]) -> bool:
    """Whether a robot with these gaits hops where others stand, or stop to go backward."""
    return "run" in gaits and not can_stand(robot)


def check_direction(
    robot: Biped, gaits: Sequence[Gait], forward: float, left: float, turning: float
) -> None:
    """Check that a robot with these gaits can go in the direction of a velocity."""
    if not isinstance(robot, FloatingBaseBiped) and (left or turning):
        raise ParameterError(
            f"{robot.name} is held in its plane: command it only forward or backward"
        )
    if forward >= 0.0 or _hops(robot, gaits):
        return
    if not can_stand(robot):
        raise ParameterError(
            f"{robot.name} does not go backward, as it cannot stand in between: give it run among"
            " its gaits, to hop, or command it a speed of 0 or more"
        )
    if "stand" not in gaits:
        raise ParameterError(
            f"{robot.name} stands before it goes backward: give it stand among its gaits, or"
            " command it a speed of 0 or more"
        )


def velocity_route(
    robot: Biped, motion: VelocityProfile | VelocityCommand, course: HeadingCommand
) -> tuple[VelocityProfile | VelocityCommand, SpeedRoute]:
    """Route at the forward speeds of a motion, and the velocities that it and the heading read.

    These are the motion's, or where it is not foreseen those of a command, which the run sets. A
    ParameterError if the course has a velocity too, or the robot cannot go where it is to.
    """
    if course.turning_rate or course.turns or course.side_speed:
        raise ParameterError("a course does not go with velocities, which turn: leave one out")
    foreseen = isinstance(motion, VelocityCommand) or motion.foreseen
    velocity = motion if foreseen else VelocityCommand(*motion.at(0.0))
    planar = not isinstance(robot, FloatingBaseBiped)
    template, changes = template_for(robot), motion.changes
    slowest = _SLOWEST[robot_kind(robot)] * template.speed_unit

    def forward(time: float) -> float:
        speed, *others = velocity.at(time)
        check_direction(robot, motion.gaits, speed, *others)
        if course_at(velocity, time, robot).turns_round(robot):
            return 0.0
        if changes.hop and speed < slowest:
            return speed
        wanted = abs(speed) if _places(robot) else hypot(speed, others[0])
        stands = "stand" in motion.gaits and wanted < 0.5 * slowest
        return 0.0 if stands else max(wanted, slowest)

    if "stand" in motion.gaits and not can_stand(robot):
        raise ParameterError(
            f"{robot.name} cannot stand on two feet that are points: leave stand out of its gaits"
        )
    if "run" in motion.gaits:
        walk = _FASTEST_ON_SOLES if robot.patches else _FASTEST_WALK
        fastest = walking_speeds(robot)[1] if planar else walk * template.speed_unit
        unit = Scale.of(template).speed
        hop = slowest / unit if _hops(robot, motion.gaits) else 0.0
        changes = replace(changes, run=min(changes.run, fastest / unit), hop=hop)
        if robot.patches:
            reference = template.speed_unit / unit
            changes = replace(
                changes,
                take_off=min(changes.take_off, _TAKE_OFF_ON_SOLES * reference),
                fastest=min(changes.fastest, SOLE_RUN * reference),
            )
    duration = getattr(motion, "duration", None)
    bears = robot.half_length > 0.0
    return velocity, SpeedRoute(template, forward, duration, motion.gaits, changes, bears=bears)
