"""Paths of the CoM as functions of time that guards can be located on.

Three kinds: ``SERIES`` (the exact kernel's Taylor polynomials), ``STANCE`` (the closed form
(11) about a pivot) and ``FLIGHT`` (10). Compiled code gives the kind as one of these
constants, an argument of its own, and Numba compiles that kind alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from template_control.compiled import inner_by_type

Array = NDArray[np.float64]

SERIES, STANCE, FLIGHT = 0, 1, 2
COEFFICIENTS = 12


class Path(NamedTuple):
    """A path of the CoM in time, world frame, by its coefficients.

    Attributes:
        a, b: SERIES: those of the polynomials of x and y, constant term first. STANCE: a is
            (12,), about a pivot at x = a0, r = a1 + a8 t + a9 t^2 + a2 sin(a5 t) + a3 cos(a5 t) and
            theta = a4 + a6 t + a10 t^2 + a11 t^3 + a7 (a2 cos(a5 t) - a3 sin(a5 t)), which
            is (11) where a8 to a11 are zero. FLIGHT: a is (6,) x, y, dx/dt, dy/dt at t = 0
            and gravity, into the ground and along it. The latter two do not read b.
    """

    a: Array
    b: Array


def _series(kind: int, path: Path, t: float, out: Array) -> None:
    a, b = path
    x = y = u = v = ax = ay = 0.0 * a[0]
    for n in range(a.shape[0] - 1, -1, -1):
        ax = ax * t + u
        ay = ay * t + v
        u = u * t + x
        v = v * t + y
        x = x * t + a[n]
        y = y * t + b[n]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, u, v, 2.0 * ax, 2.0 * ay


def _stance(kind: int, path: Path, t: float, out: Array) -> None:
    a = path.a
    w, swing = a[5], a[7]
    s, c = np.sin(w * t), np.cos(w * t)
    ds, dc = a[2] * s + a[3] * c, a[2] * c - a[3] * s
    r = a[1] + (a[8] + a[9] * t) * t + ds
    dr = a[8] + 2.0 * a[9] * t + w * dc
    ddr = 2.0 * a[9] - w * w * ds
    theta = a[4] + (a[6] + (a[10] + a[11] * t) * t) * t + swing * dc
    rate = a[6] + (2.0 * a[10] + 3.0 * a[11] * t) * t - swing * w * ds
    curve = 2.0 * a[10] + 6.0 * a[11] * t - swing * w * w * dc
    s, c = np.sin(theta), np.cos(theta)
    radial, tangential = ddr - r * rate * rate, 2.0 * dr * rate + r * curve
    out[0], out[1] = a[0] + r * c, r * s
    out[2], out[3] = dr * c - r * rate * s, dr * s + r * rate * c
    out[4] = radial * c - tangential * s
    out[5] = radial * s + tangential * c


def _flight(kind: int, path: Path, t: float, out: Array) -> None:
    a = path.a
    out[0], out[1] = a[0] + (a[2] - 0.5 * a[5] * t) * t, a[1] + (a[3] - 0.5 * a[4] * t) * t
    out[2], out[3] = a[2] - a[5] * t, a[3] - a[4] * t
    out[4], out[5] = -a[5] + 0.0 * t, -a[4] + 0.0 * t


_BY_KIND = (_series, _stance, _flight)


def sample(kind: int, path: Path, t: float, out: Array) -> None:
    """Write x, y and their first two derivatives at ``t`` [s] into ``out`` (6,).

    Args:
        kind: SERIES, STANCE or FLIGHT.
        path: its coefficients.
        t: since the start of the path [s].
        out: overwritten.
    """
    _BY_KIND[kind](kind, path, t, out)


@inner_by_type(sample)
def _kind(kind: Any, path: Any, t: Any, out: Any) -> Any:
    """That of the literal ``kind``: Numba would compile the branches of all of them."""
    return _BY_KIND[kind.literal_value] if isinstance(kind, types.IntegerLiteral) else None
