"""The template's CoM path from now on, and its leg forces.

World frame. The path is kept as the kernel's Taylor polynomials, so references of any order
come from it exactly. It is looked up by time, or by the direction from the rear stance foot.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event, Leg, Reset
from template_control.slip.dynamics.stride import FiredEvent, Stride, chained
from template_control.slip.dynamics.timed import polynomial
from template_control.slip.maps.section import VLO

_NEWTON = 12
# Times of the reference template.
_OVERRUN = 0.02  # [s] that a segment's polynomial is followed past its ends: template and robot do
# not come to an event at the same time
_LEAP = 0.05  # [s], longest step of the search for a phase: far away Newton's step is too long


class Curve(NamedTuple):
    """The segments of a path, in as few arrays as can be: each costs time at every call."""

    coefficients: Array  # (2, n, ORDER + 1) polynomials of x and y
    meta: Array  # (n, 7) start time, duration, node, toes, stiffnesses
    # (3,) x of the template's rear toe, from which x is taken [m]; how far the polynomials are
    # followed past their ends, and the longest step of a search [s]
    look: Array


class Landing(NamedTuple):
    """Next touchdown of a leg; (nan, inf) if it does not land on this path."""

    x: float  # of its toe in the world [m]
    time: float  # on the path [s]


@dataclass(frozen=True)
class TemplatePath:
    """Consecutive strides of the template, in one time and one world frame."""

    strides: tuple[Stride, ...]  # of which it is made, from its start on
    curve: Curve  # the segments
    events: tuple[FiredEvent, ...]  # times are on the path
    landings: tuple[Landing, Landing]  # of the legs that are rear and front at the start
    toes: tuple[float, float]  # x of the rear and the front toe at the start [m]
    section_state: Array  # (3,) dx/dt, y, dy/dt where the first stride ends, at VLO or apex

    def time_of(self, event: Event, passed: int = 0) -> float:
        """Time of the next ``event`` [s], inf if there is none, once ``passed`` events are over."""
        return next((e.time for e in self.events[passed:] if e.event is event), np.inf)

    def event_times(self, passed: int) -> list[float]:
        """As :meth:`time_of`, of every :class:`Event` by its number."""
        found = [np.inf] * NUM_EVENTS
        for time, event, *_ in reversed(self.events[passed:]):
            found[event] = time
        return found

    def after(self, event: Event, passed: int) -> int:
        """Number of the path's events that are over once the next ``event`` is, if there is one."""
        later = range(passed, len(self.events))
        return next((i + 1 for i in later if self.events[i].event is event), passed)


def join(strides: Sequence[Stride], time_unit: float = 1.0) -> TemplatePath:
    """Join strides, each of which starts where the one before ended; the section is the first's.

    ``time_unit`` is the template's over the reference template's.
    """
    whole = chained(*strides)
    rear, front = whole.meta[0, 3:5].tolist()
    return TemplatePath(
        strides=tuple(strides),
        curve=Curve(
            coefficients=np.array([whole.cx, whole.cy]),
            meta=whole.meta,
            look=np.array([rear, _OVERRUN * time_unit, _LEAP * time_unit]),
        ),
        events=whole.events,
        landings=_landings(whole),
        toes=(rear, front),
        section_state=VLO.of(strides[0].state),
    )


def _landings(stride: Stride) -> tuple[Landing, Landing]:
    """Next touchdowns of the legs by the roles they have at the start."""
    found: dict[int, Landing] = {}
    legs = [Leg.REAR, Leg.FRONT]  # by present role, the role at the start
    begins = stride.meta[:, 0].tolist()
    for time, *_, reset in stride.events:
        if reset in (Reset.SHIFT, Reset.SWAP):
            legs.reverse()
        elif reset in (Reset.PLACE_REAR, Reset.PLACE_FRONT):
            role = Leg.REAR if reset is Reset.PLACE_REAR else Leg.FRONT
            later = bisect_left(begins, time - 1e-12)
            x = float(stride.meta[later, 3 + role]) if later < len(begins) else np.nan
            found.setdefault(legs[role], Landing(x, time))
    never = Landing(np.nan, np.inf)
    return found.get(Leg.REAR, never), found.get(Leg.FRONT, never)


