"""The tuning of the embedding, in the units of the reference template."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from template_control.embedding.load import LoadOptions
from template_control.embedding.momentum_trim import TrimOptions
from template_control.embedding.scaling import Scale
from template_control.embedding.step_planning import ReplanOptions
from template_control.embedding.swing_foot import SwingOptions
from template_control.errors import ParameterError
from template_control.whole_body.tasks import (
    DOUBLE_STANCE_WEIGHTS,
    SINGLE_STANCE_WEIGHTS,
    Gains,
    Weights,
)


@dataclass(frozen=True)
class EmbeddingOptions:
    """Tuning of the embedding for the reference template (80 kg, 1 m, 9.81 m/s^2).

    The controller scales it to its gait's template by dynamic similarity.

    Attributes:
        gains: PD gains of (45).
        single_stance, double_stance: task weights.
        swing: shape of the swing.
        load: tuning of the load estimate.
        trim: tuning of the momentum trim.
        friction: coefficient the QP's cones are built with.
        torque_scale: share of the URDF's torque limits that may be used.
        trunk_pitch: where the trunk is held [rad].
        contact_damping: brings a foot that landed sliding to rest [1/s].
        replan: when a step is planned anew.
        liftoff_angle: direction beta from the rear foot to the CoM [rad, from forward
            horizontal] at which that foot lifts off. None: "at the same configuration (namely,
            the same beta_l) as that of SLIP", Fig. 13(b); an angle: "the leg lifts off at a
            predefined configuration", whatever the template does, Fig. 13(c).
    """

    gains: Gains = field(default_factory=Gains)
    single_stance: Weights = SINGLE_STANCE_WEIGHTS
    double_stance: Weights = DOUBLE_STANCE_WEIGHTS
    swing: SwingOptions = field(default_factory=SwingOptions)
    load: LoadOptions = field(default_factory=LoadOptions)
    trim: TrimOptions = field(default_factory=TrimOptions)
    friction: float = 0.63
    torque_scale: float = 1.0
    trunk_pitch: float = 0.0
    contact_damping: float = 40.0
    replan: ReplanOptions = field(default_factory=ReplanOptions)
    liftoff_angle: float | None = None

    def __post_init__(self) -> None:
        if self.liftoff_angle is not None and not 0.0 < self.liftoff_angle < np.pi:
            raise ParameterError(
                f"liftoff_angle is {self.liftoff_angle!r} rad: give an angle between 0 and pi"
            )

    def scaled(self, scale: Scale) -> EmbeddingOptions:
        """The same tuning for a template of another size."""
        return replace(
            self,
            gains=scale.gains(self.gains),
            single_stance=scale.weights(self.single_stance),
            double_stance=scale.weights(self.double_stance),
            swing=scale.swing(self.swing),
            contact_damping=self.contact_damping / scale.time,
            replan=scale.replan(self.replan),
        )
