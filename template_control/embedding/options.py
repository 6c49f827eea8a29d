"""The tuning of the embedding, for the reference template."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from template_control.checks.ranges import Range
from template_control.embedding.contacts import ContactOptions
from template_control.embedding.guards import GuardOptions
from template_control.embedding.learners.friction import FrictionOptions
from template_control.embedding.learners.lean import LeanOptions
from template_control.embedding.learners.load import LoadOptions
from template_control.embedding.learners.momentum_trim import TrimOptions
from template_control.embedding.learners.slope import SlopeOptions
from template_control.embedding.phases import PHASES, PhaseControl
from template_control.embedding.planning.replan_options import ReplanOptions
from template_control.embedding.references.leg_forces import UnloadOptions
from template_control.embedding.references.swing_choice import SwingChoice, Swings
from template_control.embedding.references.swing_foot import SwingOptions
from template_control.estimation.delay import DelayOptions
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.similarity import tuned
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
        swing: shape of the swings; None: as ``swing_choice`` has it for the robot.
        swing_choice: which robots lift their feet high, and when.
        contacts: when a contact flag is believed, and when a foot has met a wall.
        unload: how a foot is unloaded before it lifts off.
        replan: when a stride is planned anew.
        load: tuning of the load estimate.
        trim: tuning of the momentum trim.
        catches: whether a walk breaks into another stride where it cannot go on, kept or of a
            scenario: a run where it is too fast, a stand where it is too slow.
        lean: how far the trunk leans in strides that do not keep ``trunk_pitch``.
        delay: how the delay from measurement to torque is learnt and reckoned with, where a planar
            robot's whole state is measured; a run is told it, not the controller.
        slope: how the ground's slope is learnt.
        slides: how it is learnt that the ground is more slippery than ``friction`` says.
    """

    kind: ClassVar[str] = "planar"

    trunk_pitch: Annotated[float, Range(-1.5, 1.5)] = tuned(0.0)
    phases: Mapping[Phase | str, PhaseControl] = field(default_factory=lambda: dict(PHASES))
    guards: GuardOptions = field(default_factory=GuardOptions)
    swing: SwingOptions | None = None
    swing_choice: SwingChoice = field(default_factory=SwingChoice)
    contacts: ContactOptions = field(default_factory=ContactOptions)
    unload: UnloadOptions = field(default_factory=UnloadOptions)
    replan: ReplanOptions = field(default_factory=ReplanOptions)
    load: LoadOptions = field(default_factory=LoadOptions)
    trim: TrimOptions = field(default_factory=TrimOptions)
    catches: bool = tuned(True)
    lean: LeanOptions = field(default_factory=LeanOptions)
    delay: DelayOptions = field(default_factory=DelayOptions)
    slope: SlopeOptions = field(default_factory=SlopeOptions)
    slides: FrictionOptions = field(default_factory=FrictionOptions)

    def swings(self, robot: Biped) -> Swings:
        """Shapes of a robot's swings in phases that have none of their own."""
        if self.swing is not None:
            return Swings(self.swing, self.swing)
        return self.swing_choice.of(robot)
