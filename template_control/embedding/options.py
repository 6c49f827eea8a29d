"""Tuning of the embedding, for the reference template."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from template_control.checks.ranges import Range
from template_control.embedding.contacts import ContactOptions
from template_control.embedding.learners.friction import FrictionOptions
from template_control.embedding.learners.lean import LeanOptions
from template_control.embedding.modes import GuardOptions
from template_control.embedding.phases import PHASES, PhaseControl
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.swing import SwingOptions, Swings
from template_control.estimation.delay import DelayOptions
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.similarity import Scale, tuned
from template_control.whole_body.solver import QpOptions


@dataclass(frozen=True)
class EmbeddingOptions(QpOptions):
    """Tuning of the embedding for the reference template (80 kg, 1 m, 9.81 m/s^2).

    The controller scales it to its gait's template by dynamic similarity. The fields of
    :class:`~template_control.whole_body.solver.QpOptions` come first.

    Attributes:
        trunk_pitch: where the trunk is held [rad].
        phases: tasks, clock, feet and learners of each phase.
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

    trunk_pitch: Annotated[float, Range(-1.5, 1.5)] = tuned(0.0)
    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(PHASES))
    guards: GuardOptions = field(default_factory=GuardOptions)
    swing: SwingOptions | None = None
    contacts: ContactOptions = field(default_factory=ContactOptions)
    replan: ReplanOptions = field(default_factory=ReplanOptions)
    catches: bool = tuned(True)
    lean: LeanOptions = field(default_factory=LeanOptions)
    delay: DelayOptions = field(default_factory=DelayOptions)
    slides: FrictionOptions = field(default_factory=FrictionOptions)

    def swings(self, robot: Biped, scale: Scale) -> Swings:
        """Shapes of a robot's swings in phases that have none of their own.

        Args:
            robot: the model.
            scale: units of its template, to which these options are scaled.
        """
        if self.swing is not None:
            return Swings(self.swing, self.swing)
        return Swings.of(robot, scale)
