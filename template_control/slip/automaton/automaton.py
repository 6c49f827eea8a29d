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

_UNWANTED_FLIGHT = Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT)
_NO_TOUCHDOWN = Edge(Event.FALL, Outcome.NO_TOUCHDOWN)  # of a foot that was to land
_FALL = Edge(Event.FALL, Outcome.FALL)
_STANCE_FAILURES = (_FALL, Edge(Event.BACKWARD, Outcome.BACKWARD))


def _flight(name: str, *edges: Edge) -> Node:
    return Node(name, Phase.F, None, None, (*edges, _NO_TOUCHDOWN))


def _single(name: str, leg: Slot, *edges: Edge) -> Node:
    return Node(name, Phase.SS, leg, None, edges)


def _double(name: str, rear: Slot, front: Slot, *edges: Edge) -> Node:
    failures = (
        Edge(Event.FRONT_LIFTOFF, Outcome.UNWANTED_FLIGHT),
        Edge(Event.PASSED_FRONT_FOOT, Outcome.NO_LIFTOFF),
        *_STANCE_FAILURES,
    )
    return Node(name, Phase.DS, rear, front, (*edges, *failures))


def _curve(name: str, *edges: Edge) -> Node:
    """A double stance that no springs carry: it follows a curve in time."""
    return Node(name, Phase.DS, None, None, (*edges, _FALL))


def _awaiting(gait: str, target: str, early: Edge = _UNWANTED_FLIGHT) -> Node:
    """A walker's single stance from VLO on; ``early`` is its liftoff before the touchdown."""
    guard = f"G_t^{gait.removesuffix('*')}"
    return _single(
        f"SS_av^{gait}",
        Slot.K_SC,
        Edge(Event.TOUCHDOWN, target, Reset.PLACE_FRONT, guard),
        early,
        _NO_TOUCHDOWN,
        *_STANCE_FAILURES[1:],
    )


def _until_liftoff(
    gait: str, rear: tuple[Slot, Slot], front: Slot, lifts: Edge
) -> tuple[Node, Node]:
    """Double stance -> virtual bottom -> rear liftoff.

    ``rear`` are slots of the rear leg's stiffness before and after the bottom, ``front`` that of
    the front leg after it.
    """
    bottom = Edge(Event.VIRTUAL_BOTTOM, f"DS_sd^{gait}", Reset.NONE, f"G_b^{gait}")
    # The paper assumes a virtual bottom in every double stance; a short one of a
    # disturbed walker ends without.
    return (
        _double(f"DS_sc^{gait}", rear[0], Slot.K_SC, bottom, lifts),
        _double(f"DS_sd^{gait}", rear[1], front, lifts),
    )


def _until_bottom(gait: str, failures: tuple[Edge, ...]) -> tuple[Node, Node]:
    """Apex -> touchdown -> bottom; ``failures`` are those of the stance."""
    lands = Edge(Event.TOUCHDOWN, f"SS_sc^{gait}", Reset.PLACE_REAR, f"G_t^{gait}")
    bottom = Edge(Event.BOTTOM, f"SS_sd^{gait}", Reset.NONE, f"G_b^{gait}")
    return _flight(f"F_aa^{gait}", lands), _single(f"SS_sc^{gait}", Slot.K_SC, bottom, *failures)


def _to_vlo(name: str, target: str, guard: str) -> Node:
    """A single stance -> VLO."""
    section = Edge(Event.VLO, target, Reset.NONE, guard, section=True)
    return _single(name, Slot.K_SD, section, _UNWANTED_FLIGHT, *_STANCE_FAILURES)


def walking(gait: str, rear: tuple[Slot, Slot]) -> tuple[Node, ...]:
    """VLO -> touchdown -> virtual bottom -> rear liftoff -> VLO.

    ``rear`` are slots of the rear leg's stiffness in double stance, before and after the bottom.
    """
    lifts = Edge(Event.REAR_LIFTOFF, f"SS_bv^{gait}", Reset.SHIFT, f"G_l^{gait}")
    return (
        _awaiting(gait, f"DS_sc^{gait}"),
        *_until_liftoff(gait, rear, Slot.K_SD, lifts),
        _to_vlo(f"SS_bv^{gait}", f"SS_av^{gait}", f"G_v^{gait}"),
    )


def running(gait: str, failures: tuple[Edge, ...]) -> tuple[Node, ...]:
    """Apex -> touchdown -> bottom -> liftoff -> apex; ``failures`` are those of its stances."""
    lifts = Edge(Event.REAR_LIFTOFF, f"F_ba^{gait}", Reset.SWAP, f"G_l^{gait}")
    apex = Edge(Event.APEX, f"F_aa^{gait}", Reset.NONE, f"G_a^{gait}", section=True)
    return (
        *_until_bottom(gait, failures),
        _single(f"SS_sd^{gait}", Slot.K_SD, lifts, *failures),
        _flight(f"F_ba^{gait}", apex),
    )


