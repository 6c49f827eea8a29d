"""Stiffnesses for the rest of a walking step, chosen where a disturbance has left the robot.

A push in double stance changes the speed by as much as the rear leg's push-off can give back, but
only before that leg has lifted off: the next section is too late.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import Ahead
from template_control.embedding.planners.regularised import FromHere, Prior, solve_stride
from template_control.embedding.planners.walking.step_law import Law
from template_control.slip.automaton.vocabulary import Outcome

Array = NDArray[np.float64]

_FLIES = Outcome.UNWANTED_FLIGHT
_ROUNDS = 6  # of Gauss and Newton's method; most choices take three


@dataclass(frozen=True)
class _Weighed:
    """Where the rest of a step ends, in coordinates in which the cost-to-go is a squared length.

    What the robot adds to a step has mostly come in by then.

    Attributes:
        ahead: the template's end.
        root: (3, 3) with the cost-to-go root' root.
    """

    ahead: Ahead
    root: Array

    def __call__(self, u: Array) -> tuple[Array, Outcome]:
        end, outcome = self.ahead(u)
        return self.root @ end, outcome


class Rest(NamedTuple):
    """A choice for the rest of a step.

    Attributes:
        controls: (NUM_SLOTS,) of the stride.
        end: (3,) where the step ends; None where no controls complete it.
        change: (3,) how far that is from where it would have ended; None where it would not have.
    """

    controls: Array
    end: Array | None
    change: Array | None


def choose_rest(law: Law, costs: Array, ahead: Ahead, controls: Array, free: Sequence[int]) -> Rest:
    """Controls with the least cost-to-go at the step's end, and the least change.

    Args:
        law: the planner's, with its bounds.
        costs: (c,) of its controls' squared changes.
        ahead: where the rest of the step leads.
        controls: (NUM_SLOTS,) that hold so far.
        free: slots of the stiffnesses that the rest depends on.
    """
    before, outcome = ahead(controls)
    slow = before[0] < law.target[0] if outcome is Outcome.SECTION else outcome is not _FLIES
    softest = law.softest if slow else 0.0
    places = [place for place, slot in enumerate(law.slots) if place and slot in free]
    slots = [int(law.slots[place]) for place in places]
    change = law.stiffness / np.sqrt(costs[places])
    lower = np.maximum(law.lower[places], softest) * law.stiffness
    upper = law.upper[places] * law.stiffness
    prior = Prior(controls, slots, np.array([controls[slots], change, lower, upper]), _ROUNDS)
    root: Array = np.linalg.cholesky(law.cost).T.astype(np.float64)
    rest = FromHere(_Weighed(ahead, root), slots)
    u, weighed = solve_stride(rest, root @ law.target, prior, np.ones(3))
    if weighed is None:
        return Rest(u, None, None)
    end: Array = np.linalg.solve(root, weighed).astype(np.float64)
    return Rest(u, end, end - before if outcome is Outcome.SECTION else None)
