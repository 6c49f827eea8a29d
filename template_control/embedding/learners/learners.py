"""Learners of a stride: when each of them learns, and their estimates."""

from __future__ import annotations

from typing import Any

from template_control.arrays import Array
from template_control.embedding.learners.friction import set_friction
from template_control.embedding.learners.lean import TrunkLean
from template_control.embedding.learners.momentum import LoadEstimate, MomentumTrim
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.state import EstimatorState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.robot.biped import Biped
from template_control.slip.maps.section import Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale


class Learners:
    """Learners from stride to stride.

    ``options`` are scaled to the template, ``robot`` is the nominal model, and ``tick`` (1,) is of
    ``TICK``, in which they keep what ticks read and write. ``load`` is how much heavier the robot
    is than its model, ``trim`` what double stance adds to the template's forces.
    """

    def __init__(
        self, options: EmbeddingOptions, parameters: SlipParameters, robot: Biped, tick: Any
    ) -> None:
        scale, weight = Scale.of(parameters), robot.mass * robot.gravity
        # On soles a robot of another mass takes no nominal stride until its load is learnt.
        self._always = bool(robot.patches)
        self.load = LoadEstimate(robot.gravity, tick["load"])
        self.trim = MomentumTrim(parameters)
        self.lean = TrunkLean(options.lean, options.trunk_pitch, scale, tick["lean"])
        set_friction(tick["slides"], options.slides, options.friction, weight, scale)

    @property
    def state(self) -> EstimatorState:
        """Their estimates now."""
        return EstimatorState(self.load.factor, self.trim.acceleration, self.lean.correction)

    def end_stride(self, section: Section, state: Array, nominal: bool) -> None:
        """Learn from the stride that has just ended; one that is not near the gait teaches nothing.

        ``state`` (4,) is x, y, dx/dt, dy/dt at its section.
        """
        self.load.end_stride(nominal or self._always)
        self.trim.end_stride(section.padded(section.of(state)), nominal)
        self.lean.end_stride(nominal)

    def begin_stride(self, supervisor: StrideSupervisor, trimmed: bool) -> None:
        """Take note of the stride that the supervisor has decided.

        ``trimmed`` says whether the momentum trim acts somewhere in it.
        """
        if supervisor.changes_kind:
            # A walk after a run stands up; one that leant had other drifts.
            self.trim.forget()
        self.lean.aim(supervisor.goal)
        self.trim.expect(supervisor.path if trimmed else None, supervisor.planner.gait)