def walk_to_run() -> tuple[Node, ...]:
    """The WRT stride: the rear leg walks, the front leg runs (Section IV-C1)."""
    lifts = Edge(Event.REAR_LIFTOFF, "SS_sc^wr", Reset.SHIFT, "G_r^wr")
    # A walker that is too fast takes off before.
    takes_off = Edge(Event.REAR_LIFTOFF, "F_aa^wr", Reset.SWAP, "G_l^wr")
    bottom = Edge(Event.BOTTOM, "SS_sd^wr", Reset.NONE, "G_b^wr")
    flies = Edge(Event.REAR_LIFTOFF, "F_ba^wr", Reset.SWAP, "G_f^wr")
    return (
        _awaiting("wr", "DS_sc^wr", takes_off),
        _flight("F_aa^wr", Edge(Event.TOUCHDOWN, "SS_sc^wr", Reset.PLACE_REAR, "G_t^wr")),
        *_until_liftoff("wr", (Slot.K_SC, Slot.K_SD), Slot.K_SC_WR, lifts),
        _single("SS_sc^wr", Slot.K_SC_WR, bottom, _UNWANTED_FLIGHT, *_STANCE_FAILURES),
        _single("SS_sd^wr", Slot.K_SD_WR, flies, *_STANCE_FAILURES),
        _flight("F_ba^wr", Edge(Event.APEX, "F_aa^r", Reset.NONE, "G_a^r", section=True)),
    )


def simplified_walk_to_run() -> tuple[Node, ...]:
    """The WRT stride as its controller sees it (Section IV-C1).

    The rear leg is ignored after the virtual bottom, though its liftoff still ends the
    phase; from there on the stride is the real one.
    """
    bottom = Edge(Event.VIRTUAL_BOTTOM, "SS_br^wr*", Reset.NONE, "G_b^wr")
    alone = (
        Edge(Event.REAR_LIFTOFF, "SS_sc^wr", Reset.SHIFT, "G_r^wr"),
        # Alone, the front leg may be passed before: that is no failure here.
        Edge(Event.FRONT_LIFTOFF, Outcome.UNWANTED_FLIGHT),
        *_STANCE_FAILURES,
    )
    return (
        _awaiting("wr*", "DS_sc^wr*"),
        _double("DS_sc^wr*", Slot.K_SC, Slot.K_SC, bottom, _UNWANTED_FLIGHT),
        Node("SS_br^wr*", Phase.SS, None, Slot.K_SC_WR, alone),
    )


def standing() -> tuple[Node, ...]:
    """Standing, and the strides from it, to it and between two walking speeds.

    No springs carry their double stances: the CoM follows a curve in time there. The template's
    own simulator falls through them.
    """
    return (
        _curve("DS_ar^s", Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^s", section=True)),
        _curve("DS_ar^sw", Edge(Event.REAR_LIFTOFF, "SS_bv^w", Reset.SHIFT, "G_l^sw")),
        _awaiting("ws", "DS_br^ws"),
        _curve("DS_br^ws", Edge(Event.REST, "DS_ar^s", Reset.NONE, "G_r^ws", section=True)),
        _awaiting("ww", "DS_bl^ww"),
        _curve("DS_bl^ww", Edge(Event.REAR_LIFTOFF, "SS_bv^w", Reset.SHIFT, "G_l^ww")),
    )


def stepping(gait: str, lifts: Event, lifted: Reset, rested: Reset) -> tuple[Node, ...]:
    """From a stand, over one leg, to a stand; ``lifts`` begins it, and its two resets."""
    lands = Edge(Event.TOUCHDOWN, f"DS_br^{gait}", Reset.PLACE_FRONT, f"G_t^{gait}")
    rests = Edge(Event.REST, "DS_ar^s", rested, f"G_r^{gait}", section=True)
    return (
        _curve(f"DS_al^{gait}", Edge(lifts, f"SS_bt^{gait}", lifted, f"G_l^{gait}")),
        _single(f"SS_bt^{gait}", Slot.K_SC, lands, _UNWANTED_FLIGHT, _NO_TOUCHDOWN),
        _curve(f"DS_br^{gait}", rests),
    )


AUTOMATON = Automaton(
    nodes=(
        *walking(StrideKind.WALK, (Slot.K_SC, Slot.K_SD)),
        *running(StrideKind.RUN, _STANCE_FAILURES),
        *walk_to_run(),
        # The RWT stride (Section IV-C2).
        *_until_bottom(StrideKind.RUN_TO_WALK, _STANCE_FAILURES),
        _to_vlo("SS_sd^rw", "SS_av^w", "G_v^rw"),
        *simplified_walk_to_run(),
        *standing(),
        *walking(StrideKind.WALK_PUSH_OFF, (Slot.K_PUSH, Slot.K_PUSH)),
        *stepping(StrideKind.STEP_FORWARD, Event.REAR_LIFTOFF, Reset.SHIFT, Reset.NONE),
        # Its foot lands behind the other: then they change roles.
        *stepping(StrideKind.STEP_BACK, Event.FRONT_LIFTOFF, Reset.NONE, Reset.SWAP),
        # A slow run may go either way, and turn back.
        *running(StrideKind.HOP, (_FALL,)),
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
    f"{node}^{gait}": f"{start}^wr"
    for gait in (StrideKind.WALK, StrideKind.WALK_PUSH_OFF)
    for node, start in zip(
        ("SS_av", "DS_sc", "DS_sd", "SS_bv"), ("SS_av", "DS_sc", "DS_sd", "SS_av"), strict=True
    )
}
"""By a walking node: where the walk-to-run stride goes on from there.

In single stance the other foot lands next, whether VLO is past or not.
"""
