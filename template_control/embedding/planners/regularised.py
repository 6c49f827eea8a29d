"""One stride ahead: least squares on a return map, against changes of the controls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.gauss_newton import improve
from template_control.embedding.planners.planner import Ahead
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED

Array = NDArray[np.float64]

_DIFFERENCE = 1e-6  # of a control
_GRID = 5  # points of each control, where the base's stride fails
_CLOSE = 0.03  # a step this short, in units of change, is the last: what it leaves is its square


@dataclass(frozen=True)
class Prior:
    """Controls that a stride would have, were there no target.

    Attributes:
        controls: (NUM_SLOTS,) u by Slot; those that are not free stay.
        slots: the f free ones.
        table: (4, f) of these: their values, changes that count as 1, lower and upper bounds.
        rounds: Gauss-Newton steps.
    """

    controls: Array
    slots: list[int]
    table: Array
    rounds: int

    @property
    def base(self) -> Array:
        """(f,) values of the free controls."""
        return self.table[0]

    @property
    def change(self) -> Array:
        """(f,) changes that count as 1."""
        return self.table[1]

    @property
    def lower(self) -> Array:
        """(f,) lower bounds."""
        return self.table[2]

    @property
    def upper(self) -> Array:
        """(f,) upper bounds."""
        return self.table[3]


class StrideEnd(Protocol):
    """Where a stride, or the rest of one, ends with given controls."""

    def at(self, u: Array) -> tuple[Array, Outcome]:
        """(m,) state at the section where it ends, and how, with (NUM_SLOTS,) controls ``u``."""

    def slopes(self, u: Array) -> tuple[Array, Array, Outcome]:
        """As :meth:`at`, with the (m, f) derivatives by the free controls in the middle."""


@dataclass(frozen=True)
class FromSection:
    """A whole stride, with exact derivatives.

    Attributes:
        step: the map.
        z: (n,) where the stride begins.
        slots: the free controls.
    """

    step: ReturnMap
    z: Array
    slots: Sequence[int]

    def at(self, u: Array) -> tuple[Array, Outcome]:
        """See :class:`StrideEnd`."""
        return self.step.step(self.z, u)

    @cached_property
    def columns(self) -> NDArray[np.int64]:
        """Places of the free controls among the map's arguments."""
        return np.array(self.slots) + PADDED

    def slopes(self, u: Array) -> tuple[Array, Array, Outcome]:
        """See :class:`StrideEnd`."""
        m, columns = self.step.dimensions[1], self.columns
        result, jacobian, outcome = self.step.derivatives(self.z, u, columns)
        return result[:m], jacobian[:m], outcome


@dataclass(frozen=True)
class FromHere:
    """The rest of a stride, with differences: no map begins within one.

    Attributes:
        ahead: where it ends.
        slots: the free controls.
    """

    ahead: Ahead
    slots: Sequence[int]

    def at(self, u: Array) -> tuple[Array, Outcome]:
        """See :class:`StrideEnd`."""
        return self.ahead(u)

    def slopes(self, u: Array) -> tuple[Array, Array, Outcome]:
        """See :class:`StrideEnd`."""
        end, outcome = self.ahead(u)
        jacobian = np.zeros((len(end), len(self.slots)))
        for column, slot in enumerate(self.slots):
            changed = u.copy()
            changed[slot] *= 1.0 + _DIFFERENCE
            other, how = self.ahead(changed)
            if how is not Outcome.SECTION:
                return end, jacobian, how
            jacobian[:, column] = (other - end) / (changed[slot] - u[slot])
        return end, jacobian, outcome


def solve_stride(
    stride: StrideEnd, aim: Array, prior: Prior, tolerance: Array
) -> tuple[Array, Array | None]:
    """min |(P(u) - aim) / tolerance|^2 + |(u - base) / change|^2 over bounded u.

    Args:
        stride: its P.
        aim: (m,) where the stride should end.
        prior: the free controls.
        tolerance: (m,) errors that count as 1.

    Returns:
        (NUM_SLOTS,) controls; (m,) where the stride ends, None where none of those tried completes
        it.
    """
    u = prior.controls.copy()
    wish, errors = np.array([aim, tolerance])
    here, by_state = np.empty(0), np.empty((len(wish), 0))  # the state is what it is
    x = prior.base
    best: tuple[float, Array, Array] | None = None
    for number in range(prior.rounds + 1):
        u[prior.slots] = x
        end, jacobian, outcome = stride.slopes(u)
        if outcome is not Outcome.SECTION:
            if best is not None:
                x = 0.5 * (x + best[1])
            elif number == 0:
                x = _from_grid(stride, aim, prior, tolerance)
            else:
                break
            continue
        linear = here, x, end, by_state, jacobian
        cost, longest, there, _ = improve(linear, here, wish, errors, prior.table)
        if best is not None and cost >= best[0]:
            x = 0.5 * (x + best[1])
            continue
        best = (cost, x, end)
        if longest < _CLOSE:
            u[prior.slots] = there
            end, outcome = stride.at(u)
            if outcome is Outcome.SECTION:
                return u, end
            break
        x = there
    if best is None:
        u[prior.slots] = prior.base
        return u, None
    u[prior.slots] = best[1]
    return u, best[2]


def _from_grid(stride: StrideEnd, aim: Array, prior: Prior, tolerance: Array) -> Array:
    """The best of a grid within the bounds; the base where all of it fails."""
    u = prior.controls.copy()
    axes = [
        np.linspace(low, high, _GRID) for low, high in zip(prior.lower, prior.upper, strict=True)
    ]
    best, least = prior.base, np.inf
    for x in np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes)):
        u[prior.slots] = x
        end, outcome = stride.at(u)
        if outcome is Outcome.SECTION:
            residual = np.concatenate(((end - aim) / tolerance, (x - prior.base) / prior.change))
            cost = float(residual @ residual)
            if cost < least:
                best, least = x, cost
    return best
