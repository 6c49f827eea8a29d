"""A foot has landed higher or lower than the template's: its legs are chosen again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Count, Index, Interval, NotNegative, Positive
from template_control.embedding.planners.planner import Ahead, Decision
from template_control.embedding.planners.regularised import FromHere, Prior, solve_stride
from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.similarity import ACCELERATION, LENGTH, SPEED, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class UnexpectedGroundOptions(Checked):
    """How the stiffnesses are chosen where the ground is not where it was thought.

    A template that steps up ends its stride slow and sinking. Legs that push longer give back
    some of the energy that the climb took. One that steps down ends it fast, and a step can brake
    only from some of the states that it may end in: a planner tells them by their price.

    Attributes:
        height: of the ground under the foot that has landed, over that under the other one, from
            which on they are chosen again [m].
        tolerance: errors of dx/dt, y, dy/dt where the stride ends that count as 1.
        change: of a stiffness, over the gait's, that counts as 1.
        bounds: of the stiffnesses over the gait's.
        rounds: Gauss-Newton steps.
        tries: points of the grid of stiffnesses whose ends the planner prices.
        effort: what a change that counts as 1 adds to the planner's price.
        assist: largest change of the forward acceleration that two legs add in such a step [m/s^2].
    """

    height: NotNegative = tuned(0.008, LENGTH)
    tolerance: tuple[Positive, Positive, Positive] = tuned((0.1, 0.02, 0.1), SPEED, LENGTH, SPEED)
    change: Positive = tuned(0.5)
    bounds: Interval = tuned((0.5, 2.0))
    rounds: Index = tuned(5)
    tries: Count = tuned(36)
    effort: NotNegative = tuned(0.1)
    assist: NotNegative = tuned(1.5, ACCELERATION)


class _Pricing(NamedTuple):
    """What makes a choice dear: the state that it leads to, and how far it is from the gait's.

    Attributes:
        price: of a state.
        gait: (f,) the gait's stiffnesses [N/m].
        options: tuning.
    """

    price: Callable[[Array], float]
    gait: Array
    options: UnexpectedGroundOptions

    def effort(self, x: Array) -> float:
        """Of stiffnesses ``x`` (f,) [N/m]."""
        change = (x / self.gait - 1.0) / self.options.change
        return float(self.options.effort * (change @ change))


def choose_legs(
    ahead: Ahead,
    decision: Decision,
    target: Array,
    free: Sequence[int],
    nominal: Array,
    options: UnexpectedGroundOptions,
    price: Callable[[Array], float] | None = None,
) -> Decision:
    """The decision with the stiffnesses that lead the rest of a stride to the cheapest end.

    Without a price that is the end nearest to the target.

    Args:
        ahead: where the stride ends from here, by its controls.
        decision: what holds so far.
        target: (n,) state that the stride is to end in.
        free: slots of the stiffnesses that the rest of the stride depends on.
        nominal: (NUM_SLOTS,) the gait's controls.
        options: tuning.
        price: of the state where a stride ends, to the planner of the next one.
    """
    o, controls = options, decision.controls
    stiff = [slot for slot in free if slot != Slot.TOUCHDOWN_ANGLE and nominal[slot] > 0.0]
    base = nominal[stiff]
    lower, upper = (share * base for share in o.bounds)
    now = np.clip(controls[stiff], lower, upper)
    table = np.array([now, o.change * base, lower, upper])
    prior = Prior(controls.copy(), stiff, table, o.rounds)
    u, end = solve_stride(FromHere(ahead, stiff), target, prior, np.array(o.tolerance))
    if price is not None:
        u, end = _cheapest(u, end, prior, ahead, _Pricing(price, nominal[stiff], o))
    if end is None:
        return decision
    return replace(decision, controls=u, predicted=end, nominal=False)


def _cheapest(
    u: Array, end: Array | None, prior: Prior, ahead: Ahead, pricing: _Pricing
) -> tuple[Array, Array | None]:
    """The cheapest of a grid within the bounds, and of controls ``u`` that lead to ``end``."""
    stiff = prior.slots
    least = np.inf if end is None else pricing.price(end) + pricing.effort(u[stiff])
    points = max(2, round(pricing.options.tries ** (1.0 / max(len(stiff), 1))))
    axes = [np.linspace(*ends, points) for ends in zip(prior.lower, prior.upper, strict=True)]
    for x in np.array(list(product(*axes))):
        effort = pricing.effort(x)
        if effort >= least:
            continue
        tried = prior.controls.copy()
        tried[stiff] = x
        there, outcome = ahead(tried)
        if outcome is not Outcome.SECTION:
            continue
        cost = effort + pricing.price(there)
        if cost < least:
            least, u, end = cost, tried, there
    return u, end
