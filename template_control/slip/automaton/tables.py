"""The automaton packed into integer arrays, the form the compiled kernel reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.node import Node
from template_control.slip.automaton.vocabulary import Outcome

IntArray = NDArray[np.int64]


class Tables(NamedTuple):
    """Arrays that a compiled kernel interprets.

    Attributes:
        rear: (nodes,) stiffness slot of the rear leg, -1 in the air.
        front: (nodes,) stiffness slot of the front leg, -1 in the air.
        first_edge: (nodes + 1,) edges of node i are ``first_edge[i]:first_edge[i + 1]``.
        event: (edges,) value of the guard's :class:`Event`.
        target: (edges,) successor node, -1 where the stride fails.
        reset: (edges,) value of the :class:`Reset`.
        outcome: (edges,) -1 if the stride goes on, else the :class:`Outcome` it ends with.
    """

    rear: IntArray
    front: IntArray
    first_edge: IntArray
    event: IntArray
    target: IntArray
    reset: IntArray
    outcome: IntArray


def pack(nodes: Sequence[Node]) -> Tables:
    """Pack an automaton's ``nodes`` into :class:`Tables`."""
    index = {node.name: i for i, node in enumerate(nodes)}
    edges = [edge for node in nodes for edge in node.edges]
    counts = [len(node.edges) for node in nodes]

    def array(values: list[int]) -> IntArray:
        return np.array(values, dtype=np.int64)

    return Tables(
        rear=array([-1 if n.rear is None else int(n.rear) for n in nodes]),
        front=array([-1 if n.front is None else int(n.front) for n in nodes]),
        first_edge=array([0, *np.cumsum(counts).tolist()]),
        event=array([int(e.event) for e in edges]),
        target=array([-1 if isinstance(e.target, Outcome) else index[e.target] for e in edges]),
        reset=array([int(e.reset) for e in edges]),
        outcome=array(
            [
                int(e.target)
                if isinstance(e.target, Outcome)
                else (int(Outcome.SECTION) if e.section else -1)
                for e in edges
            ]
        ),
    )
