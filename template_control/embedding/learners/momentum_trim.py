"""What double stance must add to the template's forces so that the robot keeps its momentum.

A robot's step adds something systematic to the template's. The planner can cancel two of its
three directions; the third, which is mostly forward speed, it cannot: from a symmetric gait, by
the template's mirror symmetry, no touchdown angle and no leg stiffness changes it, and a gait
can bear it only with dy/dt at VLO. In single stance no force can either, as a point foot cannot
change the momentum about itself. In double stance the forces of two feet can.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Share
from template_control.embedding.references.template_path import TemplatePath
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.gaits.gait import Gait, vlo_jacobians
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TrimOptions(Checked):
    """Tuning of the momentum trim; drifts are speeds over sqrt(g l0).

    Attributes:
        share: of a step's drift that enters its slow average.
        gain: share of the average that the next double stance is to take away.
        dead_zone: average that counts as none.
        largest: a larger drift counts as this much: a push is no drift.
        bound: of the acceleration over g.
    """

    share: Share = tuned(0.2)
    gain: NotNegative = tuned(0.1)
    dead_zone: NotNegative = tuned(0.0008)
    largest: NotNegative = tuned(0.01)
    bound: NotNegative = tuned(0.03)


class MomentumTrim:
    """Horizontal acceleration added in double stance, learnt from step to step.

    Args:
        parameters: the template.
        options: tuning.

    Attributes:
        drift: average drift of a step, as a forward speed [m/s].
        acceleration: to add to the CoM's in double stance [m/s^2], 0 at first.
    """

    def __init__(self, parameters: SlipParameters, options: TrimOptions) -> None:
        p = parameters
        self.options = options
        self.forget()
        self._speed = p.speed_unit
        self._bound = options.bound * p.gravity
        self._path: TemplatePath | None = None
        self._gait: Gait | None = None
        self._left_alone = np.zeros(3)

    def forget(self) -> None:
        """Begin anew: what was learnt was for another way of moving."""
        self.acceleration = 0.0
        self.drift = 0.0

    def expect(self, path: TemplatePath | None, gait: Gait) -> None:
        """Take note of the exact template's path for the step that begins.

        Args:
            path: from this VLO to the next; None where nothing is to be learnt from it.
            gait: the stride's gait; :func:`uncontrolled` tells the direction that counts.
        """
        self._path = path
        if path is not None and gait is not self._gait:
            self._gait, self._left_alone = gait, uncontrolled(gait)

    def end_stride(self, z: Array, nominal: bool) -> None:
        """Learn from the step that has just ended.

        Args:
            z: (3,) VLO state dx/dt, y, dy/dt in which it ended [m/s, m, m/s].
            nominal: whether the step went near the gait. Another one, such as a step with a push,
                teaches nothing.
        """
        path = self._path
        if path is None or not nominal:
            return
        duration = path.due(Event.REAR_LIFTOFF) - path.due(Event.TOUCHDOWN)
        if not np.isfinite(duration):
            return
        o = self.options
        largest = o.largest * self._speed
        drift = min(max(float(self._left_alone @ (z - path.section_state)), -largest), largest)
        self.drift += o.share * (drift - self.drift)
        beyond = max(abs(self.drift) - o.dead_zone * self._speed, 0.0)
        wanted = self.acceleration - o.gain * np.copysign(beyond, self.drift) / duration
        self.acceleration = float(min(max(wanted, -self._bound), self._bound))


def uncontrolled(gait: Gait) -> Array:
    """(3,) n with n B = 0 for the VLO map's control Jacobian B at the gait, n[0] = 1.

    n (z - P(z, u)) is a step's drift, as a forward speed [m/s].
    """
    direction = np.linalg.svd(vlo_jacobians(gait)[1])[0][:, -1]
    return np.asarray(direction / direction[0])
