"""What a hybrid automaton is made of: nodes, and edges with guards and resets."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.slip.automaton.vocabulary import Event, Leg, Outcome, Phase, Reset, Slot

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
