"""The nodes of the strides between walking and running (Section IV-C)."""

from __future__ import annotations

from template_control.slip.automaton.failures import (
    AWAITING_TOUCHDOWN_FAILURES,
    DOUBLE_STANCE_FAILURES,
    FLIGHT_FAILURES,
    RUNNING_STANCE_FAILURES,
    SINGLE_STANCE_FAILURES,
)
from template_control.slip.automaton.node import Edge, Node
from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset, Slot


def walk_to_run() -> tuple[Node, ...]:
    """The WRT stride: the rear leg walks, the front leg runs (Section IV-C1)."""
    return (
        Node(
            "SS_av^wr",
            Phase.SS,
            Slot.K_SC,
            None,
            (
                Edge(Event.TOUCHDOWN, "DS_sc^wr", Reset.PLACE_FRONT, "G_t^wr"),
                # A walker that is too fast takes off before.
                Edge(Event.REAR_LIFTOFF, "F_aa^wr", Reset.SWAP, "G_l^wr"),
                *AWAITING_TOUCHDOWN_FAILURES[1:],
            ),
        ),
        Node(
            "F_aa^wr",
            Phase.F,
            None,
            None,
            (Edge(Event.TOUCHDOWN, "SS_sc^wr", Reset.PLACE_REAR, "G_t^wr"), *FLIGHT_FAILURES),
        ),
        Node(
            "DS_sc^wr",
            Phase.DS,
            Slot.K_SC,
            Slot.K_SC,
            (
                Edge(Event.VIRTUAL_BOTTOM, "DS_sd^wr", Reset.NONE, "G_b^wr"),
                Edge(Event.REAR_LIFTOFF, "SS_sc^wr", Reset.SHIFT, "G_r^wr"),
                *DOUBLE_STANCE_FAILURES,
            ),
        ),
        Node(
            "DS_sd^wr",
            Phase.DS,
            Slot.K_SD,
            Slot.K_SC_WR,
            (
                Edge(Event.REAR_LIFTOFF, "SS_sc^wr", Reset.SHIFT, "G_r^wr"),
                *DOUBLE_STANCE_FAILURES,
            ),
        ),
        Node(
            "SS_sc^wr",
            Phase.SS,
            Slot.K_SC_WR,
            None,
            (
                Edge(Event.BOTTOM, "SS_sd^wr", Reset.NONE, "G_b^wr"),
                Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
                *RUNNING_STANCE_FAILURES,
            ),
        ),
        Node(
            "SS_sd^wr",
            Phase.SS,
            Slot.K_SD_WR,
            None,
            (
                Edge(Event.REAR_LIFTOFF, "F_ba^wr", Reset.SWAP, "G_f^wr"),
                *RUNNING_STANCE_FAILURES,
            ),
        ),
        Node(
            "F_ba^wr",
            Phase.F,
            None,
            None,
            (Edge(Event.APEX, "F_aa^r", Reset.NONE, "G_a^r", section=True), *FLIGHT_FAILURES),
        ),
    )


def simplified_walk_to_run() -> tuple[Node, ...]:
    """The WRT stride as its controller sees it (Section IV-C1).

    The rear leg is ignored after the virtual bottom, though its liftoff still ends the
    phase; from there on the stride is the real one.
    """
    return (
        Node(
            "SS_av^wr*",
            Phase.SS,
            Slot.K_SC,
            None,
            (
                Edge(Event.TOUCHDOWN, "DS_sc^wr*", Reset.PLACE_FRONT, "G_t^wr"),
                *AWAITING_TOUCHDOWN_FAILURES,
            ),
        ),
        Node(
            "DS_sc^wr*",
            Phase.DS,
            Slot.K_SC,
            Slot.K_SC,
            (
                Edge(Event.VIRTUAL_BOTTOM, "SS_br^wr*", Reset.NONE, "G_b^wr"),
                Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
                *DOUBLE_STANCE_FAILURES,
            ),
        ),
        Node(
            "SS_br^wr*",
            Phase.SS,
            None,
            Slot.K_SC_WR,
            (
                Edge(Event.REAR_LIFTOFF, "SS_sc^wr", Reset.SHIFT, "G_r^wr"),
                # Alone, the front leg may be passed before: that is no failure here.
                Edge(Event.FRONT_LIFTOFF, Outcome.UNWANTED_FLIGHT),
                *RUNNING_STANCE_FAILURES,
            ),
        ),
    )


def run_to_walk() -> tuple[Node, ...]:
    """The RWT stride: apex -> touchdown -> bottom -> VLO (Section IV-C2)."""
    return (
        Node(
            "F_aa^rw",
            Phase.F,
            None,
            None,
            (Edge(Event.TOUCHDOWN, "SS_sc^rw", Reset.PLACE_REAR, "G_t^rw"), *FLIGHT_FAILURES),
        ),
        Node(
            "SS_sc^rw",
            Phase.SS,
            Slot.K_SC,
            None,
            (Edge(Event.BOTTOM, "SS_sd^rw", Reset.NONE, "G_b^rw"), *RUNNING_STANCE_FAILURES),
        ),
        Node(
            "SS_sd^rw",
            Phase.SS,
            Slot.K_SD,
            None,
            (
                Edge(Event.VLO, "SS_av^w", Reset.NONE, "G_v^rw", section=True),
                *SINGLE_STANCE_FAILURES,
            ),
        ),
    )
