"""A foot has landed higher or lower than the template's: its legs are chosen again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Index, Interval, NotNegative, Positive
from template_control.embedding.planners.planner import Ahead, Decision
from template_control.embedding.planners.regularised import FromHere, Prior, solve_stride
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.similarity import LENGTH, SPEED, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class UnexpectedGroundOptions(Checked):
    """How the stiffnesses are chosen where the ground is not where it was thought.

    A template that steps up ends its stride slow and sinking. Legs that push longer give back
    some of the energy that the climb took.

    Attributes:
        height: of the ground under the foot that has landed, over that under the other one, from
            which on they are chosen again [m].
        tolerance: errors of dx/dt, y, dy/dt where the stride ends that count as 1.
        change: of a stiffness, over the gait's, that counts as 1.
        bounds: of the stiffnesses over the gait's.
        rounds: Gauss-Newton steps.
    """

    height: NotNegative = tuned(0.008, LENGTH)
    tolerance: tuple[Positive, Positive, Positive] = tuned((0.1, 0.02, 0.1), SPEED, LENGTH, SPEED)
    change: Positive = tuned(0.5)
    bounds: Interval = tuned((0.5, 2.0))
    rounds: Index = tuned(5)


def choose_legs(
    ahead: Ahead,
    decision: Decision,
    target: Array,
    free: Sequence[int],
    nominal: Array,
    options: UnexpectedGroundOptions,
) -> Decision:
    """The decision with the stiffnesses that lead the rest of a stride nearest to its target.

    Args:
        ahead: where the stride ends from here, by its controls.
        decision: what holds so far.
        target: (n,) state that the stride is to end in.
        free: slots of the stiffnesses that the rest of the stride depends on.
        nominal: (NUM_SLOTS,) the gait's controls.
        options: tuning.
    """
    o, controls = options, decision.controls
    stiff = [slot for slot in free if slot != Slot.TOUCHDOWN_ANGLE and nominal[slot] > 0.0]
    base = nominal[stiff]
    lower, upper = (share * base for share in o.bounds)
    now = np.clip(controls[stiff], lower, upper)
    prior = Prior(controls.copy(), stiff, now, o.change * base, lower, upper, o.rounds)
    u, end = solve_stride(FromHere(ahead, stiff), target, prior, np.array(o.tolerance))
    if end is None:
        return decision
    return replace(decision, controls=u, predicted=end, nominal=False)
