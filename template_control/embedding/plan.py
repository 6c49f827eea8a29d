"""A plan: the template's path from now to the touchdown after the next VLO.

World frame. The path is kept as the kernel's Taylor polynomials, so references of any
order come from it exactly, and are looked up by phase: the direction from the rear stance
foot to the CoM (the angle beta of Section V-B), not by time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import Event, Outcome
from template_control.slip.dynamics.stride import Stride
from template_control.slip.dynamics.taylor import ORDER

Array = NDArray[np.float64]

_NEWTON = 12


@dataclass(frozen=True)
class Plan:
    """Consecutive strides of the template, in one time and one world frame.

    Attributes:
        cx, cy, meta: the segments' polynomials, times, nodes, toes and stiffnesses (see
            :class:`~template_control.slip.dynamics.stride.Stride`).
        touchdown, liftoff, vlo: times of the next such events [s], inf if there is none.
        foothold: x of the next toe [m].
        front_toe: x of the front toe at the start [m].
        vlo_state: (3,) predicted dx/dt, y, dy/dt at the next VLO.
        outcome: how the first stride ends.
        duration: end of the last segment [s].
    """

    cx: Array
    cy: Array
    meta: Array
    touchdown: float
    liftoff: float
    vlo: float
    foothold: float
    front_toe: float
    vlo_state: Array
    outcome: Outcome
    duration: float


def chain(strides: Sequence[Stride]) -> Plan:
    """Join strides, each of which starts where the one before ended."""
    metas, offset = [], 0.0
    times: dict[Event, float] = {}
    for stride in strides:
        meta = stride.meta.copy()
        meta[:, 0] += offset
        metas.append(meta)
        for event in stride.events:
            times.setdefault(event.event, offset + event.time)
        offset += stride.duration
    meta = np.concatenate(metas)
    touchdown = times.get(Event.TOUCHDOWN, np.inf)
    on_new_toe = np.flatnonzero(meta[:, 0] >= touchdown - 1e-12)
    first = strides[0]
    return Plan(
        cx=np.concatenate([s.cx for s in strides]),
        cy=np.concatenate([s.cy for s in strides]),
        meta=meta,
        touchdown=touchdown,
        liftoff=times.get(Event.REAR_LIFTOFF, np.inf),
        vlo=times.get(Event.VLO, np.inf),
        foothold=float(meta[on_new_toe[0], 4]) if on_new_toe.size else np.nan,
        front_toe=float(meta[0, 4]),
        vlo_state=first.state[[2, 1, 3]],
        outcome=first.outcome,
        duration=offset,
    )


@compiled
def _polynomial(c: Array, t: float, out: Array, first: int) -> None:
    """Value, first and second derivative at ``t`` into out[first], out[first+2], ..."""
    p = d = dd = 0.0
    for n in range(ORDER, -1, -1):
        dd = dd * t + d
        d = d * t + p
        p = p * t + c[n]
    out[first], out[first + 2], out[first + 4] = p, d, 2.0 * dd


@compiled
def sample(cx: Array, cy: Array, meta: Array, time: float, out: Array) -> int:
    """Path at ``time`` into out (6,): x, y and their two derivatives; returns the segment."""
    row = 0
    while row + 1 < meta.shape[0] and meta[row + 1, 0] <= time:
        row += 1
    # Past either end the path goes on along its last polynomial for a moment, then stops.
    local = min(max(time - meta[row, 0], -0.02), meta[row, 1] + 0.02)
    _polynomial(cx[row], local, out, 0)
    _polynomial(cy[row], local, out, 1)
    return row


@compiled
def at_phase(
    cx: Array, cy: Array, meta: Array, toe: float, x: float, y: float, guess: float, out: Array
) -> tuple[float, int]:
    """Time at which the template sees its CoM in the direction of (x, y), and its path there.

    Args:
        cx, cy, meta: segments of a plan.
        toe: x of the template's rear toe, from which the direction is taken [m].
        x, y: the robot's CoM relative to its rear stance foot [m].
        guess: a time close to the answer [s].
        out: (6,) overwritten with the path there, x relative to that toe.

    Returns:
        Template time [s], and its segment.
    """
    end = meta[meta.shape[0] - 1, 0] + meta[meta.shape[0] - 1, 1]
    t = guess
    for _ in range(_NEWTON):
        sample(cx, cy, meta, t, out)
        out[0] -= toe
        slope = out[2] * y - out[3] * x
        if slope < 1e-6:
            break
        step = (out[1] * x - out[0] * y) / slope
        t = min(max(t + min(max(step, -0.05), 0.05), 0.0), end)
        if abs(step) < 1e-10:
            break
    row = sample(cx, cy, meta, t, out)
    out[0] -= toe
    return t, row
