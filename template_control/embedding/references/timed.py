"""Curves of the CoM in time, as strides: a path is read alike, whatever made it.

Where no spring carries the robot, the CoM follows quintics, and the ground's forces follow from
them: the centre of pressure x - y x'' / (g + y'') shares them between the feet, and each acts
along its leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import Outcome, Reset
from template_control.slip.dynamics.model import ORDER
from template_control.slip.dynamics.stride import FiredEvent, Stride

Array = NDArray[np.float64]

TERMS = 6
"""Coefficients of a quintic."""


class Quintic(NamedTuple):
    """A piece of a curve.

    Attributes:
        coefficients: (2, 6) of x and y, constant term first, x in the world [m].
        duration: [s].
    """

    coefficients: Array
    duration: float

    def end(self) -> Array:
        """(2, 3) x and y, each position, velocity, acceleration, where it ends."""
        return derivatives(self.coefficients, np.array(self.duration))


def quintics(start: Array, ends: Array, durations: Array) -> Array:
    """Coefficients (..., 2, 6) of the quintics from ``start`` to ``ends``, constant term first.

    Args:
        start: (..., 2, 3) x and y, each position, velocity, acceleration.
        ends: (..., 2, 3) the same at the end.
        durations: (...) [s].
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

    Args:
        coefficients: constant term first.
        times: (...) [s], of a shape that broadcasts with the polynomials'.
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

    Args:
        automaton: of the stride.
        node: the robot's.
        pieces: of the curve, each from where the one before ends.
        toes: x of the rear and the front foot [m].
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
    """Two parts of one stride; the second starts where the first ended.

    Args:
        first: to an event within the stride.
        second: from there on.
    """
    meta = second.meta.copy()
    meta[:, 0] += first.duration
    events = (
        FiredEvent(first.duration + e.time, e.event, e.source, e.target, e.state, e.reset)
        for e in second.events
    )
    return Stride(
        outcome=second.outcome,
        node=second.node,
        state=second.state,
        toes=second.toes,
        duration=first.duration + second.duration,
        events=(*first.events, *events),
        cx=np.concatenate((first.cx, second.cx)),
        cy=np.concatenate((first.cy, second.cy)),
        meta=np.concatenate((first.meta, meta)),
        node_names=first.node_names,
    )
