"""The paper's own planner: the modified walking controller once a step at VLO."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Interval, NotNegative, Positive
from template_control.embedding.planners.planner import Context, Decision, Planner
from template_control.slip.automaton.vocabulary import MapKind, Outcome, Slot, StrideKind
from template_control.slip.control.modified_walking import Aim, search_angle
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.gaits.gait import GaitFamily, WalkingGait, without_push_off
from template_control.slip.gaits.walking_by_speed import other_walks
from template_control.slip.similarity import SPEED, Scale, scaled, tuned


@dataclass(frozen=True)
class ModifiedOptions(Checked):
    """Bounds of the search.

    Attributes:
        angle_range: touchdown angle relative to the gait's [rad].
        stiffness_range: kappa_2 over k0.
        top_margin: alpha stays this far [rad] below asin(y / l0).
        tolerance: distance from the gait's VLO state, in SI units, up to which a step counts as
            nominal; scaled with speeds.
        map_kind: the return map that steps are tried on.
    """

    kind: ClassVar[str] = "modified"

    angle_range: Interval = tuned((-0.14, 0.08))
    stiffness_range: Interval = tuned((0.5, 1.5))
    top_margin: NotNegative = tuned(0.01)
    tolerance: Positive = tuned(0.05, SPEED)
    map_kind: MapKind = MapKind.EXACT


class ModifiedPlanner(Planner):
    """kappa_1 = k0, kappa_2 by equation (38), alpha by search on a return map.

    Args:
        gait: to reach at the next VLO, in the paper's steps without push-off.
        options: bounds.
    """

    gait: WalkingGait

    @checked
    def __init__(self, gait: WalkingGait, options: ModifiedOptions | None = None) -> None:
        gait = without_push_off(gait)
        self.gait = gait
        self.options = scaled(options or ModifiedOptions(), Scale.of(gait.parameters))
        self._family = GaitFamily(gait, other_walks)
        self._scratch = new_scratch()
        self._kernel = stride_kernel(gait.parameters, StrideKind.WALK)
        k0 = gait.parameters.leg_stiffness
        self._stiffness = np.array(self.options.stiffness_range) * k0

    def __repr__(self) -> str:
        return f"<ModifiedPlanner on {self.gait!r}>"

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: back to the gait it was made for."""
        self.gait = self._family.reset()

    def decide(self, context: Context) -> Decision:
        """See :meth:`~.planner.Planner.decide`; the stride is a walking step from VLO to VLO."""
        z, target, angles, *_ = context
        self.gait, reachable = self._family.towards(self.gait, target)
        p, o = self.gait.parameters, self.options
        predicted = np.empty(3)
        nominal = float(self.gait.controls[Slot.TOUCHDOWN_ANGLE])
        top = np.arcsin(min(z[1] / p.rest_length, 1.0)) - o.top_margin
        high = min(nominal + o.angle_range[1], top, max(angles[1], nominal + o.angle_range[0]))
        low = min(max(nominal + o.angle_range[0], angles[0]), high)
        search = min(max(nominal, low), high), low, high, p.leg_stiffness
        aim = Aim(self.gait.vlo, self._stiffness)
        outcome, alpha, kappa_2, residual = search_angle(
            self._kernel, int(o.map_kind), z, aim, search, self._scratch, predicted
        )
        controls = self.gait.controls.copy()
        controls[Slot.TOUCHDOWN_ANGLE], controls[Slot.K_SD] = alpha, kappa_2
        feasible = outcome == Outcome.SECTION
        nominal = reachable and feasible and residual < o.tolerance**2
        return Decision(controls, predicted, feasible, feasible, nominal)
