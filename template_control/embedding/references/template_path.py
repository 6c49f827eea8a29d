"""The template's path from now on, as far as it is planned, and where the robot is on it.

World frame. The path is kept as the kernel's Taylor polynomials, so references of any order
come from it exactly. In stance it is looked up by phase, the direction from the rear stance
foot to the CoM (the angle beta of Section V-B); in flight, where nothing but time passes, by
time.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.compiled import compiled
from template_control.embedding.phases import Clock
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event, Leg, Outcome, Reset
from template_control.slip.dynamics.model import ORDER
from template_control.slip.dynamics.stride import Stride
from template_control.slip.maps.section import VLO
from template_control.slip.similarity import TIME, tuned

Array = NDArray[np.float64]

_NEWTON = 12
_X, _Y = np.int64(0), np.int64(1)  # Numba would compile once for each literal int


@dataclass(frozen=True)
class PathOptions(Checked):
    """How the robot's place on a path is looked for.

    Attributes:
        overrun: a segment's polynomial is followed this long past its ends [s]: template and
            robot do not come to an event at the same time.
        leap: longest step of the search for a phase [s]. Far from the answer Newton's step is
            too long.
    """

    overrun: NotNegative = tuned(0.02, TIME)
    leap: Positive = tuned(0.05, TIME)


class Curve(NamedTuple):
    """The segments of a path, in as few arrays as can be: each costs time at every call.

    Attributes:
        coefficients: (2, n, ORDER + 1) polynomials of x and y.
        meta: (n, 7) start time, duration, node, toes, stiffnesses.
        look: (3,) x of the template's rear toe, from which x is taken [m]; overrun and leap of
            the :class:`PathOptions` [s].
    """

    coefficients: Array
    meta: Array
    look: Array


class Landing(NamedTuple):
    """Where and when a leg next touches down; (nan, inf) if it does not land on this path.

    Attributes:
        x: of its toe in the world [m].
        time: on the path [s].
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
        landings: next touchdown of the leg that is rear, and of the one that is front, at the
            start of the path.
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

    def due(self, event: Event, passed: int = 0) -> float:
        """Time of the next ``event`` [s], inf if there is none.

        Args:
            event: the guard.
            passed: number of the path's events that are over already.
        """
        return next((time for time, found in self.events[passed:] if found is event), np.inf)

    def dues(self, passed: int) -> list[float]:
        """As :meth:`due`, of every :class:`Event` by its number."""
        found = [np.inf] * NUM_EVENTS
        for time, event in reversed(self.events[passed:]):
            found[event] = time
        return found

    def after(self, event: Event, passed: int) -> int:
        """How many of the path's events are over once the next ``event`` is.

        Args:
            event: the guard that fires.
            passed: number of the path's events that are over already.

        Returns:
            The new number; ``passed`` where no such event is left.
        """
        for i in range(passed, len(self.events)):
            if self.events[i][1] is event:
                return i + 1
        return passed


def join(strides: Sequence[Stride], options: PathOptions | None = None) -> TemplatePath:
    """Join strides, each of which starts where the one before ended.

    Args:
        strides: at least one; the path's section is the first one's.
        options: how the path is looked up.
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
    o = options or PathOptions()
    return TemplatePath(
        strides=tuple(strides),
        curve=Curve(
            coefficients=coefficients,
            meta=meta,
            look=np.array([meta[0, 3], o.overrun, o.leap]),
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
    """Time at which the template sees its CoM in the direction of (x, y), and its path there.

    Args:
        coefficients, meta, look: of a :class:`Curve`.
        x, y: the robot's CoM relative to its rear stance foot [m].
        guess: a time close to the answer [s].
        out: (6,) overwritten with the path there, x relative to the template's rear toe.

    Returns:
        Template time [s], and its segment.
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


@compiled
def at_time(
    coefficients: Array, meta: Array, look: Array, x: float, y: float, guess: float, out: Array
) -> tuple[float, int]:
    """As :func:`at_direction`, but the time is ``guess`` itself, wherever the robot is."""
    return guess, sample(coefficients, meta, look, guess, out)


Locate = Callable[[Array, Array, Array, float, float, float, Array], tuple[float, int]]
"""Arguments and results of :func:`at_direction`."""

LOCATE: dict[Clock, Locate] = {Clock.DIRECTION: at_direction, Clock.TIME: at_time}
"""How a phase's clock finds the robot's place on the path."""
