"""What a hybrid automaton is made of: nodes, and edges with guards and resets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset, Slot


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

    def edge(self, event: Event) -> Edge | None:
        """The first edge that ``event`` fires, or None."""
        return next((e for e in self.edges if e.event is event), None)


@dataclass(frozen=True)
class Automaton:
    """Nodes of the walking and running gaits and of both transition strides."""

    nodes: tuple[Node, ...]

    @cached_property
    def index(self) -> dict[str, int]:
        """Node name to position in :attr:`nodes`."""
        return {node.name: i for i, node in enumerate(self.nodes)}

    def node(self, name: str) -> Node:
        """The node called ``name``.

        Raises:
            KeyError: if there is none.
        """
        return self.nodes[self.index[name]]

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
        """Sections (VLO or APEX) at which a stride from ``start`` begins and ends."""
        begin = Event.APEX if self.node(start).phase is Phase.F else Event.VLO
        end = next(e.event for n in self.stride(start) for e in n.edges if e.section)
        return begin, end

    def successor(self, name: str, event: Event) -> str:
        """Name of the node that follows ``name`` when ``event`` fires.

        Raises:
            KeyError: if ``event`` is no way out of it, or ends the stride in failure.
        """
        edge = self.node(name).edge(event)
        if edge is None or isinstance(edge.target, Outcome):
            raise KeyError(f"{event.name} leads nowhere from {name}")
        return edge.target