@compiled
def sample(curve: tuple[Array, Array, Array], time: float, out: Array) -> int:
    """Write the path at ``time`` into out (6,): x from the toe, y, and their two derivatives.

    Args:
        curve: a :class:`Curve`, or its plain tuple.
        time: on the path [s].
        out: overwritten [m, m/s, m/s^2].

    Returns:
        The segment.
    """
    (coefficients, meta, look), row = curve, 0
    while row + 1 < meta.shape[0] and meta[row + 1, 0] <= time:
        row += 1
    # Past either end the path goes on along its last polynomial for a moment, then stops.
    local = min(max(time - meta[row, 0], -look[1]), meta[row, 1] + look[1])
    out[0], out[2], out[4] = polynomial(coefficients[0, row], local)
    out[1], out[3], out[5] = polynomial(coefficients[1, row], local)
    out[0] -= look[0]
    return row


@compiled
def at_direction(
    curve: tuple[Array, Array, Array], x: float, y: float, guess: float, out: Array
) -> tuple[float, int]:
    """Time at which the template's CoM is in the direction of (x, y) [s], and its segment.

    ``x``, ``y`` are the robot's CoM relative to its rear stance foot [m]; ``guess`` is a time close
    to the answer [s]. The path there is written into ``out`` (6,), as by :func:`sample`.
    """
    _, meta, look = curve
    end, leap, t = meta[-1, 0] + meta[-1, 1], look[2], guess
    for _ in range(_NEWTON):
        sample(curve, t, out)
        slope = out[2] * y - out[3] * x
        if slope < 1e-6:
            break
        step = (out[1] * x - out[0] * y) / slope
        t = min(max(t + min(max(step, -leap), leap), 0.0), end)
        if abs(step) < 1e-10:
            break
    return t, sample(curve, t, out)


@compiled
def leg_forces(meta_row: Array, toe: float, com: Array, body: Array, forces: Array) -> None:
    """The template's leg forces (2, 2) [N], rows rear and front, columns x and y.

    Springs push with k (l0 - l). Where none are, both legs carry m (g_y + y'') so that the centre
    of pressure is x - y (x'' + g_x) / (g_y + y''), or the foot next to it; each force acts along
    its leg. Of feet that bear the centre of pressure ahead and behind too, either one's share is
    1/2 in the middle of both, and 0 at the other end of the ground that they bear it on. The assist
    of two legs moves load from one to the other, so that it lifts nothing.

    ``meta_row`` (7,) is of the path's segment, its stiffnesses NaN for legs without springs;
    ``com`` (6,) is as :func:`sample` writes it, x from ``toe`` [m]; ``body`` is that of ``PATH``.
    ``forces`` are zero for a leg in the air.
    """
    com_x, com_y, rest_length = com[0] + toe, com[1], body[3]
    if np.isnan(meta_row[5]):
        lift = max(body[1] + com[5], 1e-6)  # legs do not pull
        rear, front = meta_row[3], meta_row[4]
        share = com_x - com_y * (com[4] + body[2]) / lift - (rear - body[5])
        share /= front - rear + 2.0 * body[5]
        share = min(max(share, 0.0), 1.0)
        forces[1] = 0.0
        if np.isnan(front):  # in the air
            share = 0.0
        for leg in range(1 if np.isnan(front) else 2):
            load = body[0] * lift * (share if leg == 1 else 1.0 - share)
            forces[leg, 0] = load * (com_x - meta_row[3 + leg]) / com_y
            forces[leg, 1] = load
        return
    for leg in range(2):
        k = meta_row[5 + leg]
        dx = com_x - meta_row[3 + leg]
        length = np.sqrt(dx * dx + com_y * com_y)
        size = max(0.0, k * (rest_length - length)) / length
        forces[leg, 0], forces[leg, 1] = size * dx, size * com_y
    if body[4] == 0.0 or meta_row[5] == 0.0 or meta_row[6] == 0.0:
        return
    moved = body[0] * body[4] / (meta_row[4] - meta_row[3])
    for leg in range(2):
        share = moved if leg == 0 else -moved
        forces[leg, 0] += share * (com_x - meta_row[3 + leg])
        forces[leg, 1] += share * com_y
        if forces[leg, 1] < 0.0:
            forces[leg, 0], forces[leg, 1] = 0.0, 0.0  # legs do not pull
