"""The hybrid automaton of Fig. 2 and Table I as data.

Nothing here integrates anything: the compiled kernel, the planner and the robot's
controller all read these tables, so "what comes after touchdown" is written once.

A leg is *rear* or *front*. In single stance the stance leg is the rear one, because the
leg that touches down next lands in front of it; at the rear leg's liftoff the front leg
takes its place (``Reset.SHIFT``). At the liftoff into a flight the legs change roles
(``Reset.SWAP``): the other one lands next.
"""

from __future__ import annotations

from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.running import running
from template_control.slip.automaton.standing import standing, steps_from_a_stand
from template_control.slip.automaton.transitions import (
    run_to_walk,
    simplified_walk_to_run,
    walk_to_run,
)
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.automaton.walking import walking

AUTOMATON = Automaton(
    nodes=(
        *walking("w", (Slot.K_SC, Slot.K_SD)),
        *running(),
        *walk_to_run(),
        *run_to_walk(),
        *simplified_walk_to_run(),
        *standing(),
        *walking("wp", (Slot.K_PUSH, Slot.K_PUSH)),
        *steps_from_a_stand(),
    ),
    starts={
        "w": "SS_av^w",
        "r": "F_aa^r",
        "wr": "SS_av^wr",
        "rw": "F_aa^rw",
        "wr*": "SS_av^wr*",
        "s": "DS_ar^s",
        "sw": "DS_ar^sw",
        "ws": "SS_av^ws",
        "ww": "SS_av^ww",
        "wp": "SS_av^wp",
        "sf": "DS_al^sf",
        "sb": "DS_al^sb",
    },
)
"""The one automaton of the library."""

STRIDE_START = AUTOMATON.starts
"""First node of each kind of stride (superscripts of Table I; * the controller's WRT, wp
walking with push-off)."""
