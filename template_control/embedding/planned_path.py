"""The path that the supervisor has planned, and the robot's place on it.

In stance the path is looked up by phase, the direction from the rear stance foot to the CoM (the
angle beta of Section V-B); in flight, where nothing but time passes, by time.

The legs' swing makes the robot's CoM run ahead of the template and fall back behind it within
a step, while its angular momentum about the foot, on which all forces depend, stays the
template's. So in stance the phase is that of a point that moves with dx/dt + L / (m y), L the
angular momentum about the CoM: it starts in the CoM at every plan, and leads or lags it by
centimetres.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.embedding.planners.planner import Cause
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event
from template_control.slip.path import at_direction, leg_forces, sample
from template_control.structured import structure

_TOUCHDOWN = int(Event.TOUCHDOWN)
PATH = structure(
    # -- the robot's place on it --
    time=float,  # along the path [s]
    offset=float,  # of the point whose direction is the phase, ahead of the CoM [m]
    fresh=np.int64,  # whether the path begins at this tick
    forces=(float, (2, 2)),  # leg forces of the template there, rear and front [N]
    # -- the plan, written when it changes --
    # m, g towards the ground and back along it, l0, assist of two legs, half a foot's length
    body=(float, (6,)),
    event_times=(float, (NUM_EVENTS,)),  # of each event's next occurrence [s]; inf: none
    landing_x=(float, (2,)),  # of each foot's next foothold [m]; NaN: none
    landing_time=(float, (2,)),  # [s]; inf: never
    toe=float,  # x of the template's rear toe [m]
    touchdown_angle=float,  # of the stride [rad]
    step_length=float,  # of the planner's gait [m]
    step_duration=float,  # of it [s]
    planned_at=float,  # when the path began [s]
    viable=np.int64,  # whether the template completes the path's strides, and goes on
    without_touchdown=np.int64,  # whether an overdue touchdown has been taken off the path
    # -- when it is planned anew --
    patience=float,  # with a touchdown [s]
    interval=float,  # between plans [s]
    speed=float,  # deviation of the forward speed [m/s]
)
"""The path that the supervisor has planned, and the robot's place on it."""

PlainCurve = tuple[Array, Array, Array]
"""A :class:`~template_control.slip.path.Curve`, as compiled functions take it."""

KEPT = 0
"""Result of :func:`plan_is_due` where the path is kept; else the value of a cause."""
_OVERDUE, _STRAYED = int(Cause.OVERDUE.value), int(Cause.DEVIATION.value)
_LEADS_NOWHERE = int(Cause.NO_FUTURE.value)


@compiled
def move_clock(path: Any, curve: PlainCurve, s: Any, mode: Any, want: Any, motion: Array) -> None:
    """Go on along ``path``, of ``PATH``, to where the robot is now, and write the CoM's reference.

    ``s`` is of ``SENSED``, ``mode`` of ``MODE``, ``want`` of ``REFERENCES``; ``motion`` is dx/dt of
    the CoM [m/s], and the time since the last tick [s].
    """
    (speed, dt), (_, meta, look) = motion, curve
    x, y = s.state[0] + path.offset - s.toes[0], s.state[1]
    # Since the last tick, unless the path begins at this one. A direction needs a guess only.
    guess = path.time + (0.0 if path.fresh and not mode.by_direction else dt)
    path.fresh = 0
    if mode.by_direction:
        path.time, row = at_direction(curve, x, y, guess, want.com)
    else:
        path.time, row = guess, sample(curve, guess, want.com)
    path.offset += (s.state[2] - speed) * dt
    toe, forces = look[0], path.forces
    leg_forces(meta[row], toe, want.com, path.body, forces)
    if meta[row, 3] != toe:
        # Template and robot are on either side of liftoff: to each foot its own force.
        for axis in range(2):
            forces[0, axis], forces[1, axis] = forces[1, axis], forces[0, axis]


@compiled
def plan_is_due(path: Any, lands: bool, deviation: float, phase_time: float, now: float) -> int:
    """Value of the :class:`.Cause` to plan the path, of ``PATH``, anew, or ``KEPT``.

    The swing foot ``lands`` on it; ``deviation`` from it is of the forward speed [m/s],
    ``phase_time`` along it, at the time ``now`` [s].
    """
    if path.without_touchdown:
        return KEPT
    if lands and phase_time > path.event_times[_TOUCHDOWN] + path.patience:
        return _OVERDUE
    if now - path.planned_at <= path.interval:
        return KEPT
    if abs(deviation) > path.speed and phase_time > path.interval:
        return _STRAYED
    return KEPT if path.viable else _LEADS_NOWHERE
