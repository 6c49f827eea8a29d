"""Interface of tasks, and their references.

A task asks for accelerations of some quantities y(q), one row each: with the Jacobian T of y,
the QP minimises weight * (T a + dT/dt v - desired)^2, equation (45), where ``desired`` holds the
feedforward and the PD feedback.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple, Protocol

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.robot.terms import LEGS, MOST_CONTACTS
from template_control.structured import Number, structure

BIAS, DESIRED, WEIGHT = 0, 1, 2
"""Columns of a row behind its (nv,) Jacobian."""


REFERENCES = structure(
    com=(float, (6,)),
    com_now=(float, (4,)),
    com_push=float,
    pitch=float,
    lean=(float, (3,)),
    spin=float,
    feet=(np.int64, (LEGS,)),
    foot=(float, (LEGS, 2, 3)),
    side=(float, (LEGS, 3)),
    furthest=(float, (LEGS,)),
    offset=(float, (MOST_CONTACTS, 3, 3)),
    stands=(np.int64, (MOST_CONTACTS,)),
    lead=float,
    ahead=float,
    sway=float,
    lift=float,
)
"""Values that tasks read with the robot's state; :class:`References` explains the fields."""


class References:
    """References of a tick, which the controller overwrites; compiled code reads the same memory.

    Attributes:
        com: (6,) wanted x, y of the CoM, their first and their second derivatives, in a frame
            at the template's rear toe [m, m/s, m/s^2].
        com_now: (4,) the robot's x, y, dx/dt, dy/dt in that frame. dx/dt is the speed that
            the phase senses: with the angular momentum about the CoM, or without.
        com_push: horizontal acceleration added to the feedforward [m/s^2].
        pitch: wanted angle of the trunk [rad].
        lean: (3,) wanted roll and yaw of a floating-base robot's trunk at 0 and 2, in the heading
            frame [rad].
        spin: wanted angular momentum about the vertical [N m s].
        feet: the foot that is the rear leg's, and the front leg's.
        foot: (2, 2, 3) of each foot: x and y, each wanted position, velocity, acceleration, in
            the world [m, m/s, m/s^2].
        side: (2, 3) of each foot of a floating-base robot: y, to the left, as ``foot`` in its
            heading frame.
        furthest: (2,) largest x that each foot may be moved to, so that its leg does not go
            straight [m].
        offset: (n, 3, 3) of each contact from the reference of its foot: x, y and z in space, each
            position, velocity, acceleration [m, m/s, m/s^2]; 0 of a contact that is a foot.
        stands: (n,) of each contact, whether the QP has it on the ground: a ``FootTask`` or a
            ``SideFootTask`` then asks for nothing.
        lead: how far the point that moves with the momentum is ahead of the CoM [m].
        ahead: wanted rate of dx/dt as ``com_now`` has it, in place of that of ``com`` [m/s^2]; NaN:
            none.
        sway: wanted rate of the speed to the left with the momentum, dy/dt - L_x / (m z) [m/s^2].
        lift: the feedback part of the CoM's vertical acceleration; a ``ComTask`` writes it
            [m/s^2].
        data: (1,) of ``REFERENCES``, all of them.
    """

    def __init__(self, pitch: float = 0.0) -> None:
        self.data = np.zeros(1, REFERENCES)
        now = {name: self.data[name][0] for name in REFERENCES.names or ()}
        self.com: Array = now["com"]
        self.com_now: Array = now["com_now"]
        self.lean: Array = now["lean"]
        self.feet: IntArray = now["feet"]
        self.foot: Array = now["foot"]
        self.side: Array = now["side"]
        self.furthest: Array = now["furthest"]
        self.offset: Array = now["offset"]
        self.stands: IntArray = now["stands"]
        self.feet[1], self.furthest[:], self.pitch, self.ahead = 1, np.inf, pitch, np.nan

    com_push, pitch, lift, lead, ahead, sway = (
        Number(name) for name in ("com_push", "pitch", "lift", "lead", "ahead", "sway")
    )


class Rows(NamedTuple):
    """The r rows that a task writes; views into the stack.

    Attributes:
        jacobian: (r, nv) T.
        bias: (r,) dT/dt v.
        desired: (r,) wanted accelerations.
        weight: (r,) the task's ``weights``; one whose rows have a changing unit scales them by it.
        table: (r, nv + 3) all of them, for compiled code; columns as in :class:`TaskStack`.
    """

    jacobian: Array
    bias: Array
    desired: Array
    weight: Array
    table: Array


class Task(Protocol):
    """Rows of the whole-body QP; a small frozen dataclass of weight and gains."""

    @property
    def weights(self) -> tuple[float, ...]:
        """One weight a row."""

    def write(self, robot: Any, references: Any, rows: Rows) -> None:
        """Fill the task's rows.

        Args:
            robot: the model, updated to this tick: a :class:`~template_control.robot.robot.Robot`,
                or of the kind that the task is for.
            references: :class:`References`, of a controller's tick.
            rows: views of the task's own rows, overwritten; entries that it never writes are 0.
        """


def task_name(task: Task) -> str:
    """Name of a task in options: its class's without "Task", as in ``side_foot``."""
    name = type(task).__name__.removesuffix("Task")
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
