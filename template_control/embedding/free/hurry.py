"""A step that ends sooner, where its foothold would be out of reach to the left or right.

Beside the stance foot the CoM falls away from it all the time: after t its distance has grown by
about exp(t sqrt(g / z)). After a push aside the next foothold may be wanted further away than
the legs reach, or on the other side of the stance foot. A steeper touchdown angle puts the foot
down earlier, while it still is in reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Share
from template_control.embedding.planners.planner import Decision
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.lateral.placing import LateralAim, Placement
from template_control.slip.similarity import LENGTH, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HurryOptions(Checked):
    """When a step is made shorter in time, and by how much.

    Attributes:
        beyond: a foothold that is wanted further than this beyond its bounds is out of reach [m].
        steeper: touchdown angles that are tried, over the one decided, in turn [rad].
        gain: share that a steeper angle must leave of the error's price to be taken.
    """

    beyond: NotNegative = tuned(0.03, LENGTH)
    steeper: tuple[NotNegative, ...] = tuned((0.02, 0.04, 0.06))
    gain: Share = tuned(0.8)


class Outlook(NamedTuple):
    """What is expected of a step sideways.

    Attributes:
        beyond: how far the wanted foothold is beyond its bounds [m]; NaN where none is known.
        price: of the error that is left at the section after the foothold.
    """

    beyond: float
    price: float


def outlook(found: Placement, aim: LateralAim) -> Outlook:
    """What is expected of a foothold.

    Args:
        found: the foothold.
        aim: what it was chosen for.
    """
    error = found.state(found.y) - aim.state
    return Outlook(abs(found.wanted - found.y), float(error @ aim.cost @ error))


def hurried(
    decision: Decision,
    decide: Callable[[float], Decision],
    look: Callable[[Decision], Outlook],
    options: HurryOptions,
) -> Decision:
    """The decision for a step, with a steeper touchdown where the foothold is out of reach.

    Args:
        decision: for the step as it would be.
        decide: the step with a touchdown angle of at least so much [rad].
        look: what is expected of a decision sideways.
        options: scaled to the template.

    Returns:
        ``decision`` itself where its foothold is in reach, or no steeper step helps; else the step
        that leaves the least error. It is not nominal.
    """
    best, now = decision, look(decision)
    if not now.beyond > options.beyond:
        return decision
    angle, bar = float(decision.controls[Slot.TOUCHDOWN_ANGLE]), options.gain * now.price
    for more in options.steeper:
        steeper = decide(angle + more)
        if not steeper.feasible:
            break
        then = look(steeper)
        if then.price < bar:
            best, bar = replace(steeper, nominal=False), then.price
    return best
