"""Load and momentum of the robot, learnt from the feedback of the strides.

A robot's step adds something systematic to the template's. The planner can cancel two of its
three directions; the third, which is mostly forward speed, it cannot: from a symmetric gait, by
the template's mirror symmetry, no touchdown angle and no leg stiffness changes it, and a gait
can bear it only with dy/dt at VLO. In single stance no force can either, as a point foot cannot
change the momentum about itself. In double stance the forces of two feet can.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.embedding.com_path import TemplatePath
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.gaits.gait import Gait, vlo_jacobians
from template_control.slip.parameters import SlipParameters
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


_F = np.float64

LOAD = np.dtype(
    [
        ("sum", _F),  # of the vertical feedback over the stride [m/s]
        ("time", _F),  # over which it was summed [s]
    ],
    align=True,
)
"""Load estimate, within a stride."""


@compiled
def observe_load(load: Any, feedback: float, dt: float) -> None:
    """Add the feedback of one tick of ``dt`` [s] to the mean over the present stride.

    ``load``, of ``LOAD``, is overwritten; ``feedback`` is the feedback part of the CoM's vertical
    acceleration, up positive [m/s^2].
    """
    load.sum += feedback * dt
    load.time += dt


class LoadEstimate:
    """Ratio of the real to the modelled weight, ``factor``, 1 at first.

    Over a whole step the feedback part of the CoM's vertical acceleration averages to
    nothing, unless forces computed with the model's mass do not carry the robot. All joint
    torques are then scaled by the factor learnt here; the model itself stays nominal.
    Feedback is measured in units of the model's ``gravity`` [m/s^2]; ``data`` (1,) are of ``LOAD``.
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
        p = parameters
        self.forget()
        self._speed = p.speed_unit
        self._bound = TRIM_BOUND * p.gravity
        self._path: TemplatePath | None = None
        self._gait: Gait | None = None
        self._left_alone = np.zeros(3)

    def forget(self) -> None:
        """Begin anew: what was learnt was for another way of moving."""
        self.acceleration = 0.0
        self.drift = 0.0

    def expect(self, path: TemplatePath | None, gait: Gait) -> None:
        """Take note of the exact template's path from this VLO to the next.

        None where nothing is to be learnt from it; :func:`uncontrolled` of the gait is the
        direction that counts.
        """
        self._path = path
        if path is not None and gait is not self._gait:
            self._gait, self._left_alone = gait, uncontrolled(gait)

    def end_stride(self, z: Array, nominal: bool) -> None:
        """Learn from a step that has ended in the VLO state z (3,), dx/dt, y, dy/dt [m/s, m, m/s].

        One that is not near the gait, such as a step with a push, teaches nothing.
        """
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


def uncontrolled(gait: Gait) -> Array:
    """(3,) n with n B = 0 for the VLO map's control Jacobian B at the gait, n[0] = 1.

    n (z - P(z, u)) is a step's drift, as a forward speed [m/s].
    """
    direction = np.linalg.svd(vlo_jacobians(gait)[1])[0][:, -1]
    return np.asarray(direction / direction[0])
