"""The nodes of a walking step, with and without push-off."""

from __future__ import annotations

from template_control.slip.automaton.failures import (
    AWAITING_TOUCHDOWN_FAILURES,
    DOUBLE_STANCE_FAILURES,
    SINGLE_STANCE_FAILURES,
)
from template_control.slip.automaton.node import Edge, Node
from template_control.slip.automaton.vocabulary import Event, Phase, Reset, Slot


def walking(gait: str, rear: tuple[Slot, Slot]) -> tuple[Node, ...]:
    """VLO -> touchdown -> virtual bottom -> rear liftoff -> VLO.

    Args:
        gait: kind of its stride.
        rear: stiffnesses of the rear leg in double stance, before and after the bottom.
    """
    return (
        Node(
            f"SS_av^{gait}",
            Phase.SS,
            Slot.K_SC,
            None,
            (
                Edge(Event.TOUCHDOWN, f"DS_sc^{gait}", Reset.PLACE_FRONT, f"G_t^{gait}"),
                *AWAITING_TOUCHDOWN_FAILURES,
            ),
        ),
        Node(
            f"DS_sc^{gait}",
            Phase.DS,
            rear[0],
            Slot.K_SC,
            (
                Edge(Event.VIRTUAL_BOTTOM, f"DS_sd^{gait}", Reset.NONE, f"G_b^{gait}"),
                # The paper assumes a virtual bottom in every double stance; a short one of a
                # disturbed walker ends without.
                Edge(Event.REAR_LIFTOFF, f"SS_bv^{gait}", Reset.SHIFT, f"G_l^{gait}"),
                *DOUBLE_STANCE_FAILURES,
            ),
        ),
        Node(
            f"DS_sd^{gait}",
            Phase.DS,
            rear[1],
            Slot.K_SD,
            (
                Edge(Event.REAR_LIFTOFF, f"SS_bv^{gait}", Reset.SHIFT, f"G_l^{gait}"),
                *DOUBLE_STANCE_FAILURES,
            ),
        ),
        Node(
            f"SS_bv^{gait}",
            Phase.SS,
            Slot.K_SD,
            None,
            (
                Edge(Event.VLO, f"SS_av^{gait}", Reset.NONE, f"G_v^{gait}", section=True),
                *SINGLE_STANCE_FAILURES,
            ),
        ),
    )
