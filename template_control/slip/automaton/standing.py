"""The nodes of standing, and of the strides from and to a stand."""

from __future__ import annotations

from template_control.slip.automaton.failures import (
    AWAITING_TOUCHDOWN_FAILURES,
    CURVE_FAILURES,
)
from template_control.slip.automaton.node import Edge, Node
from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset, Slot


def standing() -> tuple[Node, ...]:
    """Standing, and the strides from it, to it and between two walking speeds.

    No springs carry their double stances: the CoM follows a curve in time there. The template's
    own simulator falls through them.
    """
    return (
        Node(
            "DS_ar^s",
            Phase.DS,
            None,
            None,
            (Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^s", section=True), *CURVE_FAILURES),
        ),
        Node(
            "DS_ar^sw",
            Phase.DS,
            None,
            None,
            (Edge(Event.REAR_LIFTOFF, "SS_bv^w", Reset.SHIFT, "G_l^sw"), *CURVE_FAILURES),
        ),
        Node(
            "SS_av^ws",
            Phase.SS,
            Slot.K_SC,
            None,
            (
                Edge(Event.TOUCHDOWN, "DS_br^ws", Reset.PLACE_FRONT, "G_t^ws"),
                *AWAITING_TOUCHDOWN_FAILURES,
            ),
        ),
        Node(
            "DS_br^ws",
            Phase.DS,
            None,
            None,
            (Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^ws", section=True), *CURVE_FAILURES),
        ),
        Node(
            "SS_av^ww",
            Phase.SS,
            Slot.K_SC,
            None,
            (
                Edge(Event.TOUCHDOWN, "DS_bl^ww", Reset.PLACE_FRONT, "G_t^ww"),
                *AWAITING_TOUCHDOWN_FAILURES,
            ),
        ),
        Node(
            "DS_bl^ww",
            Phase.DS,
            None,
            None,
            (Edge(Event.REAR_LIFTOFF, "SS_bv^w", Reset.SHIFT, "G_l^ww"), *CURVE_FAILURES),
        ),
    )


def _stepping(gait: str, lifts: Edge, rests: Edge) -> tuple[Node, ...]:
    """From a stand, over one leg, to a stand; ``lifts`` and ``rests`` begin and end it."""
    return (
        Node(f"DS_al^{gait}", Phase.DS, None, None, (lifts, *CURVE_FAILURES)),
        Node(
            f"SS_bt^{gait}",
            Phase.SS,
            Slot.K_SC,
            None,
            (
                Edge(Event.TOUCHDOWN, f"DS_br^{gait}", Reset.PLACE_FRONT, f"G_t^{gait}"),
                Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
                Edge(Event.FALL, Outcome.NO_TOUCHDOWN),
            ),
        ),
        Node(f"DS_br^{gait}", Phase.DS, None, None, (rests, *CURVE_FAILURES)),
    )


def steps_from_a_stand() -> tuple[Node, ...]:
    """A step forward, and one back, whose foot lands behind the other: then they change roles."""
    return (
        *_stepping(
            "sf",
            Edge(Event.REAR_LIFTOFF, "SS_bt^sf", Reset.SHIFT, "G_l^sf"),
            Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^sf", section=True),
        ),
        *_stepping(
            "sb",
            Edge(Event.FRONT_LIFTOFF, "SS_bt^sb", Reset.NONE, "G_l^sb"),
            Edge(Event.REST, "DS_ar^s", Reset.SWAP, "G_r^sb", section=True),
        ),
    )
