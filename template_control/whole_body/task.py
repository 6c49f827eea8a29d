"""Interface of tasks, their references, and the stack of rows that they write.

A task asks for accelerations of some quantities y(q), one row each: with the Jacobian T of y,
the QP minimises weight * (T a + dT/dt v - desired)^2, equation (45), where ``desired`` holds the
feedforward and the PD feedback.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import blame, name_of
from template_control.errors import ParameterError
from template_control.robot.biped import Biped

Array = NDArray[np.float64]

BIAS, DESIRED, WEIGHT = 0, 1, 2
"""Columns of a row behind its (nv,) Jacobian."""


@dataclass
class References:
    """References and measurements in one place; the controller overwrites them at every tick.

    Attributes:
        com: (6,) wanted x, y of the CoM, their first and their second derivatives, in a frame
            at the template's rear toe [m, m/s, m/s^2].
        com_now: (4,) the robot's x, y, dx/dt, dy/dt in that frame. dx/dt is the speed that
            the phase senses: with the angular momentum about the CoM, or without.
        com_push: horizontal acceleration added to the feedforward [m/s^2].
        pitch: wanted angle of the trunk [rad].
        pitch_now: (2,) its angle and rate [rad, rad/s].
        feet: the foot that is the rear leg's, and the front leg's.
        foot: (2, 2, 3) of each foot: x and y, each wanted position, velocity, acceleration, in
            the world [m, m/s, m/s^2].
        side: (2, 3) of each foot of a floating-base robot: y, to the left, as ``foot`` in its
            heading frame.
        furthest: (2,) largest x that each foot may be moved to, so that its leg does not go
            straight [m].
        hip_speed: forward speed of the hips [m/s].
    """

    com: Array = field(default_factory=lambda: np.zeros(6))
    com_now: Array = field(default_factory=lambda: np.zeros(4))
    com_push: float = 0.0
    pitch: float = 0.0
    pitch_now: Array = field(default_factory=lambda: np.zeros(2))
    feet: tuple[int, int] = (0, 1)
    foot: Array = field(default_factory=lambda: np.zeros((2, 2, 3)))
    side: Array = field(default_factory=lambda: np.zeros((2, 3)))
    furthest: Array = field(default_factory=lambda: np.full(2, np.inf))
    hip_speed: float = 0.0


class Rows(NamedTuple):
    """Where a task writes its r rows; views into the stack.

    Attributes:
        jacobian: (r, nv) T.
        bias: (r,) dT/dt v.
        desired: (r,) wanted accelerations.
        weight: (r,) the task's ``weights``; one whose rows have a changing unit scales them by it.
        table: (r, nv + 3) all of them, for compiled code; columns as in :class:`TaskStack`.
    """

    jacobian: Array
    bias: Array
    desired: Array
    weight: Array
    table: Array


class Task(Protocol):
    """Rows of the whole-body QP; a small frozen dataclass of weight and gains."""

    @property
    def weights(self) -> tuple[float, ...]:
        """One weight a row."""

    def write(self, robot: Biped, references: References, rows: Rows) -> None:
        """Fill the task's rows.

        Args:
            robot: the model, updated to this tick.
            references: references and measurements of this tick.
            rows: views of the task's own rows, overwritten; entries that it never writes are 0.
        """


def task_name(task: Task) -> str:
    """Name of a task in options: its class's without "Task", as in ``side_foot``.

    Args:
        task: of a phase.
    """
    name = type(task).__name__.removesuffix("Task")
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


class TaskStack:
    """The rows of a phase's tasks, one below the other.

    Args:
        tasks: in order.
        nv: degrees of freedom of the robot.

    Attributes:
        table: (r, nv + 3) one row of T, bias, desired and weight each.
    """

    def __init__(self, tasks: Sequence[Task], nv: int) -> None:
        weights = [weight for task in tasks for weight in task.weights]
        self.table: Array = np.zeros((len(weights), nv + 3))
        self.table[:, nv + WEIGHT] = weights
        self._parts: list[tuple[Task, Rows]] = []
        first = 0
        for task in tasks:
            part = self.table[first : first + len(task.weights)]
            first += len(part)
            bias, desired, weight = (part[:, nv + i] for i in (BIAS, DESIRED, WEIGHT))
            rows = Rows(part[:, :nv], bias, desired, weight, part)
            self._parts.append((task, rows))

    def write(self, robot: Biped, references: References) -> None:
        """Let every task fill its rows of the table.

        Args:
            robot: the model, updated to this tick.
            references: references and measurements of this tick.
        """
        for task, rows in self._parts:
            try:
                task.write(robot, references, rows)
            except Exception as error:  # where nothing is raised this costs no time
                blame(error, task.write)

    def check_finite(self) -> None:
        """Check what the tasks have written last.

        Raises:
            ParameterError: naming the task's class, if a number is not finite.
        """
        if isfinite(self.table.sum()):
            return
        for task, rows in self._parts:
            if not np.isfinite(rows.table).all():
                raise ParameterError(
                    f"{name_of(task.write)} wrote a number that is not finite: write finite ones"
                )
