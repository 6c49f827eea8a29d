"""One stride ahead: least squares on a return map, against changes of the controls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Controls that a stride would have, were there no target.

    Attributes:
        controls: (5,) u by Slot; those that are not free stay.
        slots: the f free ones.
        base: (f,) their values.
        change: (f,) changes that count as 1.
        lower, upper: (f,) bounds.
        rounds: Gauss-Newton steps.
    """

    controls: Array
    slots: list[int]
    base: Array
    change: Array
    lower: Array
    upper: Array
    rounds: int


def solve_stride(
    step: ReturnMap, z: Array, aim: Array, prior: Prior, tolerance: Array
) -> tuple[Array, Array, Outcome]:
    """min |(P(z, u) - aim) / tolerance|^2 + |(u - base) / change|^2 over bounded u.

    Args:
        step: the map P.
        z: (n,) where the stride begins.
        aim: (m,) where it should end.
        prior: the free controls.
        tolerance: (m,) errors that count as 1.

    Returns:
        (5,) controls, (m,) where the stride ends, and how.
    """
    m = step.dimensions[1]
    columns = np.array(prior.slots) + PADDED
    x, u = prior.base.copy(), prior.controls.copy()
    best: tuple[float, Array] | None = None
    for _ in range(prior.rounds + 1):
        u[prior.slots] = x
        result, jacobian, outcome = step.derivatives(z, u, columns)
        if outcome is not Outcome.SECTION:
            if best is None:
                break
            x = 0.5 * (x + best[1])
            continue
        residual = np.concatenate(((result[:m] - aim) / tolerance, (x - prior.base) / prior.change))
        cost = float(residual @ residual)
        if best is not None and cost >= best[0]:
            x = 0.5 * (x + best[1])
            continue
        best = (cost, x.copy())
        rows = np.vstack((jacobian[:m] / tolerance[:, None], np.diag(1.0 / prior.change)))
        x = bounded_step(rows, residual, x, prior.lower, prior.upper)
    u[prior.slots] = prior.base if best is None else best[1]
    end, outcome = step.step(z, u)
    return u, end if outcome is Outcome.SECTION else aim, outcome


def bounded_step(rows: Array, residual: Array, x: Array, lower: Array, upper: Array) -> Array:
    """x + dx with the least |rows dx + residual| between the bounds.

    A variable that would leave its bounds is held there, and the others are solved for again.

    Args:
        rows: (r, f) Jacobian of the residual.
        residual: (r,) at x.
        x: (f,) within the bounds.
        lower, upper: (f,) bounds.
    """
    free = upper > lower
    step = np.clip(x, lower, upper) - x
    for _ in range(len(x)):
        left = residual + rows @ np.where(free, 0.0, step)
        step[free] = -np.linalg.lstsq(rows[:, free], left, rcond=None)[0]
        beyond = free & ((x + step < lower) | (x + step > upper))
        if not beyond.any():
            break
        step[beyond] = np.clip(x + step, lower, upper)[beyond] - x[beyond]
        free &= ~beyond
    return np.clip(x + step, lower, upper)
