"""Steps to fall of the walking template: how far from a gait it still comes back.

A state at VLO is given as in Section IV-D by height y, velocity angle phi (positive
downward) and energy E, the stance spring's included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from template_control.arrays import Array, BoolArray, IntArray
from template_control.checks.checked import checked
from template_control.checks.ranges import Range, Shape
from template_control.compiled import compiled, inner
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Outcome, StrideKind
from template_control.slip.dynamics.kernel import Scratch, new_scratch
from template_control.slip.dynamics.model import Kernel, stride_kernel
from template_control.slip.maps.return_map import EXACT, RESULTS, one_stride
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

_WINDOW = 5
_THERE = 0.01  # as near as this, it need not come nearer
_SHRINKS = 0.95  # of the distance half-way must be left at most: no other gait, no cycle
_LARGEST, _RADII, _DIRECTIONS = 0.05, 50, 32  # of the discs of a margin; the first over l0
_HEIGHT, _ANGLE = 0.01, np.radians(1.0)  # what counts as equally far, per l0 and in angle


def _for_each(name: str, rows: Array, count: int) -> Array:
    """One row, or ``count`` of them, as ``count`` rows."""
    if rows.ndim > 2 or (rows.ndim == 2 and len(rows) != count):
        raise ParameterError(f"{name} has shape {rows.shape}: give one row, or {count} of them")
    return np.array(np.broadcast_to(rows, (count, rows.shape[-1])), order="C")


@checked
def vlo_state(parameters: SlipParameters, y: ArrayLike, phi: ArrayLike, energy: ArrayLike) -> Array:
    """VLO states from height, direction of the velocity and energy; shapes broadcast.

    Args:
        parameters: the template; the stance leg has its stiffness k0.
        y: (...) height of the CoM [m].
        phi: (...) angle of the velocity, positive downward [rad].
        energy: (...) mechanical energy [J].

    Returns:
        (..., 3) dx/dt, y, dy/dt; the speeds are NaN where the energy does not suffice.
    """
    given = {"y": y, "phi": phi, "energy": energy}
    try:
        y, phi, energy = np.broadcast_arrays(*given.values())
    except ValueError:
        shapes = ", ".join(f"{name} {np.shape(array)}" for name, array in given.items())
        raise ParameterError(f"shapes do not go together: {shapes}; give as many of each") from None
    v = VLO.speed(parameters, y, energy)
    return np.stack((v * np.cos(phi), y, -v * np.sin(phi)), axis=-1)


@checked
def velocity_angle(z: Annotated[Array, Shape((..., 3), finite=False)]) -> Array:
    """phi of VLO states (..., 3), positive downward [rad]."""
    return np.asarray(-np.arctan2(z[..., 2], z[..., 0]))


@inner
def _steps(
    kernel: Kernel,
    z: Array,
    controls: Array,
    goal: Array,
    limit: int,
    scratch: Scratch,
    result: Array,
) -> tuple[int, bool]:
    """Number of steps from ``z``, overwritten by the last VLO, and whether they lead to y, phi."""
    early = middle = late = 0.0
    for step in range(limit):
        if one_stride(kernel, EXACT, z, controls, scratch, result) != Outcome.SECTION:
            return step, False
        for i in range(3):
            z[i] = result[i]
        height = (z[1] - goal[0]) / (_HEIGHT * kernel.rest_length)
        angle = (-np.arctan2(z[2], z[0]) - goal[1]) / _ANGLE
        distance = np.sqrt(height * height + angle * angle)
        if step < _WINDOW:
            early = max(early, distance)
        if 2 * step >= limit - _WINDOW and 2 * step < limit + _WINDOW:
            middle = max(middle, distance)
        if step >= limit - _WINDOW:
            late = max(late, distance)
    return limit, late < _THERE or (late < _SHRINKS * middle and late < early)


@compiled
def _many(
    kernel: Kernel, z: Array, controls: Array, goal: Array, limit: int, scratch: Scratch
) -> tuple[IntArray, BoolArray]:
    """:func:`_steps` for every row of ``z``, ``controls`` and ``goal``."""
    steps, converges = np.zeros(z.shape[0], np.int64), np.zeros(z.shape[0], np.bool_)
    result = np.empty(RESULTS)
    for i in range(z.shape[0]):
        if np.isfinite(z[i, 0]):
            steps[i], converges[i] = _steps(
                kernel, z[i], controls[i], goal[i], limit, scratch, result
            )
    return steps, converges


@dataclass(frozen=True)
class StepsToFall:
    """Result of :func:`steps_to_fall`.

    Attributes:
        steps: (n,) steps taken before a failure, at most the limit.
        converges: (n,) all steps were taken, and the distance from the gait (1 cm, for l0 =
            1 m, counting as much as 1 degree) shrank: the farthest of the last five is less
            than that of the first five and of five half-way, or it is under 0.1 mm.
        last: (n, 3) VLO state after the last step taken.
    """

    steps: IntArray
    converges: BoolArray
    last: Array


@checked
def steps_to_fall(
    parameters: SlipParameters,
    z: Annotated[Array, Shape((None, 3), finite=False)],
    controls: Annotated[Array, Shape((..., NUM_SLOTS), finite=False)],
    goal: Annotated[Array, Shape((..., 2))],
    limit: Annotated[int, Range(1, 100_000)] = 50,
) -> StepsToFall:
    """Walk passively from many states.

    Args:
        parameters: the template.
        z: (n, 3) VLO states; NaN counts as no step.
        controls: (n, NUM_SLOTS), or one (NUM_SLOTS,) for all; NaN counts as no step.
        goal: (n, 2) or (2,) y [m] and phi [rad] of the gait each should come to.
        limit: steps to take.
    """
    states = np.array(z, dtype=float, order="C")  # another layout would be compiled anew
    count = len(states)
    steps, converges = _many(
        stride_kernel(parameters, StrideKind.WALK),
        states,
        _for_each("controls", controls, count),
        _for_each("goal", goal, count),
        limit,
        new_scratch(),
    )
    return StepsToFall(steps, converges, states)


@checked
def margin(
    parameters: SlipParameters,
    controls: Annotated[Array, Shape((NUM_SLOTS,))],
    goal: tuple[float, float],
    energy: float,
) -> float:
    """Radius of the largest disc around a gait from which walking converges to it.

    Args:
        parameters: the template.
        controls: (NUM_SLOTS,) of the gait.
        goal: its y [m] and phi [rad] at VLO.
        energy: its energy [J]; all states of the disc have it.

    Returns:
        The radius over l0 in height, 0.05 at most; in velocity angle 1 degree counts as 0.01.
    """
    radii = np.linspace(_LARGEST / _RADII, _LARGEST, _RADII)
    turn = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    r, t = np.meshgrid(radii, turn, indexing="ij")
    y = goal[0] + r * parameters.rest_length * np.cos(t)
    phi = goal[1] + r / _HEIGHT * _ANGLE * np.sin(t)
    z = vlo_state(parameters, y.ravel(), phi.ravel(), energy)
    good = steps_to_fall(parameters, z, controls, np.array(goal)).converges.reshape(r.shape)
    lost = np.flatnonzero(~good.all(axis=1))
    if not lost.size:
        return float(radii[-1])
    return float(radii[lost[0] - 1]) if lost[0] else 0.0
