"""Steps to fall of the walking template: how far from a gait it still comes back.

A state at VLO is given as in Section IV-D by height y, velocity angle phi (positive
downward) and energy E, the stance spring's included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from template_control.slip.automaton import AUTOMATON, STRIDE_START
from template_control.slip.compiled import inner
from template_control.slip.kernel import Model, Scratch, new_scratch
from template_control.slip.parameters import SlipParameters
from template_control.slip.section_map import RESULTS, section_map
from template_control.slip.stride import kernel_model
from template_control.slip.tables import TABLES, Tables
from template_control.slip.vocabulary import MapKind, Outcome

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_EXACT = int(MapKind.EXACT)
_SECTION = int(Outcome.SECTION)
_WINDOW = 5
_NEAR = 0.5
_THERE = 0.01  # as near as this, it need not come nearer
_HEIGHT, _ANGLE = 0.01, np.radians(1.0)  # what counts as equally far, per l0 and in angle


def vlo_state(parameters: SlipParameters, y: ArrayLike, phi: ArrayLike, energy: ArrayLike) -> Array:
    """VLO states (..., 3) dx/dt, y, dy/dt from height [m], velocity angle [rad], energy [J].

    NaN where the energy does not suffice.
    """
    p = parameters
    y, phi, energy = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (y, phi, energy)))
    potential = p.mass * p.gravity * y + 0.5 * p.leg_stiffness * (p.rest_length - y) ** 2
    squared = 2.0 * (energy - potential) / p.mass
    v = np.sqrt(np.where(squared > 0.0, squared, np.nan))
    return np.stack((v * np.cos(phi), y, -v * np.sin(phi)), axis=-1)


def velocity_angle(z: Array) -> Array:
    """phi of VLO states (..., 3), positive downward [rad]."""
    return np.asarray(-np.arctan2(z[..., 2], z[..., 0]))


@inner
def _steps(
    tables: Tables,
    model: Model,
    node: int,
    z: Array,
    controls: Array,
    goal: Array,
    limit: int,
    scratch: Scratch,
    result: Array,
) -> tuple[int, float, float]:
    """Steps taken (at most ``limit``), and the farthest from ``goal`` early and late.

    ``z`` (3,) is overwritten with the last VLO state; ``goal`` (2,) is y, phi.
    """
    early = late = 0.0
    for step in range(limit):
        if section_map(tables, model, _EXACT, node, z, controls, scratch, result) != _SECTION:
            return step, early, np.inf
        for i in range(3):
            z[i] = result[i]
        height = (z[1] - goal[0]) / (_HEIGHT * model.rest_length)
        angle = (-np.arctan2(z[2], z[0]) - goal[1]) / _ANGLE
        distance = np.sqrt(height * height + angle * angle)
        if step < _WINDOW:
            early = max(early, distance)
        if step >= limit - _WINDOW:
            late = max(late, distance)
    return limit, early, late


@njit(cache=True)
def _many(
    tables: Tables,
    model: Model,
    node: int,
    z: Array,
    controls: Array,
    goal: Array,
    limit: int,
    scratch: Scratch,
    steps: IntArray,
    converges: NDArray[np.bool_],
) -> None:
    result = np.empty(RESULTS)
    for i in range(z.shape[0]):
        steps[i] = 0
        converges[i] = False
        if np.isfinite(z[i, 0]):
            steps[i], early, late = _steps(
                tables, model, node, z[i], controls[i], goal[i], limit, scratch, result
            )
            converges[i] = steps[i] == limit and late < min(max(early, _THERE), _NEAR)


@dataclass(frozen=True)
class StepsToFall:
    """Result of :func:`steps_to_fall`.

    Attributes:
        steps: (n,) steps taken before a failure, at most the limit.
        converges: (n,) all steps were taken, and the last five stay within 5 mm (for l0 =
            1 m) and 0.5 degrees of the gait, and nearer it than the first five did.
        last: (n, 3) VLO state after the last step taken.
    """

    steps: IntArray
    converges: NDArray[np.bool_]
    last: Array


def steps_to_fall(
    parameters: SlipParameters, z: Array, controls: Array, goal: Array, limit: int = 50
) -> StepsToFall:
    """Walk passively from many states.

    Args:
        parameters: the template.
        z: (n, 3) VLO states; NaN counts as no step.
        controls: (n, NUM_SLOTS), or one (NUM_SLOTS,) for all.
        goal: (n, 2) or (2,) y [m] and phi [rad] of the gait each should come to.
        limit: steps to take.
    """
    states = np.array(z, dtype=float)
    count = len(states)
    steps, converges = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.bool_)
    _many(
        TABLES,
        kernel_model(parameters),
        AUTOMATON.index[STRIDE_START["w"]],
        states,
        np.ascontiguousarray(np.broadcast_to(controls, (count, np.shape(controls)[-1]))),
        np.ascontiguousarray(np.broadcast_to(goal, (count, 2))),
        limit,
        new_scratch(),
        steps,
        converges,
    )
    return StepsToFall(steps, converges, states)
