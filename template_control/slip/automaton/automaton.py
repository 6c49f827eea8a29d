"""The hybrid automaton of Fig. 2 and Table I as data.

Nothing here integrates anything: the compiled kernel, the planner and the robot's
controller all read these tables, so "what comes after touchdown" is written once.

A leg is *rear* or *front*. In single stance the stance leg is the rear one, because the
leg that touches down next lands in front of it; at the rear leg's liftoff the front leg
takes its place (``Reset.SHIFT``). At the liftoff into a flight the legs change roles
(``Reset.SWAP``): the other one lands next.
"""

from __future__ import annotations

from collections.abc import Mapping

from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import (
    Event,
    Outcome,
    Phase,
    Reset,
    Slot,
    StrideKind,
)

SINGLE_STANCE_FAILURES = (
    Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
    Edge(Event.FALL, Outcome.FALL),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a single stance that goes to VLO or stands on one leg."""

AWAITING_TOUCHDOWN_FAILURES = (
    Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
    Edge(Event.FALL, Outcome.NO_TOUCHDOWN),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a single stance whose front leg is to touch down."""

DOUBLE_STANCE_FAILURES = (
    Edge(Event.FRONT_LIFTOFF, Outcome.UNWANTED_FLIGHT),
    Edge(Event.PASSED_FRONT_FOOT, Outcome.NO_LIFTOFF),
    Edge(Event.FALL, Outcome.FALL),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a double stance on springs."""

RUNNING_STANCE_FAILURES = (
    Edge(Event.FALL, Outcome.FALL),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a stance that a flight follows: its liftoff is wanted."""

HOPPING_STANCE_FAILURES = (Edge(Event.FALL, Outcome.FALL),)
"""Of a run's stance that may go either way, and turn back."""

CURVE_FAILURES = (Edge(Event.FALL, Outcome.FALL),)
"""Of a double stance that follows a curve in time."""

FLIGHT_FAILURES = (Edge(Event.FALL, Outcome.NO_TOUCHDOWN),)
"""Of a flight: it ends at the ground."""


def _flight(name: str, *edges: Edge) -> Node:
    return Node(name, Phase.F, None, None, (*edges, *FLIGHT_FAILURES))


def _single(name: str, leg: Slot, *edges: Edge) -> Node:
    return Node(name, Phase.SS, leg, None, edges)


def _double(name: str, rear: Slot, front: Slot, *edges: Edge) -> Node:
    return Node(name, Phase.DS, rear, front, (*edges, *DOUBLE_STANCE_FAILURES))


def _curve(name: str, *edges: Edge) -> Node:
    """A double stance that no springs carry."""
    return Node(name, Phase.DS, None, None, (*edges, *CURVE_FAILURES))


def walking(gait: str, rear: tuple[Slot, Slot]) -> tuple[Node, ...]:
    """VLO -> touchdown -> virtual bottom -> rear liftoff -> VLO.

    ``rear`` are slots of the rear leg's stiffness in double stance, before and after the bottom.
    """
    lifts = Edge(Event.REAR_LIFTOFF, f"SS_bv^{gait}", Reset.SHIFT, f"G_l^{gait}")
    return (
        _single(
            f"SS_av^{gait}",
            Slot.K_SC,
            Edge(Event.TOUCHDOWN, f"DS_sc^{gait}", Reset.PLACE_FRONT, f"G_t^{gait}"),
            *AWAITING_TOUCHDOWN_FAILURES,
        ),
        _double(
            f"DS_sc^{gait}",
            rear[0],
            Slot.K_SC,
            Edge(Event.VIRTUAL_BOTTOM, f"DS_sd^{gait}", Reset.NONE, f"G_b^{gait}"),
            # The paper assumes a virtual bottom in every double stance; a short one of a
            # disturbed walker ends without.
            lifts,
        ),
        _double(f"DS_sd^{gait}", rear[1], Slot.K_SD, lifts),
        _single(
            f"SS_bv^{gait}",
            Slot.K_SD,
            Edge(Event.VLO, f"SS_av^{gait}", Reset.NONE, f"G_v^{gait}", section=True),
            *SINGLE_STANCE_FAILURES,
        ),
    )


def running(gait: str, failures: tuple[Edge, ...]) -> tuple[Node, ...]:
    """Apex -> touchdown -> bottom -> liftoff -> apex; ``failures`` are those of its stances."""
    return (
        _flight(
            f"F_aa^{gait}",
            Edge(Event.TOUCHDOWN, f"SS_sc^{gait}", Reset.PLACE_REAR, f"G_t^{gait}"),
        ),
        _single(
            f"SS_sc^{gait}",
            Slot.K_SC,
            Edge(Event.BOTTOM, f"SS_sd^{gait}", Reset.NONE, f"G_b^{gait}"),
            *failures,
        ),
        _single(
            f"SS_sd^{gait}",
            Slot.K_SD,
            Edge(Event.REAR_LIFTOFF, f"F_ba^{gait}", Reset.SWAP, f"G_l^{gait}"),
            *failures,
        ),
        _flight(
            f"F_ba^{gait}",
            Edge(Event.APEX, f"F_aa^{gait}", Reset.NONE, f"G_a^{gait}", section=True),
        ),
    )


def walk_to_run() -> tuple[Node, ...]:
    """The WRT stride: the rear leg walks, the front leg runs (Section IV-C1)."""
    lifts = Edge(Event.REAR_LIFTOFF, "SS_sc^wr", Reset.SHIFT, "G_r^wr")
    return (
        _single(
            "SS_av^wr",
            Slot.K_SC,
            Edge(Event.TOUCHDOWN, "DS_sc^wr", Reset.PLACE_FRONT, "G_t^wr"),
            # A walker that is too fast takes off before.
            Edge(Event.REAR_LIFTOFF, "F_aa^wr", Reset.SWAP, "G_l^wr"),
            *AWAITING_TOUCHDOWN_FAILURES[1:],
        ),
        _flight("F_aa^wr", Edge(Event.TOUCHDOWN, "SS_sc^wr", Reset.PLACE_REAR, "G_t^wr")),
        _double(
            "DS_sc^wr",
            Slot.K_SC,
            Slot.K_SC,
            Edge(Event.VIRTUAL_BOTTOM, "DS_sd^wr", Reset.NONE, "G_b^wr"),
            lifts,
        ),
        _double("DS_sd^wr", Slot.K_SD, Slot.K_SC_WR, lifts),
        _single(
            "SS_sc^wr",
            Slot.K_SC_WR,
            Edge(Event.BOTTOM, "SS_sd^wr", Reset.NONE, "G_b^wr"),
            Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
            *RUNNING_STANCE_FAILURES,
        ),
        _single(
            "SS_sd^wr",
            Slot.K_SD_WR,
            Edge(Event.REAR_LIFTOFF, "F_ba^wr", Reset.SWAP, "G_f^wr"),
            *RUNNING_STANCE_FAILURES,
        ),
        _flight("F_ba^wr", Edge(Event.APEX, "F_aa^r", Reset.NONE, "G_a^r", section=True)),
    )


def simplified_walk_to_run() -> tuple[Node, ...]:
    """The WRT stride as its controller sees it (Section IV-C1).

    The rear leg is ignored after the virtual bottom, though its liftoff still ends the
    phase; from there on the stride is the real one.
    """
    return (
        _single(
            "SS_av^wr*",
            Slot.K_SC,
            Edge(Event.TOUCHDOWN, "DS_sc^wr*", Reset.PLACE_FRONT, "G_t^wr"),
            *AWAITING_TOUCHDOWN_FAILURES,
        ),
        _double(
            "DS_sc^wr*",
            Slot.K_SC,
            Slot.K_SC,
            Edge(Event.VIRTUAL_BOTTOM, "SS_br^wr*", Reset.NONE, "G_b^wr"),
            Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
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
        _flight("F_aa^rw", Edge(Event.TOUCHDOWN, "SS_sc^rw", Reset.PLACE_REAR, "G_t^rw")),
        _single(
            "SS_sc^rw",
            Slot.K_SC,
            Edge(Event.BOTTOM, "SS_sd^rw", Reset.NONE, "G_b^rw"),
            *RUNNING_STANCE_FAILURES,
        ),
        _single(
            "SS_sd^rw",
            Slot.K_SD,
            Edge(Event.VLO, "SS_av^w", Reset.NONE, "G_v^rw", section=True),
            *SINGLE_STANCE_FAILURES,
        ),
    )


def standing() -> tuple[Node, ...]:
    """Standing, and the strides from it, to it and between two walking speeds.

    No springs carry their double stances: the CoM follows a curve in time there. The template's
    own simulator falls through them.
    """

    def last(gait: str, target: str) -> Node:
        """A walker's single stance, of which a curve is the next node."""
        lands = Edge(Event.TOUCHDOWN, target, Reset.PLACE_FRONT, f"G_t^{gait}")
        return _single(f"SS_av^{gait}", Slot.K_SC, lands, *AWAITING_TOUCHDOWN_FAILURES)

    return (
        _curve("DS_ar^s", Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^s", section=True)),
        _curve("DS_ar^sw", Edge(Event.REAR_LIFTOFF, "SS_bv^w", Reset.SHIFT, "G_l^sw")),
        last("ws", "DS_br^ws"),
        _curve("DS_br^ws", Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^ws", section=True)),
        last("ww", "DS_bl^ww"),
        _curve("DS_bl^ww", Edge(Event.REAR_LIFTOFF, "SS_bv^w", Reset.SHIFT, "G_l^ww")),
    )


def _stepping(gait: str, lifts: Edge, rests: Edge) -> tuple[Node, ...]:
    """From a stand, over one leg, to a stand; ``lifts`` and ``rests`` begin and end it."""
    return (
        _curve(f"DS_al^{gait}", lifts),
        _single(
            f"SS_bt^{gait}",
            Slot.K_SC,
            Edge(Event.TOUCHDOWN, f"DS_br^{gait}", Reset.PLACE_FRONT, f"G_t^{gait}"),
            Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
            Edge(Event.FALL, Outcome.NO_TOUCHDOWN),
        ),
        _curve(f"DS_br^{gait}", rests),
    )


def steps_from_a_stand() -> tuple[Node, ...]:
    """A step forward, and one back, whose foot lands behind the other: then they change roles."""
    return (
        *_stepping(
            StrideKind.STEP_FORWARD,
            Edge(Event.REAR_LIFTOFF, "SS_bt^sf", Reset.SHIFT, "G_l^sf"),
            Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^sf", section=True),
        ),
        *_stepping(
            StrideKind.STEP_BACK,
            Edge(Event.FRONT_LIFTOFF, "SS_bt^sb", Reset.NONE, "G_l^sb"),
            Edge(Event.REST, "DS_ar^s", Reset.SWAP, "G_r^sb", section=True),
        ),
    )


AUTOMATON = Automaton(
    nodes=(
        *walking(StrideKind.WALK, (Slot.K_SC, Slot.K_SD)),
        *running(StrideKind.RUN, RUNNING_STANCE_FAILURES),
        *walk_to_run(),
        *run_to_walk(),
        *simplified_walk_to_run(),
        *standing(),
        *walking(StrideKind.WALK_PUSH_OFF, (Slot.K_PUSH, Slot.K_PUSH)),
        *steps_from_a_stand(),
        *running(StrideKind.HOP, HOPPING_STANCE_FAILURES),
    ),
    starts={
        StrideKind.WALK: "SS_av^w",
        StrideKind.RUN: "F_aa^r",
        StrideKind.WALK_TO_RUN: "SS_av^wr",
        StrideKind.RUN_TO_WALK: "F_aa^rw",
        StrideKind.WALK_TO_RUN_SIMPLIFIED: "SS_av^wr*",
        StrideKind.STAND: "DS_ar^s",
        StrideKind.STAND_TO_WALK: "DS_ar^sw",
        StrideKind.WALK_TO_STAND: "SS_av^ws",
        StrideKind.CHANGE_SPEED: "SS_av^ww",
        StrideKind.WALK_PUSH_OFF: "SS_av^wp",
        StrideKind.STEP_FORWARD: "DS_al^sf",
        StrideKind.STEP_BACK: "DS_al^sb",
        StrideKind.HOP: "F_aa^hr",
    },
)
"""The one automaton of the library."""

STRIDE_START = AUTOMATON.starts
"""First node of each kind of stride (superscripts of Table I; * the controller's WRT, wp
walking with push-off)."""


RUN_ON: Mapping[str, str] = {
    "SS_av^w": "SS_av^wr",
    "DS_sc^w": "DS_sc^wr",
    "DS_sd^w": "DS_sd^wr",
    "SS_bv^w": "SS_av^wr",
    "SS_av^wp": "SS_av^wr",
    "DS_sc^wp": "DS_sc^wr",
    "DS_sd^wp": "DS_sd^wr",
    "SS_bv^wp": "SS_av^wr",
}
"""By a walking node: where the walk-to-run stride goes on from there.

In single stance the other foot lands next, whether VLO is past or not.
"""
