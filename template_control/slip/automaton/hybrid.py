"""A hybrid automaton: its nodes, and where each kind of stride starts among them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from template_control.errors import ParameterError
from template_control.slip.automaton.node import Edge, Node
from template_control.slip.automaton.tables import Tables, pack
from template_control.slip.automaton.vocabulary import MAX_EDGES, Event, Outcome, Phase

__all__ = ["Automaton", "Edge", "Node"]


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

    @cached_property
    def index(self) -> dict[str, int]:
        """Node name to position in :attr:`nodes`."""
        return {node.name: i for i, node in enumerate(self.nodes)}

    @cached_property
    def tables(self) -> Tables:
        """The automaton as the compiled kernels read it."""
        return pack(self.nodes)

    def node(self, name: str) -> Node:
        """The node called ``name``.

        Raises:
            KeyError: if there is none.
        """
        return self.nodes[self.index[name]]

    def start(self, stride: str) -> Node:
        """First node of a kind of stride.

        Raises:
            ParameterError: if there is no such stride.
        """
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

        Raises:
            ParameterError: if no section ends it.
        """
        found = self._sections.get(start)
        if found is None:
            found = self._sections[start] = self._find_sections(start)
        return found

    @cached_property
    def _sections(self) -> dict[str, tuple[Event, Event]]:
        """Those found so far: a robot's plans ask for them several times a stride."""
        return {}

    def _find_sections(self, start: str) -> tuple[Event, Event]:
        begin = _BEGINS[self.node(start).phase]
        ends = [edge.event for node in self.stride(start) for edge in node.edges if edge.section]
        if not ends:
            raise ParameterError(f"no section ends a stride from {start}: mark one of its edges")
        return begin, ends[0]

    def before(self, node_name: str) -> Node:
        """The node that leads to the section at which ``node_name`` begins.

        It is the first whose section leads there; for a start that is only chosen at a
        section, such as a transition's, the first whose section is the same.

        Raises:
            ParameterError: if there is none.
        """
        events = [self.sections(node_name)[0]] if node_name in self.starts.values() else []
        reached = [(node, edge) for node in self.nodes for edge in node.edges if edge.section]
        for node, edge in reached:
            if edge.target == node_name:
                return node
        for node, edge in reached:
            if edge.event in events:
                return node
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
