"""Stack of the rows of a phase's tasks."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np

from template_control.arrays import Array
from template_control.checks.fitting import blame, name_of
from template_control.errors import ParameterError
from template_control.robot.robot import Robot
from template_control.whole_body.task import BIAS, DESIRED, WEIGHT, References, Rows, Task
from template_control.whole_body.task_rows import TASK, write_rows
from template_control.whole_body.tasks import CompiledTask, ComTask


class TaskStack:
    """The rows of a phase's tasks, one below the other.

    Args:
        tasks: in order.
        nv: degrees of freedom of the robot.

    Attributes:
        table: (r, nv + 3) one row of T, bias, desired and weight each.
        program: (n,) of ``TASK``: the tasks that compiled code writes.
        others: the other tasks, and their rows.
    """

    def __init__(self, tasks: Sequence[Task], nv: int) -> None:
        weights = [weight for task in tasks for weight in task.weights]
        self.table: Array = np.zeros((len(weights), nv + 3))
        self.table[:, nv + WEIGHT] = weights
        self._parts: list[tuple[Task, Rows]] = []
        self.others: list[tuple[Task, Rows]] = []
        program, first = [np.zeros(0, TASK)], 0
        for task in tasks:
            part = self.table[first : first + len(task.weights)]
            bias, desired, weight = (part[:, nv + i] for i in (BIAS, DESIRED, WEIGHT))
            rows = Rows(part[:, :nv], bias, desired, weight, part)
            self._parts.append((task, rows))
            if isinstance(task, CompiledTask) and type(task).write is CompiledTask.write:
                program.append(task.compiled(first))
            else:
                self.others.append((task, rows))
            first += len(part)
        self.program = np.concatenate(program)
        self.follows_com = bool((self.program["kind"] == ComTask.kind).any())

    def check(self, robot: Robot) -> None:
        """Check that a robot has what the tasks speak of.

        Raises:
            ParameterError: if it is no biped, or held in its plane and a task is one in space.
        """
        for task, _ in self._parts:
            if isinstance(task, CompiledTask):
                task.check(robot)

    def write(self, robot: Robot, references: References | None = None) -> None:
        """Let every task fill its rows of the table.

        Args:
            robot: the model, updated to this tick.
            references: references and measurements of this tick; None where all tasks have
                targets of their own.

        Raises:
            ParameterError: if a task has not what it needs.
        """
        self.check(robot)
        if len(self.program):
            if references is None:
                raise ParameterError("a task of these follows References, and none are given")
            write_rows(self.program, robot.data, robot.arrays, references.data, self.table)
        self.write_others(robot, references)

    def write_others(self, robot: Robot, references: References | None) -> None:
        """As :meth:`write`, of the tasks that compiled code does not write."""
        for task, rows in self.others:
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
