"""What the controller knew and chose at a section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import Decision
from template_control.slip.maps.section import Section
from template_control.slip.scenario.route import StrideGoal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Learnt:
    """What the controller's learners know at a section.

    Attributes:
        load: the load factor.
        trim: the momentum trim [m/s^2].
        lean: what the trunk's reference adds to the wanted mean pitch [rad].
    """

    load: float
    trim: float
    lean: float


@dataclass(frozen=True)
class SectionReport:
    """What the controller knew and chose at a section.

    Attributes:
        time: at which the section was reached [s].
        section: VLO or APEX.
        state: (3,) dx/dt (as the phase before senses it), y, dy/dt [m/s, m, m/s].
        goal: the stride that begins, and where it is to lead.
        target: (3,) dx/dt, y, dy/dt where it is to lead.
        decision: the planner's choice for it.
        offset: (3,) the planner's offset estimate.
        learnt: what the learners knew.
        plan_seconds: wall-clock time of the plan.
    """

    time: float
    section: Section
    state: Array
    goal: StrideGoal
    target: Array
    decision: Decision
    offset: Array
    learnt: Learnt
    plan_seconds: float

    @property
    def accepted(self) -> float:
        """dx/dt that the planner took for the target's [m/s]."""
        taken = self.decision.accepted
        return float(self.target[0]) if taken is None else taken
