"""Tuning of the embedding for the reference template, by kind of robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from template_control.checks.checked import Checked
from template_control.checks.ranges import Range
from template_control.embedding.free.phases import FREE_PHASES, SOLE_PHASES, TROT_PHASES
from template_control.embedding.lean import LeanOptions
from template_control.embedding.modes import GuardOptions
from template_control.embedding.phases import PHASES, PhaseControl, Phases
from template_control.embedding.planners.ahead import BIPED_AHEAD, FREE_AHEAD, AheadOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.swing import SwingOptions
from template_control.errors import ParameterError, meant
from template_control.estimation.contacts import ContactOptions
from template_control.estimation.delay import DelayOptions
from template_control.estimation.filters import NoiseFilterOptions
from template_control.estimation.friction import FrictionOptions
from template_control.robot.biped import Biped
from template_control.robot.terms import LEGS, UP
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.lateral.gait import LateralOptions
from template_control.slip.similarity import tuned
from template_control.whole_body.solver import QpOptions
from template_control.whole_body.task import Task, task_name

RobotKind = Literal["planar", "free", "soles", "trot"]
"""Held in its plane; with a floating base on point feet, on flat feet, on four legs."""


@dataclass(frozen=True)
class EmbeddingOptions(Checked):
    """Tuning of the embedding for the reference template (80 kg, 1 m, 9.81 m/s^2).

    The controller scales it to its gait's template by dynamic similarity. The defaults are those of
    a planar robot; :meth:`of_kind` has those of the others.

    Attributes:
        kind: of robot that it is for.
        qp: motors and ground as the QP knows them, and its regularisation.
        trunk_pitch: where the trunk is held [rad].
        phases: tasks, clock, feet and learners of each phase; None: those of the kind.
        tasks: numbers of the phases' tasks by name, such as ``{"com": {"gains": (80.0, 18.0)}}``
            in all phases, or under ``"SS.com"`` in one phase or node: see :meth:`phase_table`.
        guards: when a touchdown or a liftoff has happened.
        swing: shape of the swings; None: high in a planar robot's steady strides where its legs
            are light enough, and by the hips' speed on flat feet.
        contacts: when a contact flag is believed, and when a foot has met a wall.
        replan: when a stride is planned anew.
        catches: whether a walk breaks into another stride where it cannot go on, kept or of a
            scenario: a run where it is too fast, a stand where it is too slow.
        lean: how far the trunk leans in strides that do not keep ``trunk_pitch``.
        delay: how the delay from measurement to torque is learnt and compensated, where a planar
            robot's whole state is measured; a run reads it, not the controller.
        slides: how it is learnt that the ground is more slippery than ``qp.friction`` says.
        lateral: how a floating-base robot's feet are placed sideways; None of a planar robot.
        noise_filter: of a floating-base robot's state that is measured with noise; None: it is
            taken as it is measured.
    """

    old_keys: ClassVar = {f.name: f"qp.{f.name}" for f in fields(QpOptions)} | {
        "step_width": "lateral.step_width"
    }

    kind: RobotKind = "planar"
    qp: QpOptions = field(default_factory=QpOptions)
    trunk_pitch: Annotated[float, Range(-1.5, 1.5)] = tuned(0.0)
    phases: Mapping[Phase | str, PhaseControl] | None = None
    tasks: Mapping[str, Mapping[str, float | tuple[float, ...]]] = field(default_factory=dict)
    guards: GuardOptions = field(default_factory=GuardOptions)
    swing: SwingOptions | None = None
    contacts: ContactOptions = field(default_factory=ContactOptions)
    replan: ReplanOptions = field(default_factory=ReplanOptions)
    catches: bool = tuned(True)
    lean: LeanOptions = field(default_factory=LeanOptions)
    delay: DelayOptions = field(default_factory=DelayOptions)
    slides: FrictionOptions = field(default_factory=FrictionOptions)
    lateral: LateralOptions | None = None
    noise_filter: NoiseFilterOptions | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tasks:
            self.phase_table()  # which refuses what no task has

    @classmethod
    def of_kind(cls, kind: RobotKind, **changes: Any) -> EmbeddingOptions:
        """Options of a kind of robot, such as ``of_kind("free", noise_filter=None)``.

        Args:
            kind: of robot.
            changes: fields that are to have other values than the kind's.

        Raises:
            ParameterError: if a value does not fit its field.
        """
        return replace(KINDS[kind].controller, **changes)

    def phase_table(self) -> Phases:
        """The table of phases, its tasks with the numbers of ``tasks``.

        A task's name is its class's without "Task", in lower case: com, foot, posture, momentum,
        orientation, side_foot, spare_joint. The keys of its numbers are its fields'.

        Raises:
            ParameterError: if no phase has such a task, or a task has no such number.
        """
        table = dict(self.phases or KINDS[self.kind].phases)
        for name, numbers in self.tasks.items():
            place, (where, _, wanted) = f"{type(self).__name__}.tasks.{name}", name.rpartition(".")
            met = False
            for key, control in table.items():
                node, tasks = key.name if isinstance(key, Phase) else key, list(control.tasks)
                for i, task in enumerate(tasks):
                    if where in ("", node, node.partition("_")[0]) and task_name(task) == wanted:
                        tasks[i], met = _with_numbers(task, numbers, place), True
                table[key] = replace(control, tasks=tuple(tasks))
            if not met:
                known = sorted({task_name(t) for control in table.values() for t in control.tasks})
                raise ParameterError(
                    f"{place} is no task of a phase: give one of {', '.join(known)}, or PHASE.TASK"
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


class KindOptions(NamedTuple):
    """Tuning of a kind of robot."""

    controller: EmbeddingOptions
    phases: Phases
    lqr: LqrOptions
    ahead: AheadOptions
    walks_ahead: bool = False  # whether a walk that is kept is planned ahead
    bears: bool = False  # whether its feet bear the centre of pressure around them


FREE_PLANNER = LqrOptions(earliest_touchdown=0.1, earliest_share=1.0, trusted_price=0.3)
"""Tuning of a floating-base robot's LQR planner.

