"""Tuning of the embedding, for the reference template."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Annotated, Any, ClassVar, NamedTuple

from template_control.checks.ranges import Range
from template_control.embedding.lean import LeanOptions
from template_control.embedding.modes import GuardOptions
from template_control.embedding.phases import PHASES, PhaseControl, Phases
from template_control.embedding.planners.ahead import AheadOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.swing import SwingOptions
from template_control.errors import ParameterError, meant
from template_control.estimation.contacts import ContactOptions
from template_control.estimation.delay import DelayOptions
from template_control.estimation.friction import FrictionOptions
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.similarity import tuned
from template_control.whole_body.solver import QpOptions
from template_control.whole_body.task import Task, task_name


class Planning(NamedTuple):
    """Planners' tuning for a kind of robot.

    ``walks_ahead``: whether a walk that is kept is planned ahead; ``bears``: whether its feet bear
    the centre of pressure around them.
    """

    lqr: LqrOptions
    ahead: AheadOptions
    walks_ahead: bool = False
    bears: bool = False


@dataclass(frozen=True)
class EmbeddingOptions(QpOptions):
    """Tuning of the embedding for the reference template (80 kg, 1 m, 9.81 m/s^2).

    The controller scales it to its gait's template by dynamic similarity. The fields of
    :class:`~template_control.whole_body.solver.QpOptions` come first.

    Attributes:
        trunk_pitch: where the trunk is held [rad].
        phases: tasks, clock, feet and learners of each phase.
        tasks: numbers of the phases' tasks by name, such as ``{"com": {"gains": (80.0, 18.0)}}``
            in all phases, or under ``"SS.com"`` in one phase or node: see :meth:`phase_table`.
        guards: when a touchdown or a liftoff has happened.
        swing: shape of the swings; None: high in steady strides where the robot's legs are light
            enough.
        contacts: when a contact flag is believed, and when a foot has met a wall.
        replan: when a stride is planned anew.
        catches: whether a walk breaks into another stride where it cannot go on, kept or of a
            scenario: a run where it is too fast, a stand where it is too slow.
        lean: how far the trunk leans in strides that do not keep ``trunk_pitch``.
        delay: how the delay from measurement to torque is learnt and compensated, where a planar
            robot's whole state is measured; a run reads it, not the controller.
        slides: how it is learnt that the ground is more slippery than ``friction`` says.
    """

    kind: ClassVar[str] = "planar"
    planning: ClassVar[Planning] = Planning(LqrOptions(), AheadOptions())

    trunk_pitch: Annotated[float, Range(-1.5, 1.5)] = tuned(0.0)
    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(PHASES))
    tasks: Mapping[str, Mapping[str, float | tuple[float, ...]]] = field(default_factory=dict)
    guards: GuardOptions = field(default_factory=GuardOptions)
    swing: SwingOptions | None = None
    contacts: ContactOptions = field(default_factory=ContactOptions)
    replan: ReplanOptions = field(default_factory=ReplanOptions)
    catches: bool = tuned(True)
    lean: LeanOptions = field(default_factory=LeanOptions)
    delay: DelayOptions = field(default_factory=DelayOptions)
    slides: FrictionOptions = field(default_factory=FrictionOptions)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tasks:
            self.phase_table()  # which refuses what no task has

    def phase_table(self) -> Phases:
        """The table of phases, its tasks with the numbers of ``tasks``.

        A task's name is its class's without "Task", in lower case: com, foot, posture, momentum,
        orientation, side_foot, spare_joint. The keys of its numbers are its fields'.

        Raises:
            ParameterError: if no phase has such a task, or a task has no such number.
        """
        table = dict(self.phases)
        for name, numbers in self.tasks.items():
            where, _, wanted = name.rpartition(".")
            met = False
            for key, control in table.items():
                node = key.name if isinstance(key, Phase) else key
                if where not in ("", node, node.partition("_")[0]):
                    continue
                tasks = tuple(
                    _with_numbers(task, numbers, f"{type(self).__name__}.tasks.{name}")
                    if task_name(task) == wanted
                    else task
                    for task in control.tasks
                )
                met |= wanted in map(task_name, control.tasks)
                table[key] = replace(control, tasks=tasks)
            if not met:
                known = sorted({task_name(t) for control in table.values() for t in control.tasks})
                raise ParameterError(
                    f"{type(self).__name__}.tasks.{name} is no task of a phase: give one of"
                    f" {', '.join(known)}, or PHASE.TASK"
                )
        return table


def _with_numbers(task: Task, numbers: Mapping[str, Any], where: str) -> Task:
    """A task with some of its numbers replaced."""
    names: list[str] = [f.name for f in fields(task)] if is_dataclass(task) else []
    known = [name for name in names if name not in ("leg", "contact")]
    for name in numbers:
        if name not in known:
            near = meant(name, known)
            raise ParameterError(f"unknown key {where}.{name}{near}: known are {', '.join(known)}")
    try:
        return replace(task, **numbers)  # type: ignore[type-var]
    except ParameterError as error:
        text = str(error).replace(f"{type(task).__name__}.", f"{where}.")
        raise ParameterError(text) from None
