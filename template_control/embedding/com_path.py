"""The template's CoM path from now on, its leg forces, and curves of the CoM in time as strides.

World frame. The path is kept as the kernel's Taylor polynomials, so references of any order
come from it exactly. In stance it is looked up by phase, the direction from the rear stance
foot to the CoM (the angle beta of Section V-B); in flight, where nothing but time passes, by
time.

Where no spring carries the robot, the CoM follows quintics in time, and the ground's forces follow
from them: the centre of pressure x - y x'' / (g + y'') shares them between the feet, and each acts
along its leg.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event, Leg, Outcome, Reset
from template_control.slip.dynamics.model import ORDER
from template_control.slip.dynamics.stride import FiredEvent, Stride
from template_control.slip.maps.section import VLO

Array = NDArray[np.float64]

_NEWTON = 12
_X, _Y = np.int64(0), np.int64(1)  # Numba would compile once for each literal int


# Times of the reference template.
_OVERRUN = 0.02  # [s] that a segment's polynomial is followed past its ends: template and robot do
# not come to an event at the same time
_LEAP = 0.05  # [s], longest step of the search for a phase: far away Newton's step is too long


class Curve(NamedTuple):
    """The segments of a path, in as few arrays as can be: each costs time at every call.

    Attributes:
        coefficients: (2, n, ORDER + 1) polynomials of x and y.
        meta: (n, 7) start time, duration, node, toes, stiffnesses.
        look: (3,) x of the template's rear toe, from which x is taken [m]; how far its polynomials
            are followed past their ends, and the longest step of a search [s].
    """

    coefficients: Array
    meta: Array
    look: Array


class Landing(NamedTuple):
    """Next touchdown of a leg; (nan, inf) if it does not land on this path.

    ``x`` is its toe's in the world [m], ``time`` is on the path [s].
    """

    x: float
    time: float


@dataclass(frozen=True)
class TemplatePath:
    """Consecutive strides of the template, in one time and one world frame.

    Attributes:
        strides: of which it is made, from its start on.
        curve: the segments.
        events: time on the path [s] and guard of each event.
        landings: next touchdown of the leg that is rear, and of the one that is front, at the start
            of the path.
        toes: x of the rear and the front toe at the start [m].
        section_state: (3,) dx/dt, y, dy/dt where the first stride ends, at VLO or apex.
        outcome: how the first stride ends.
        duration: end of the last segment [s].
    """

    strides: tuple[Stride, ...]
    curve: Curve
    events: tuple[tuple[float, Event], ...]
    landings: tuple[Landing, Landing]
    toes: tuple[float, float]
    section_state: Array
    outcome: Outcome
    duration: float

    def time_of(self, event: Event, passed: int = 0) -> float:
        """Time of the next ``event`` [s], inf if there is none, once ``passed`` events are over."""
        return next((time for time, found in self.events[passed:] if found is event), np.inf)

    def event_times(self, passed: int) -> list[float]:
        """As :meth:`time_of`, of every :class:`Event` by its number."""
        found = [np.inf] * NUM_EVENTS
        for time, event in reversed(self.events[passed:]):
            found[event] = time
        return found

    def after(self, event: Event, passed: int) -> int:
        """Number of the path's events that are over once the next ``event`` is.

        ``passed`` are over already; also returned where no such event is left.
        """
        for i in range(passed, len(self.events)):
            if self.events[i][1] is event:
                return i + 1
        return passed


def join(strides: Sequence[Stride], time_unit: float = 1.0) -> TemplatePath:
    """Join strides, each of which starts where the one before ended; the section is the first's.

    ``time_unit`` is the template's over the reference template's.
    """
    meta = np.concatenate([stride.meta for stride in strides])
    coefficients = np.empty((2, len(meta), ORDER + 1))
    np.concatenate([stride.cx for stride in strides], out=coefficients[0])
    np.concatenate([stride.cy for stride in strides], out=coefficients[1])
    events, resets = [], []
    row, offset = 0, 0.0
    for stride in strides:
        if row:
            meta[row : row + len(stride.meta), 0] += offset
        for time, event, _, _, _, reset in stride.events:
            events.append((offset + time, event))
            resets.append((offset + time, reset))
        row, offset = row + len(stride.meta), offset + stride.duration
    return TemplatePath(
        strides=tuple(strides),
        curve=Curve(
            coefficients=coefficients,
            meta=meta,
            look=np.array([meta[0, 3], _OVERRUN * time_unit, _LEAP * time_unit]),
        ),
        events=tuple(events),
        landings=_landings(meta, resets),
        toes=(float(meta[0, 3]), float(meta[0, 4])),
        section_state=VLO.of(strides[0].state),
        outcome=strides[0].outcome,
        duration=offset,
    )


def _landings(meta: Array, resets: Sequence[tuple[float, Reset]]) -> tuple[Landing, Landing]:
    """Next touchdowns of the legs by the roles they have at the start."""
    found: dict[int, Landing] = {}
    legs = [Leg.REAR, Leg.FRONT]  # by present role, the role at the start
    begins = meta[:, 0].tolist()
    for time, reset in resets:
        if reset in (Reset.SHIFT, Reset.SWAP):
            legs.reverse()
        elif reset in (Reset.PLACE_REAR, Reset.PLACE_FRONT):
            role = Leg.REAR if reset is Reset.PLACE_REAR else Leg.FRONT
            later = bisect_left(begins, time - 1e-12)
            x = float(meta[later, 3 + role]) if later < len(begins) else np.nan
            found.setdefault(legs[role], Landing(x, time))
    never = Landing(np.nan, np.inf)
    return found.get(Leg.REAR, never), found.get(Leg.FRONT, never)


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
def sample(coefficients: Array, meta: Array, look: Array, time: float, out: Array) -> int:
    """Write the path at ``time`` into out (6,): x from the toe, y, and their two derivatives.

    Args:
        coefficients, meta, look: of a :class:`Curve`.
        time: on the path [s].
        out: overwritten [m, m/s, m/s^2].

    Returns:
        The segment.
    """
    row = 0
    while row + 1 < meta.shape[0] and meta[row + 1, 0] <= time:
        row += 1
    # Past either end the path goes on along its last polynomial for a moment, then stops.
    local = min(max(time - meta[row, 0], -look[1]), meta[row, 1] + look[1])
    _polynomial(coefficients[0, row], local, out, _X)
    _polynomial(coefficients[1, row], local, out, _Y)
    out[0] -= look[0]
    return row


@compiled
def at_direction(
    coefficients: Array, meta: Array, look: Array, x: float, y: float, guess: float, out: Array
) -> tuple[float, int]:
    """Time at which the template's CoM is in the direction of (x, y) [s], and its segment.

    ``x``, ``y`` are the robot's CoM relative to its rear stance foot [m]; the arrays are a
    :class:`Curve`'s; ``guess`` is a time close to the answer [s]. ``out`` (6,) is overwritten with
    the path there, x relative to the template's rear toe.
    """
    last = meta[meta.shape[0] - 1]
    end, leap = last[0] + last[1], look[2]
    t = guess
    for _ in range(_NEWTON):
        sample(coefficients, meta, look, t, out)
        slope = out[2] * y - out[3] * x
        if slope < 1e-6:
            break
        step = (out[1] * x - out[0] * y) / slope
        t = min(max(t + min(max(step, -leap), leap), 0.0), end)
        if abs(step) < 1e-10:
            break
    return t, sample(coefficients, meta, look, t, out)


# Largest normal force of a foot that is about to lift off, over the template's. It is over 1, as
# the robot's forces are not exactly the template's.
_UNLOADED = 1.3
_FLOOR = 0.025  # of the weight: it leaves a foot no load to lift off with, and the QP some room


@compiled
def unload_cap(template_force: float, weight: float) -> float:
    """Largest normal force of a foot that is about to lift off [N]: near the template's.

    ``template_force`` is the vertical force of the template's leg at this phase [N].
    """
    return _UNLOADED * max(template_force, 0.0) + _FLOOR * weight


@compiled
def leg_forces(meta_row: Array, toe: float, com: Array, body: Array, forces: Array) -> None:
    """The template's leg forces (2, 2) [N], rows rear and front, columns x and y.

    Springs push with k (l0 - l). Where none are, both legs carry m (g_y + y'') so that the centre
    of pressure is x - y (x'' + g_x) / (g_y + y''), or the foot next to it; each force acts along
    its leg. Of feet that bear the centre of pressure ahead and behind too, either one's share is
    1/2 in the middle of both, and 0 at the other end of the ground that they bear it on. The assist
    of two legs moves load from one to the other, so that it lifts nothing.

    Args:
        meta_row: (7,) toes and stiffnesses of the path's segment; NaN for legs without springs.
        toe: where x of the CoM is taken from [m].
        com: (6,) x and y of the template's CoM, and their first and second derivatives.
        body: (6,) m, g_y and g_x of gravity towards the ground and back along it, l0, the assist
            of two legs, and the half length of a foot [kg, m/s^2, m/s^2, m, m/s^2, m].
        forces: overwritten; zero for a leg in the air.
    """
    com_x, com_y, rest_length = com[0] + toe, com[1], body[3]
    if np.isnan(meta_row[5]):
        lift = max(body[1] + com[5], 1e-6)  # legs do not pull
        rear, front = meta_row[3], meta_row[4]
        share = com_x - com_y * (com[4] + body[2]) / lift - (rear - body[5])
        share /= front - rear + 2.0 * body[5]
        share = min(max(share, 0.0), 1.0)
        for leg in range(2):
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


TERMS = 6
"""Coefficients of a quintic."""


class Quintic(NamedTuple):
    """A piece of a curve, of a duration [s].

    ``coefficients`` (2, 6) are of x and y, constant term first, x in the world [m].
    """

    coefficients: Array
    duration: float

    def end(self) -> Array:
        """(2, 3) x and y, each position, velocity, acceleration, where it ends."""
        return derivatives(self.coefficients, np.array(self.duration))


def quintics(start: Array, ends: Array, durations: Array) -> Array:
    """Coefficients (..., 2, 6) of the quintics from ``start`` to ``ends``, constant term first.

    Both ends (..., 2, 3) are x and y, each position, velocity, acceleration; durations (...) [s].
    """
    t = np.asarray(durations, dtype=float)[..., None]
    p, v, a = start[..., 0], start[..., 1], start[..., 2]
    distance = ends[..., 0] - p - v * t - 0.5 * a * t**2
    speed = (ends[..., 1] - v - a * t) * t
    rate = (ends[..., 2] - a) * t**2
    found = np.empty((*distance.shape, TERMS))
    found[..., 0], found[..., 1], found[..., 2] = p, v, 0.5 * a
    found[..., 3] = (10.0 * distance - 4.0 * speed + 0.5 * rate) / t**3
    found[..., 4] = (-15.0 * distance + 7.0 * speed - rate) / t**4
    found[..., 5] = (6.0 * distance - 3.0 * speed + 0.5 * rate) / t**5
    return found


def derivatives(coefficients: Array, times: Array) -> Array:
    """Values (..., 3) of polynomials (..., n), their first and their second derivatives.

    Constant terms are first; the shape of ``times`` [s] broadcasts with the polynomials'.
    """
    p = d = dd = np.zeros(np.broadcast_shapes(coefficients.shape[:-1], np.shape(times)))
    for n in range(coefficients.shape[-1] - 1, -1, -1):
        dd = dd * times + d
        d = d * times + p
        p = p * times + coefficients[..., n]
    return np.stack((p, d, 2.0 * dd), axis=-1)


def timed_stride(
    automaton: Automaton, node: str, pieces: Sequence[Quintic], toes: tuple[float, float]
) -> Stride:
    """The stride along a curve, to the first event that leads out of its node.

    Each of the ``pieces`` starts where the one before ends; ``toes`` are x of the rear and the
    front foot [m].
    """
    edge = next(edge for edge in automaton.node(node).edges if isinstance(edge.target, str))
    durations = np.array([piece.duration for piece in pieces])
    starts = np.cumsum(durations) - durations
    paths = np.zeros((2, len(pieces), ORDER + 1))
    for i, piece in enumerate(pieces):
        paths[:, i, :TERMS] = piece.coefficients
    number = automaton.index[node]
    meta = np.array(
        [
            (begin, piece.duration, number, *toes, np.nan, np.nan)
            for begin, piece in zip(starts, pieces, strict=True)
        ]
    )
    (x, dx, _), (y, dy, _) = pieces[-1].end()
    state = np.array([x, y, dx, dy])
    event = FiredEvent(
        float(durations.sum()), edge.event, node, str(edge.target), state, edge.reset
    )
    exchanged = edge.reset in (Reset.SHIFT, Reset.SWAP)
    after = np.array(toes[::-1] if exchanged else toes)
    return Stride(
        outcome=Outcome.SECTION,
        node=str(edge.target),
        state=state,
        toes=after,
        duration=event.time,
        events=(event,),
        cx=paths[0],
        cy=paths[1],
        meta=meta,
        node_names=tuple(automaton.index),
    )


def chained(first: Stride, second: Stride) -> Stride:
    """Two parts of one stride; the second starts where the first ended, at an event within it."""
    meta = second.meta.copy()
    meta[:, 0] += first.duration
    events = (event._replace(time=first.duration + event.time) for event in second.events)
    return replace(
        second,
        duration=first.duration + second.duration,
        events=(*first.events, *events),
        cx=np.concatenate((first.cx, second.cx)),
        cy=np.concatenate((first.cy, second.cy)),
        meta=np.concatenate((first.meta, meta)),
    )
