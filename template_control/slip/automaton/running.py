"""The nodes of a running stride."""

from __future__ import annotations

from template_control.slip.automaton.failures import (
    FLIGHT_FAILURES,
    RUNNING_STANCE_FAILURES,
)
from template_control.slip.automaton.node import Edge, Node
from template_control.slip.automaton.vocabulary import Event, Phase, Reset, Slot


def running() -> tuple[Node, ...]:
    """Apex -> touchdown -> bottom -> liftoff -> apex."""
    return (
        Node(
            "F_aa^r",
            Phase.F,
            None,
            None,
            (Edge(Event.TOUCHDOWN, "SS_sc^r", Reset.PLACE_REAR, "G_t^r"), *FLIGHT_FAILURES),
        ),
        Node(
            "SS_sc^r",
            Phase.SS,
            Slot.K_SC,
            None,
            (Edge(Event.BOTTOM, "SS_sd^r", Reset.NONE, "G_b^r"), *RUNNING_STANCE_FAILURES),
        ),
        Node(
            "SS_sd^r",
            Phase.SS,
            Slot.K_SD,
            None,
            (
                Edge(Event.REAR_LIFTOFF, "F_ba^r", Reset.SWAP, "G_l^r"),
                *RUNNING_STANCE_FAILURES,
            ),
        ),
        Node(
            "F_ba^r",
            Phase.F,
            None,
            None,
            (Edge(Event.APEX, "F_aa^r", Reset.NONE, "G_a^r", section=True), *FLIGHT_FAILURES),
        ),
    )
