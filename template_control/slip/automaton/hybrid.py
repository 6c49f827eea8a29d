"""Hybrid automata: nodes, edges with guards and resets, and their tables for compiled code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from template_control.arrays import IntArray
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import (
    MAX_EDGES,
    Event,
    Leg,
    Outcome,
    Phase,
    Reset,
    Slot,
)

_STANCE = {Phase.F: (), Phase.SS: (Leg.REAR,), Phase.DS: (Leg.REAR, Leg.FRONT)}


@dataclass(frozen=True)
class Edge:
    """A transition: when ``event`` fires, apply ``reset`` and go to ``target``.

    Attributes:
        event: the guard.
        target: name of the successor node, or the failure the stride ends with.
        reset: what happens to the toes.
        guard: the guard's name in Fig. 2 (empty for failures).
        section: True where a stride ends (VLO or apex), and the next begins at ``target``.
    """

    event: Event
    target: str | Outcome
    reset: Reset = Reset.NONE
    guard: str = ""
    section: bool = False


@dataclass(frozen=True)
class Node:
    """A circle of Fig. 2, ``phase_subphase^gait``; leg stiffness is constant in it.

    Attributes:
        name: the node's name, such as ``"DS_sc^w"``.
        phase: flight, single or double stance.
        rear: stiffness slot of the rear (in single stance: the only) leg, None in the air.
        front: stiffness slot of the front leg, None in the air.
        edges: the ways out, failures included.
    """

    name: str
    phase: Phase
    rear: Slot | None
    front: Slot | None
    edges: tuple[Edge, ...]

    @property
    def gait(self) -> str:
        """Superscript of the name: ``"wr"`` of ``"SS_av^wr"``."""
        return self.name.partition("^")[2]

    @property
    def stance(self) -> tuple[Leg, ...]:
        """The legs on the ground: none in flight, the rear one in single stance, or both."""
        return _STANCE[self.phase]

    def edge(self, event: Event) -> Edge | None:
        """The edge that ``event`` fires, or None."""
        return next((e for e in self.edges if e.event is event), None)


class Tables(NamedTuple):
    """Arrays that a compiled kernel interprets."""

    rear: IntArray  # (nodes,) stiffness slot of the rear leg, -1 in the air
    front: IntArray  # the same of the front leg
    first_edge: IntArray  # (nodes + 1,) edges of node i are first_edge[i] : first_edge[i + 1]
    event: IntArray  # (edges,) value of the guard's Event
    target: IntArray  # (edges,) successor node, -1 where the stride fails
    reset: IntArray  # (edges,) value of the Reset
    outcome: IntArray  # (edges,) -1 if the stride goes on, else the Outcome it ends with


_BEGINS = {Phase.F: Event.APEX, Phase.SS: Event.VLO, Phase.DS: Event.REST}
"""The section at which a stride begins, by the phase of its first node."""


@dataclass(frozen=True)
class Automaton:
    """Nodes of gaits and of the strides between them.

    Attributes:
        nodes: in the order that numbers them.
        starts: first node of each kind of stride.

    Raises:
        ParameterError: naming the first node, edge or start that leads nowhere.
    """

    nodes: tuple[Node, ...]
    starts: Mapping[str, str] = field(hash=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "starts", dict(self.starts))
        _check(self)

    def __repr__(self) -> str:
        return f"Automaton({len(self.nodes)} nodes, strides {', '.join(map(str, self.starts))})"

    @cached_property
    def index(self) -> dict[str, int]:
        """Node name to position in :attr:`nodes`."""
        return {node.name: i for i, node in enumerate(self.nodes)}

    @cached_property
    def tables(self) -> Tables:
        """The automaton as the compiled kernels read it."""
        rows, slots = [], []
        for node in self.nodes:
            slots.append([-1 if slot is None else slot for slot in (node.rear, node.front)])
            for edge in node.edges:
                if isinstance(edge.target, Outcome):
                    target, outcome = -1, int(edge.target)
                else:
                    target = self.index[edge.target]
                    outcome = Outcome.SECTION if edge.section else -1
                rows.append((edge.event, target, edge.reset, outcome))
        rear, front = np.array(slots, dtype=np.int64).reshape(-1, 2).T.copy()
        first_edge = np.cumsum([0, *(len(node.edges) for node in self.nodes)], dtype=np.int64)
        return Tables(
            rear, front, first_edge, *np.array(rows, dtype=np.int64).reshape(-1, 4).T.copy()
        )

    def node(self, name: str) -> Node:
        """The node called ``name``; a KeyError if there is none."""
        return self.nodes[self.index[name]]

    def start(self, stride: str) -> Node:
        """First node of a kind of stride; a ParameterError if there is no such stride."""
        if stride not in self.starts:
            raise ParameterError(f"no stride {stride!r}: give one of {', '.join(self.starts)}")
        return self.node(self.starts[stride])

    def stride(self, start: str) -> tuple[Node, ...]:
        """Nodes a stride from ``start`` can pass, in order of first arrival."""
        found = [self.node(start)]
        for node in found:
            for edge in node.edges:
                if isinstance(edge.target, str) and not edge.section:
                    target = self.node(edge.target)
                    if target not in found:
                        found.append(target)
        return tuple(found)

    def sections(self, start: str) -> tuple[Event, Event]:
        """Sections (VLO, APEX or REST) at which a stride from ``start`` begins and ends.

        A ParameterError if no section ends it.
        """
        if start not in self._sections:
            edges = [edge for node in self.stride(start) for edge in node.edges if edge.section]
            if not edges:
                raise ParameterError(f"no section ends a stride from {start}: mark an edge of it")
            self._sections[start] = _BEGINS[self.node(start).phase], edges[0].event
        return self._sections[start]

    @cached_property
    def _sections(self) -> dict[str, tuple[Event, Event]]:
        """Those found so far: a robot's plans ask for them several times a stride."""
        return {}

    def before(self, node_name: str) -> Node:
        """The node that leads to the section at which ``node_name`` begins.

        It is the first whose section leads there; for a start that is only chosen at a
        section, such as a transition's, the first whose section is the same. A ParameterError if
        there is none.
        """
        reached = [(node, edge) for node in self.nodes for edge in node.edges if edge.section]
        found = [node for node, edge in reached if edge.target == node_name]
        if not found and node_name in self.starts.values():
            event = self.sections(node_name)[0]
            found = [node for node, edge in reached if edge.event is event]
        if found:
            return found[0]
        raise ParameterError(f"no section leads to {node_name}: give the start of a stride")

    def successor(self, name: str, event: Event) -> str:
        """Name of the node that follows ``name`` when ``event`` fires.

        Args:
            name: of the node that is left.
            event: the guard of one of its edges.

        Raises:
            KeyError: if there is no node ``name``, or ``event`` is no way out of it, or ends the
                stride in failure.
        """
        edge = self.node(name).edge(event)
        if edge is None or isinstance(edge.target, Outcome):
            raise KeyError(f"{event.name} leads nowhere from {name}")
        return edge.target


