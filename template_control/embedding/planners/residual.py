"""Planner of another planner's controls and a residual, as a learner chooses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from template_control.arrays import Array
from template_control.embedding.planners.planner import Context, Decision, Planner
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Outcome, Slot
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters

_LEFT_ALONE = ("decide_rest", "observe", "forget", "cost", "next_gait", "curve")
"""What the planner itself answers."""


class ResidualPlanner(Planner):
    """u = u_planner + residual in each whole stride; all else is the planner's.

    The template says where the stride with these controls ends, so the planner's estimate of the
    robot's offset does not learn the residual.

    Args:
        planner: that the residual is added to.

    Attributes:
        planner: the same.
        residual: (NUM_SLOTS,) added to the controls by Slot: the touchdown angle [rad], which stays
            within what the swing foot can reach, and stiffnesses [N/m]. It holds from the next
            stride on.
    """

    def __init__(self, planner: Planner) -> None:
        self.planner = planner
        self.residual = np.zeros(NUM_SLOTS)
        self._map = ReturnMap(planner.gait.parameters, planner.gait.stride)
        for name in _LEFT_ALONE:
            setattr(self, name, getattr(planner, name))

    def __repr__(self) -> str:
        return f"<residual on {self.planner!r}>"

    @property
    def gait(self) -> Gait:  # type: ignore[override]
        """Gait of the planner."""
        return self.planner.gait

    @property
    def offset(self) -> Array:  # type: ignore[override]
        """(3,) estimate of the planner."""
        return self.planner.offset

    @property
    def retries(self) -> bool:  # type: ignore[override]
        """Whether the planner plans again and again."""
        return self.planner.retries

    def reset(self) -> None:
        """See :meth:`Planner.reset`; the residual stays."""
        self.planner.reset()
        self._map = ReturnMap(self.gait.parameters, self.gait.stride)

    def decide(self, context: Context) -> Decision:
        """See :meth:`Planner.decide`."""
        decision = self.planner.decide(context)
        if not (decision.feasible and self.residual.any()):
            return decision
        u = decision.controls + self.residual
        u[Slot.TOUCHDOWN_ANGLE] = np.clip(u[Slot.TOUCHDOWN_ANGLE], *context.angles)
        end, outcome = self._map.step(context.z, u)
        if outcome is not Outcome.SECTION:
            return decision  # the template falls with the residual, and not without it
        return replace(decision, controls=u, predicted=end + self.offset[: len(end)])

    def on_slope(self, slope: float) -> SlipParameters | None:
        """See :meth:`Planner.on_slope`."""
        found = self.planner.on_slope(slope)
        if found is not None:
            self._map = ReturnMap(found, self.gait.stride)
        return found
