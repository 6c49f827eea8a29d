"""What a task is, and the stack of rows that several of them write.

A task asks for accelerations of some quantities y(q), one row each: with the Jacobian T of y,
the QP minimises weight * (T a + dT/dt v - desired)^2, equation (45), where ``desired`` holds the
feedforward and the PD feedback.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.checks.asking import blame, name_of
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.whole_body.wanted import Wanted

Array = NDArray[np.float64]

BIAS, DESIRED, WEIGHT = 0, 1, 2
"""Columns of a row behind its (nv,) Jacobian."""


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

    def write(self, robot: Biped, wanted: Wanted, rows: Rows) -> None:
        """Fill the task's rows.

        Args:
            robot: the model, updated to this tick.
            wanted: references and measurements of this tick.
            rows: views of the task's own rows, overwritten; entries that it never writes are 0.
        """


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

    def write(self, robot: Biped, wanted: Wanted) -> None:
        """Let every task fill its rows of the table.

        Args:
            robot: the model, updated to this tick.
            wanted: references and measurements of this tick.
        """
        for task, rows in self._parts:
            try:
                task.write(robot, wanted, rows)
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