def _check(automaton: Automaton) -> None:
    """Raise a ParameterError for the first thing that makes a stride impossible to follow."""
    names = [node.name for node in automaton.nodes]
    for node in automaton.nodes:
        if names.count(node.name) > 1:
            raise ParameterError(f"two nodes are called {node.name}: give each its own name")
        _check_edges(node, names)
    for stride, name in automaton.starts.items():
        if name not in names:
            raise ParameterError(
                f"stride {stride!r} starts at {name}, which is no node: give one of"
                f" {', '.join(names) or 'them'}"
            )


def _check_edges(node: Node, names: list[str]) -> None:
    events = [edge.event for edge in node.edges]
    if not events:
        raise ParameterError(f"node {node.name} has no way out: give it an edge")
    if len(events) > MAX_EDGES:
        raise ParameterError(
            f"node {node.name} has {len(events)} edges: give it at most {MAX_EDGES}"
        )
    for edge in node.edges:
        where = f"{edge.event.name} of node {node.name}"
        if events.count(edge.event) > 1:
            raise ParameterError(f"{where} has two edges: leave one")
        if edge.section and isinstance(edge.target, Outcome):
            raise ParameterError(f"{where} ends at a section: give it a node as target")
        if edge.target is Outcome.SECTION:
            raise ParameterError(f"{where} fails with SECTION: give another outcome or a node")
        if isinstance(edge.target, str) and edge.target not in names:
            raise ParameterError(f"{where} leads to {edge.target}, which is no node: name one")
