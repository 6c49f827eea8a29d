"""Words of the hybrid automaton (Table I): phases, guards, resets, control slots, outcomes."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import Literal, Self


class StrideKind(StrEnum):
    """Kinds of stride of the library's automaton: the keys of its ``starts``, and of files.

    A member equals its key, so that a key may be given wherever a kind of stride is asked for; an
    automaton of one's own has keys of its own.
    """

    WALK = "w"
    WALK_PUSH_OFF = "wp"
    RUN = "r"
    WALK_TO_RUN = "wr"
    WALK_TO_RUN_SIMPLIFIED = "wr*"  # as the paper's controller sees it
    RUN_TO_WALK = "rw"
    STAND = "s"
    STAND_TO_WALK = "sw"
    WALK_TO_STAND = "ws"
    CHANGE_SPEED = "ww"  # of a walk, by a curve in time
    STEP_FORWARD = "sf"  # from a stand to a stand
    STEP_BACK = "sb"
    HOP = "hr"  # a slow run, forward, backward or on the spot

    def __repr__(self) -> str:
        return repr(self.value)


WalkingStride = Literal[StrideKind.WALK, StrideKind.WALK_PUSH_OFF, "w", "wp"]
"""Kind of a walking step, from VLO to VLO."""


class Phase(IntEnum):
    """Primary phases of motion (Section II-A): flight, single stance, double stance."""

    F = 0
    SS = 1
    DS = 2


class Leg(IntEnum):
    """A leg by its role; the automaton's resets change who plays it.

    In single stance the stance leg is the rear one, because the leg that touches down next
    lands in front of it.
    """

    REAR = 0
    FRONT = 1


class Slot(IntEnum):
    """Places of the control vector u of a stride, in order.

    ``TOUCHDOWN_ANGLE`` is alpha [rad] from the ground to the leg. The other slots are leg
    stiffnesses [N/m]: before and after the stride's (virtual) bottom, the two of the
    front leg in a walk-to-run stride, and that of the rear leg in the double stance of a
    walking step with push-off.
    """

    TOUCHDOWN_ANGLE = 0
    K_SC = 1
    K_SD = 2
    K_SC_WR = 3
    K_SD_WR = 4
    K_PUSH = 5


NUM_SLOTS = len(Slot)


class Event(IntEnum):
    """Transition guards; each is a scalar function that fires when it *rises* through 0.

    With CoM (x, y), toes c1 (rear) and c2 (front), leg lengths l1, l2:

    ===================  =====================================================
    TOUCHDOWN            l0 sin(alpha) - y
    REAR_LIFTOFF         l1 - l0
    FRONT_LIFTOFF        l2 - l0
    APEX                 -dy/dt
    BOTTOM               d(l1^2)/dt: rear (only) leg turns to decompression
    VIRTUAL_BOTTOM       d/dt of the squared distance to the midpoint of the toes
    VLO                  x - c1: the stance leg is vertical
    PASSED_FRONT_FOOT    x - c2: the CoM is over the front foot, rear leg still down
    FALL                 -y
    BACKWARD             -dx/dt
    REST                 -((dx/dt)^2 + (dy/dt)^2): the CoM stands still
    ===================  =====================================================

    A guard that is zero (within 1e-10) where a phase begins does not fire there, and has to fall
    below zero first. Three may fire there: FALL and BACKWARD, above zero too, and TOUCHDOWN of a
    foot that is at the ground and not on its way up, unless a touchdown began the phase.
    """

    TOUCHDOWN = 0
    REAR_LIFTOFF = 1
    FRONT_LIFTOFF = 2
    APEX = 3
    BOTTOM = 4
    VIRTUAL_BOTTOM = 5
    VLO = 6
    PASSED_FRONT_FOOT = 7
    FALL = 8
    BACKWARD = 9
    REST = 10


NUM_EVENTS = len(Event)
MAX_EDGES = 8
"""Most edges that a node may have."""


class Reset(IntEnum):
    """Change of the toes when an edge is taken.

    ``PLACE_REAR`` and ``PLACE_FRONT`` put a toe where the stretched leg at the touchdown
    angle meets the ground, x + l0 cos(alpha); ``SHIFT`` makes the front toe the rear one;
    ``SWAP`` exchanges the legs' roles and places none: the other leg lands next.
    """

    NONE = 0
    PLACE_REAR = 1
    PLACE_FRONT = 2
    SHIFT = 3
    SWAP = 4


class Outcome(IntEnum):
    """End of a stride: at its section, or the reason why not.

    Attributes:
        reason: the outcome in words.
    """

    reason: str

    SECTION = 0, "reached its section"
    FALL = 1, "the CoM fell to the ground"
    UNWANTED_FLIGHT = 2, "a stance foot left the ground too early"
    BACKWARD = 3, "the CoM turned backward"
    NO_TOUCHDOWN = 4, "no leg touched down in time"
    NO_LIFTOFF = 5, "the CoM passed the front foot before the rear leg lifted off"
    TIMEOUT = 6, "no event within the time limit"

    def __new__(cls, value: int, reason: str = "") -> Self:
        """A number with words."""
        member = int.__new__(cls, value)
        member._value_, member.reason = value, reason
        return member


class MapKind(IntEnum):
    """Solution of the stance dynamics that a return map is made of.

    ``EXACT``: event-exact integration. The others are closed forms of Section III:
    ``PAPER`` as published, ``IMPROVED`` with one deferred correction and conserved energy,
    ``GEYER`` without correction of the angular momentum.
    """

    EXACT = 0
    PAPER = 1
    IMPROVED = 2
    GEYER = 3
