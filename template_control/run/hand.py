"""The hand on a run: pushes, friction and velocity, planned or while it goes."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from math import cos, sin
from typing import Any

from template_control.checks.fitting import check
from template_control.checks.ranges import Positive
from template_control.errors import ParameterError
from template_control.plant.plant import Plant
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.run.experiment import PreparedExperiment
from template_control.run.options import Push
from template_control.run.velocity import Velocity, VelocityCommand, check_direction


def plant_force(robot: Biped, along: float, lateral: float) -> tuple[float, ...]:
    """A push, forward and to the left [N], as the robot's plant takes it after the torques.

    What holds a planar robot bears what is lateral; else it is along the world's x and y, and
    forward is the heading.
    """
    if not isinstance(robot, FloatingBaseBiped):
        return (along,)
    cosine, sine = cos(robot.heading), sin(robot.heading)
    return cosine * along - sine * lateral, sine * along + cosine * lateral


class Hand:
    """Acts on a run from outside: what its experiment plans, and what is asked while it goes.

    :meth:`push`, :meth:`set_friction` and :meth:`set_velocity` may be called by any thread; what
    they ask for begins with the next tick, and is kept with its time.

    Args:
        o: the experiment.
        plant: the world that it runs in.

    Raises:
        ParameterError: if the friction is to change and the plant cannot change it.

    Attributes:
        pushes: planned and asked for.
        frictions: times [s] and the friction from each of them on.
        velocities: times [s] and the velocity from each of them on, as of a
            :class:`~.velocity.VelocityProfile`; empty where no velocity is commanded.
        friction: of the ground now; None where the plant has none that is known.
        idle: whether nothing is to be done in any tick, as far as is known.
    """

    def __init__(self, o: PreparedExperiment, plant: Plant) -> None:
        self._plant, self._robot = plant, o.robot
        self._command = o.velocity if isinstance(o.velocity, VelocityCommand) else None
        self._changes = o.changes
        self.pushes = list(o.pushes)
        self.frictions = list(o.frictions)
        self.velocities: list[tuple[float, float, float, float]] = []
        self.friction: float | None = getattr(o.world, "friction", None)
        if self.frictions:
            self._check_friction()
        self._coming = list(self.pushes)  # not over yet
        self._slippery = deque(self.frictions)
        self._asked: deque[Any] = deque()
        self._velocity: Velocity | None = None  # as it was last looked at
        self.idle = not (self.pushes or self.frictions or self._command)

    def push(self, impulse: float, duration: float = 0.1, direction: float = 0.0) -> None:
        """Push the trunk.

        Arguments as for :class:`~.options.Push`.

        Raises:
            ParameterError: if a number is out of its range, or a planar robot is to be pushed
                elsewhere than forward or backward.
        """
        if direction and not isinstance(self._robot, FloatingBaseBiped):
            raise ParameterError(
                f"{self._robot.name} is held in its plane: push it forward or backward"
            )
        self._ask(Push(impulse, duration=duration, direction=direction, time=0.0))

    def set_friction(self, friction: float) -> None:
        """Change the Coulomb ``friction`` between feet and ground; the controller does not know it.

        Raises:
            ParameterError: if it is not positive, or the plant cannot change it.
        """
        self._check_friction()
        self._ask(check("the friction", friction, Positive, ParameterError))

    def set_velocity(self, forward: float, left: float = 0.0, turning: float = 0.0) -> None:
        """Want another velocity; it holds from the next VLO on.

        Arguments as for :class:`~template_control.run.VelocityCommand`; a planar robot has only
        the first.

        Raises:
            ParameterError: if the motion is no :class:`~.velocity.VelocityCommand`, a number is out
                of its range, or the robot cannot go there.
        """
        if self._command is None or self._changes is not None:
            raise ParameterError(
                "the run's motion is not commanded: give its experiment a VelocityCommand"
            )
        check_direction(self._robot, self._command.gaits, forward, left, turning)
        self._ask(VelocityCommand(forward, left, turning).at(0.0))

    def _ask(self, deed: Any) -> None:
        self._asked.append(deed)
        self.idle = False

    def act(self, now: float) -> None:
        """Do what is due before the tick at a time ``now`` from the run's start [s]."""
        while self._slippery and self._slippery[0][0] <= now:
            self._change_friction(self._slippery.popleft()[1])
        while self._asked:
            asked = self._asked.popleft()
            if isinstance(asked, Push):
                push = replace(asked, time=now)
                self.pushes.append(push)
                self._coming.append(push)
            elif isinstance(asked, tuple):
                assert self._command is not None
                self._command.set(*asked)
            else:
                self.frictions = sorted({**dict(self.frictions), now: asked}.items())
                self._change_friction(asked)
        if self._command is not None:
            self._follow(self._command, now)

    def _follow(self, command: VelocityCommand, now: float) -> None:
        """Set a command that follows a profile, and keep what is new."""
        if self._changes is not None and (wanted := self._changes.at(now)) != command.at(now):
            command.set(*wanted)
        velocity = command.at(now)
        if velocity != self._velocity:
            self._velocity = velocity
            self.velocities.append((now, *velocity))

    def force(self, now: float, begun: Sequence[tuple[float, float]]) -> tuple[float, float]:
        """Force of the pushes that act at a tick, forward and to the left [N].

        Args:
            now: time since the run's start [s].
            begun: when each step began, and the duration of its gait's steps [s].
        """
        along = lateral = 0.0
        for push in list(self._coming):
            begin = push.begins(begun)
            if begin is not None and now >= begin + push.duration:
                self._coming.remove(push)
            elif begin is not None and now >= begin:
                ahead, left = push.force()
                along, lateral = along + ahead, lateral + left
        return along, lateral

    def _check_friction(self) -> None:
        if not hasattr(self._plant, "set_friction"):
            raise ParameterError(
                f"{type(self._plant).__name__} cannot change its friction while a run goes on: give"
                " it a method set_friction, or take PyBullet or MuJoCo"
            )

    def _change_friction(self, friction: float) -> None:
        self.friction = friction
        self._plant.set_friction(friction)  # type: ignore[attr-defined]
