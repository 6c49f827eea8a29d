"""The periodic sideways motion of a gait: width, motion aside and turn as wished."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.slip.lateral.gait import LateralGait

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LateralWish(Checked):
    """What the feet are to do aside.

    Attributes:
        width: distance aside between left and right footholds [m].
        aside: distance to the left that each step moves the walk [m].
        turn: angle by which the heading turns to the left at each section [rad].
    """

    width: Positive
    aside: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class LateralCycle:
    """The periodic motion of a wish, two steps long; rows are :attr:`Side.row`.

    Attributes:
        states: (2, 2) X at a section with the foot of that side as stance foot, before a turn.
        steps: (2,) distance from that foot to the next foothold, to the left [m].
    """

    states: Array
    steps: Array


def lateral_cycle(
    lateral: LateralGait, wish: LateralWish, offset: Array | None = None
) -> LateralCycle:
    """The periodic motion: from section to section the mirror image, where nothing is one-sided.

    At a turn by psi the velocity turns in the heading frame: dy/dt changes by -v psi. The walk's
    circle is the one that its mirror image in time goes along too: dy/dt is v psi / 2 before.

    Args:
        lateral: the step map.
        wish: width, motion aside and turn.
        offset: (2, 2) what the robot adds to X' after a step from the left and from the right
            foot; None: nothing.
    """
    a, b, one = lateral.a, lateral.b, np.eye(2)
    added = np.zeros((2, 2)) if offset is None else offset
    mirrored = np.linalg.solve(one + a, wish.width * b - 0.5 * (added[0] - added[1]))
    half = 0.5 * lateral.speed * wish.turn
    to_left = one - a
    turning, moved = np.linalg.solve(
        np.column_stack((to_left[:, 0], -b)), -2.0 * half * a[:, 1] - half * to_left[:, 1]
    )
    aside = np.linalg.solve(to_left, wish.aside * b + 0.5 * (added[0] + added[1]))
    aside += (turning, half)
    step = wish.aside + moved
    return LateralCycle(
        states=np.array([aside + mirrored, aside - mirrored]),
        steps=np.array([step - wish.width, step + wish.width]),
    )
