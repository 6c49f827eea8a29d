"""Learners of a stride: when each of them learns; load and momentum of the robot, by feedback.

A robot's step adds something systematic to the template's. The planner can cancel two of its three
directions, but not the third, mostly forward speed: near a symmetric gait, by the template's mirror
symmetry, no touchdown angle and no leg stiffness changes it. In single stance no force can either,
as a point foot cannot change the momentum about itself; in double stance the forces of two can.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.embedding.lean import TrunkLean
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.state import EstimatorState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.estimation.friction import set_friction
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.gaits.gait import Gait, uncontrolled
from template_control.slip.maps.section import Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.path import TemplatePath
from template_control.slip.similarity import Scale
from template_control.structured import Number

# Load estimate.
_LOAD_GAIN = 0.7  # share of a step's mean feedback that enters the estimate
# Mean feedback over g that counts as none; a step of the nominal robot has up to this much, from
# the swing leg, and must not be learnt.
_LOAD_DEAD_ZONE = 0.02
# Share of the estimate forgotten in a step that teaches nothing; what a disturbance taught must not
# stay.
_LOAD_LEAK = 0.1
# Strides off the gait whose feedback has to agree: two of a run with its motors at their limits do.
_AGREE = 3
_LOAD_STEP = 0.05  # largest change of the factor in one step; a push is no load
LOAD_BOUNDS = (0.7, 1.4)
"""Of the load factor."""

# Momentum trim; drifts are speeds over sqrt(g l0).
_DRIFT_SHARE = 0.2  # of a step's drift that enters its slow average
_TRIM_GAIN = 0.1  # share of the average that the next double stance is to take away
_DRIFT_DEAD_ZONE = 0.0008  # average that counts as none
_LARGEST_DRIFT = 0.01  # a larger drift counts as this much: a push is no drift
TRIM_BOUND = 0.03
"""Of the trim's acceleration over g."""


class LoadEstimate:
    """Ratio of the real to the modelled weight, ``factor``, 1 at first.

    Over a whole step the feedback part of the CoM's vertical acceleration averages to nothing,
    unless forces computed with the model's mass do not carry the robot. All joint torques are
    scaled by the factor. ``gravity`` is the model's [m/s^2]; ``data`` (1,) are of ``LOAD``.
    """

    _sum, _time = Number("sum"), Number("time")

    def __init__(self, gravity: float, data: Any) -> None:
        self.data = data
        self.factor = 1.0
        self._last = (0.0,) * _AGREE  # mean feedback of the last strides, over g
        self._gravity = gravity

    def end_stride(self, nominal: bool) -> None:
        """Learn from the stride that has just ended.

        One that is not near the gait, such as a stride with a push, teaches what both strides
        before it have shown too; where that is nothing, the estimate leaks.
        """
        if self._time == 0.0:
            return
        mean = self._sum / self._time / self._gravity
        self._last = (*self._last[1:], mean)
        if not nominal:
            agree = all(other * mean > 0.0 for other in self._last)
            mean = min(self._last, key=abs) if agree else 0.0
        change = min(_LOAD_GAIN * max(abs(mean) - _LOAD_DEAD_ZONE, 0.0), _LOAD_STEP)
        factor = self.factor + (change if mean > 0.0 else -change)
        if change == 0.0:
            factor -= _LOAD_LEAK * (factor - 1.0)
        self.factor = min(max(factor, LOAD_BOUNDS[0]), LOAD_BOUNDS[1])
        self._sum = self._time = 0.0


class MomentumTrim:
    """Horizontal acceleration added in double stance, learnt from step to step.

    ``drift`` is the average drift of a step, as a forward speed [m/s]; ``acceleration`` is to be
    added to the CoM's in double stance [m/s^2], 0 at first.
    """

    def __init__(self, parameters: SlipParameters) -> None:
        self.forget()
        self._speed = parameters.speed_unit
        self._bound = TRIM_BOUND * parameters.gravity
        self._path: TemplatePath | None = None
        self._gait: Gait | None = None
        self._left_alone = np.zeros(3)

    def forget(self) -> None:
        """Begin anew: what was learnt was for another way of moving."""
        self.acceleration = self.drift = 0.0

    def expect(self, path: TemplatePath | None, gait: Gait) -> None:
        """Take note of the template's path from this VLO to the next; None: nothing is learnt."""
        self._path = path
        if path is not None and gait is not self._gait:
            self._gait, self._left_alone = gait, uncontrolled(gait)

    def end_stride(self, z: Array, nominal: bool) -> None:
        """Learn from a step near the gait that has ended in the VLO state z (3,) [m/s, m, m/s]."""
        path = self._path
        if path is None or not nominal:
            return
        duration = path.time_of(Event.REAR_LIFTOFF) - path.time_of(Event.TOUCHDOWN)
        if not np.isfinite(duration):
            return
        largest = _LARGEST_DRIFT * self._speed
        drift = min(max(float(self._left_alone @ (z - path.section_state)), -largest), largest)
        self.drift += _DRIFT_SHARE * (drift - self.drift)
        beyond = max(abs(self.drift) - _DRIFT_DEAD_ZONE * self._speed, 0.0)
        wanted = self.acceleration - _TRIM_GAIN * np.copysign(beyond, self.drift) / duration
        self.acceleration = float(min(max(wanted, -self._bound), self._bound))


class Learners:
    """Learners from stride to stride.

    ``options`` are scaled to the template, ``robot`` is the nominal model, and ``tick`` (1,) is of
    ``TICK``, in which they keep what ticks read and write.
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
        set_friction(tick["slides"], options.slides, options.qp.friction, weight, scale)

    @property
    def state(self) -> EstimatorState:
        """Their estimates now."""
        return EstimatorState(self.load.factor, self.trim.acceleration, self.lean.correction)

    def end_stride(self, section: Section, state: Array, nominal: bool) -> None:
        """Learn from the stride that has ended in ``state`` (4,), near the gait if ``nominal``."""
        self.load.end_stride(nominal or self._always)
        self.trim.end_stride(section.padded(section.of(state)), nominal)
        self.lean.end_stride(nominal)

    def begin_stride(self, supervisor: StrideSupervisor, trimmed: bool) -> None:
        """Take note of the stride decided, in which the momentum trim acts or does not."""
        goal, log = supervisor.goal, supervisor.log
        if log and log[-1].goal.stride != goal.stride:
            # A walk after a run stands up; one that leant had other drifts.
            self.trim.forget()
        self.lean.aim(goal)
        self.trim.expect(supervisor.path if trimmed else None, supervisor.planner.gait)
