"""Strides along curves of the CoM in time, where no spring carries it: quintics, end to end.

The ground's forces follow from them: the centre of pressure x - y x'' / (g + y'') shares them
between the feet, and each acts along its leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import Outcome, Reset
from template_control.slip.dynamics.model import ORDER
from template_control.slip.dynamics.stride import FiredEvent, Stride

TERMS = 6
"""Coefficients of a quintic."""


@compiled
def quintic(start: Array, end: Array, duration: float, c: Array) -> None:
    """Write the coefficients ``c`` (6,) of the quintic between two ends, constant term first.

    Both ends (3,) are position, velocity, acceleration; the duration is in [s].
    """
    t, p, v, a = duration, start[0], start[1], start[2]
    d = end[0] - p - v * t - 0.5 * a * t * t
    w, h = (end[1] - v - a * t) * t, (end[2] - a) * t * t
    c[0], c[1], c[2] = p, v, 0.5 * a
    c[3] = (10.0 * d - 4.0 * w + 0.5 * h) / t**3
    c[4] = (-15.0 * d + 7.0 * w - h) / t**4
    c[5] = (6.0 * d - 3.0 * w + 0.5 * h) / t**5


@compiled
def polynomial(c: Array, t: float) -> tuple[float, float, float]:
    """Value of a polynomial (n,), constant term first, and its first two derivatives."""
    p = d = dd = 0.0
    for n in range(c.shape[0] - 1, -1, -1):
        dd = dd * t + d
        d = d * t + p
        p = p * t + c[n]
    return p, d, 2.0 * dd


class Quintic(NamedTuple):
    """A piece of a curve, of a duration [s].

    ``coefficients`` (2, 6) are of x and y, constant term first, x in the world [m].
    """

    coefficients: Array
    duration: float

    @classmethod
    def between(cls, start: Array, end: Array, duration: float) -> Quintic:
        """As :func:`quintic`, with ends (2, 3) of x and y; NumPy rounds t**3 otherwise."""
        t, (p, v, a) = np.array([duration]), start.T
        d = end[:, 0] - p - v * t - 0.5 * a * t**2
        w, h = (end[:, 1] - v - a * t) * t, (end[:, 2] - a) * t**2
        cubic = (10.0 * d - 4.0 * w + 0.5 * h) / t**3
        quartic = (-15.0 * d + 7.0 * w - h) / t**4
        last = (6.0 * d - 3.0 * w + 0.5 * h) / t**5
        return cls(np.column_stack((p, v, 0.5 * a, cubic, quartic, last)), duration)

    def end(self) -> Array:
        """(2, 3) x and y, each position, velocity, acceleration, where it ends."""
        return np.array([polynomial(c, self.duration) for c in self.coefficients])


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
    meta = np.full((len(pieces), 7), np.nan)
    meta[:, :2] = np.column_stack((starts, durations))
    meta[:, 2], meta[:, 3:5] = automaton.index[node], toes
    (x, dx, _), (y, dy, _) = pieces[-1].end()
    state = np.array([x, y, dx, dy])
    duration, after = float(durations.sum()), str(edge.target)
    event = FiredEvent(duration, edge.event, node, after, state, edge.reset)
    exchanged = edge.reset in (Reset.SHIFT, Reset.SWAP)
    return Stride(
        outcome=Outcome.SECTION,
        node=after,
        state=state,
        toes=np.array(toes[::-1] if exchanged else toes),
        duration=duration,
        events=(event,),
        cx=paths[0],
        cy=paths[1],
        meta=meta,
        node_names=tuple(automaton.index),
    )