Its swing leg has to move sideways too, and needs time. Its first steps from a start are further
from the gait than a planar robot's, and the law of a slow gait is good in its neighbourhood only:
at 0.4 m/s it led Bolt from an error of 2 mm to one of 0.1 m/s. So the search begins earlier.
"""

# A heavy leg needs longer to get in front. After a step up a foot was to land 0.08 s after VLO
# (l0 = 0.67 m); it landed next to the other one, and G1 fell.
_SOLE_PLANNER = replace(FREE_PLANNER, earliest_touchdown=0.15, earliest_share=0.2)

_FREE = EmbeddingOptions(
    kind="free",
    # Hips that swing sideways come to their stops slowly, with the robot's weight behind them: they
    # slow down at any speed.
    qp=QpOptions(stop_share=0.0, stop_horizon=0.05),
    # A foot has to move sideways too, and is not asked to be high.
    swing=SwingOptions(),
    catches=False,  # no run to break into
    lateral=LateralOptions(),
    noise_filter=NoiseFilterOptions(),
)
_SOLES = replace(
    _FREE,
    kind="soles",
    swing=None,
    # Where hips are at their limits, the leg that they swing changes the CoM's speed by 0.05 m/s
    # within a step, and back; planned anew from there, TALOS walked 2.8 % too fast.
    replan=ReplanOptions(speed=0.07),
    lean=LeanOptions({}),  # the trunk stays upright
    # Heavy legs run with their feet at half of the walk's distance, just side by side; at all of it
    # they turn the trunk by 0.36 rad to either side, and by 0.7 as they begin.
    lateral=LateralOptions(running_width=0.5),
)
_TROT = replace(
    _FREE,
    kind="trot",
    lean=LeanOptions({}),  # the trunk stays level
    # The middle of either pair is below the trunk's. Pairs may cross, as a push may want them to.
    lateral=LateralOptions(widths=(-0.6, 0.6), step_width=0.0),
)

KINDS: Mapping[RobotKind, KindOptions] = {
    "planar": KindOptions(EmbeddingOptions(), PHASES, LqrOptions(), AheadOptions()),
    "free": KindOptions(_FREE, FREE_PHASES, FREE_PLANNER, BIPED_AHEAD),
    # Ahead it held all 18 of G1's disturbed walks in which the LQR's search fell.
    "soles": KindOptions(_SOLES, SOLE_PHASES, _SOLE_PLANNER, BIPED_AHEAD, True, bears=True),
    "trot": KindOptions(_TROT, TROT_PHASES, FREE_PLANNER, FREE_AHEAD, bears=True),
}
"""Tuning of each kind of robot."""


def kind_of(*, free: bool, flat: bool, trots: bool) -> RobotKind:
    """Kind of a robot: with a floating base, on flat feet, with four legs."""
    if trots:
        return "trot"
    if free and flat:
        return "soles"
    return "free" if free else "planar"


def robot_kind(robot: Biped) -> RobotKind:
    """Kind of a robot's model."""
    free, trots = robot.directions > UP, len(robot.feet) > LEGS
    return kind_of(free=free, flat=bool(robot.patches), trots=trots)
