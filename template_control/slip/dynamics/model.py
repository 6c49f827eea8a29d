"""Physics of a compiled stride and its start in the automaton, and the dynamics' Taylor series.

The right-hand side is built from sums, products and one power, so all Taylor
coefficients of the CoM path follow from recurrences (automatic differentiation of the
ODE; Jorba and Zou 2005). A phase then takes one to three steps, each a polynomial that
also serves as dense output and as the path on which events are located.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import inner
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Tables
from template_control.slip.parameters import SlipParameters

ORDER = 16
"""Degree of the polynomials."""

TOLERANCE = 1e-13
"""Size of the last terms relative to the rest length; sets the step."""


class Kernel(NamedTuple):
    """A kind of stride of one template: the packed automaton, the physics, and the first node."""

    tables: Tables
    mass: float  # [kg]
    gravity: float  # into the ground [m/s^2]
    along: float  # gravity along the ground, backward positive [m/s^2]
    assist: float  # forward acceleration that two legs add to their springs' [m/s^2]
    rest_length: float  # l0 [m]
    max_time: float  # a stride that takes longer counts as failed [s]
    node: int  # index of the first node
    degree: int = ORDER  # of the polynomials
    tolerance: float = TOLERANCE  # size of their last terms, over the rest length


def node_kernel(
    parameters: SlipParameters, automaton: Automaton, node: int = 0, max_time: float | None = None
) -> Kernel:
    """The kernel of strides from a node; ``max_time`` is 20 sqrt(l0/g) by default [s]."""
    p = parameters
    limit = 20.0 * np.sqrt(p.rest_length / p.gravity) if max_time is None else max_time
    physics = (p.mass, *p.gravity_parts, p.assist, p.rest_length, float(limit))
    return Kernel(automaton.tables, *physics, node)


def stride_kernel(
    parameters: SlipParameters, stride: str, automaton: Automaton = AUTOMATON
) -> Kernel:
    """The kernel of a kind of stride, a key of the automaton's ``starts``."""
    return node_kernel(parameters, automaton, automaton.index[automaton.start(stride).name])


@inner
def backward(kernel: Kernel, stiffness: Array) -> float:
    """Acceleration along the ground by all but the springs, backward positive [m/s^2]."""
    if stiffness[0] == 0.0 or stiffness[1] == 0.0:
        return kernel.along
    return kernel.along - kernel.assist


@inner
def expand(
    state: Array,
    toes: Array,
    stiffness: Array,
    physics: tuple[float, float, float, float, float],
    cx: Array,
    cy: Array,
    work: Array,
) -> float:
    """Write the Taylor coefficients x(t) = sum cx[i] t^i of the CoM's path from ``state``, and y.

    Of as many as there is room for. ``physics`` are m, gravity and :func:`backward` in this node,
    l0 and the kernel's tolerance: a call with all of it, 30 arguments for Numba, takes longer.
    Returns the step [s] within which the last terms are so small; ``work`` (2, 4, ORDER + 1) is
    overwritten.
    """
    mass, gravity, along, rest_length, tolerance = physics
    degree = cx.shape[0] - 1
    cx[0], cy[0], cx[1], cy[1] = state[0], state[1], state[2], state[3]
    for n in range(degree - 1):
        ax = ay = 0.0
        if n == 0:
            ax, ay = ax - along, ay - gravity
        for leg in range(2):
            if stiffness[leg] == 0.0:
                continue
            d, s, q, w = work[leg, 0], work[leg, 1], work[leg, 2], work[leg, 3]
            d[n] = cx[n] - (toes[leg] if n == 0 else 0.0)
            total = 0.0
            for j in range((n + 1) // 2):
                total += d[j] * d[n - j] + cy[j] * cy[n - j]
            total *= 2.0
            if n % 2 == 0:
                total += d[n // 2] * d[n // 2] + cy[n // 2] * cy[n // 2]
            s[n] = total
            if n == 0:
                q[0] = 1.0 / np.sqrt(total)
                w[0] = stiffness[leg] / mass * (rest_length * q[0] - 1.0)
            else:
                total = 0.0
                for j in range(n):
                    total += (-0.5 * (n - j) - j) * s[n - j] * q[j]
                q[n] = total / (n * s[0])
                w[n] = stiffness[leg] / mass * rest_length * q[n]
            for j in range(n + 1):
                ax += w[j] * d[n - j]
                ay += w[j] * cy[n - j]
        scale = 1.0 / ((n + 1) * (n + 2))
        cx[n + 2] = ax * scale
        cy[n + 2] = ay * scale
    step = np.inf
    for n in (degree - 1, degree):
        size = max(abs(cx[n]), abs(cy[n])) / rest_length
        if size > 0.0:
            step = min(step, (tolerance / size) ** (1.0 / n))
    return step


@inner
def steepest(cx: Array, cy: Array, step: float) -> tuple[float, float, float]:
    """Bounds of the CoM's speed, acceleration and jerk within ``step`` [m/s, m/s^2, m/s^3].

    The derivatives' series with absolute values; a vector is at most |x| + |y| long.
    """
    acceleration = jerk = 0.0
    squared = step * step
    for n in range(cx.shape[0] - 1, 2, -2):  # by twos, for a shorter chain of products
        even = n * (n - 1) * step * (abs(cx[n]) + abs(cy[n]))
        odd = (n - 1) * (n - 2) * (abs(cx[n - 1]) + abs(cy[n - 1]))
        acceleration = acceleration * squared + (even + odd)
        jerk = jerk * squared + ((n - 2) * even + (n - 3) * odd)
    acceleration = acceleration * step + 2.0 * (abs(cx[2]) + abs(cy[2]))
    speed = abs(cx[1]) + abs(cy[1]) + acceleration * step
    return speed, acceleration, jerk
