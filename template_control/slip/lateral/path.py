"""The template's sideways motion along its planar path, to the first order.

Frame: x forward, y to the left, z up; the height that the planar template calls y is z here.
In space each leg is a massless spring from its toe (x_i, y_i, 0) to the CoM (x, y, z), with the
planar length l_i, the length L_i, L_i^2 = l_i^2 + (y - y_i)^2, and the force F_i = k (l0 - L_i):

    m d2y/dt2 = sum_i F_i (y - y_i) / L_i.

F_i and L_i depend on y - y_i in the second order only. So to the first order x and z go along the
planar path, and

    d2y/dt2 = sum_i c_i(t) (y - y_i),   c_i = f_i / (m l_i),

where f_i is the leg force of the planar path. By the mirror symmetry of left and right the error
of x and z is of the second order in y - y_i, and that of y of the third. For a robot whose CoM is
held on the planar path, and whose forces pass through the CoM, the equation is exact.

c_i follows from the path itself, whatever makes its forces: sum_i c_i = (d2z/dt2 + g) / z, and in
double stance sum_i c_i x_i = sum_i c_i x - d2x/dt2.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import Leg, Reset
from template_control.slip.dynamics.guards import SERIES, Path, sample
from template_control.slip.dynamics.stride import Stride, chained

NEXT = 2
"""Index of the next foothold; 0 and 1 are those of the rear and the front toe at the start."""

IN_AIR = -1
_SHARE = 0.08  # of sqrt(z / g), a step of the integration: errors of 1e-6
_SAME = 1e-12  # [s] two times that are one


class LateralPath(NamedTuple):
    """A planar path up to the first section after its next touchdown, for compiled functions.

    Attributes:
        coefficients: (2, n, ORDER + 1) polynomials of x and z of the segments.
        meta: (n, 7) start time, duration, node, toes, stiffnesses.
        footholds: (n, 2) index of the foothold that rear and front leg stand on; -1 in the air.
        gravity: g [m/s^2].
        longest: step of the integration [s].
        touchdown: time of the next touchdown [s], inf if the path has none.
        section: time of the first section after it [s], inf if the path does not come there or
            starts below the ground.
        stance: index, 0 or 1, of the foothold next to which the next foot lands.
        ratio: of dy/dt to that with the angular momentum about the CoM, as a robot sways; c_i is
            times it. 1 of the template, whose legs weigh nothing.
        stretch: single stance takes this times as long as on the path.
        nodes: (n,) times from which the motion is known, the last is the section [s].
        ahead: (n, 3, COLUMNS) y at the touchdown, and y and dy/dt at the section, per unit of y,
            dy/dt and each foothold's y at the nodes; after the touchdown the first is y itself.
    """

    coefficients: Array
    meta: Array
    footholds: IntArray
    gravity: float
    longest: float
    touchdown: float
    section: float
    stance: int
    ratio: float
    stretch: float
    nodes: Array
    ahead: Array


def lateral_path(
    strides: Sequence[Stride], gravity: float, ratio: float = 1.0, stretch: float = 1.0
) -> LateralPath:
    """Of strides each of which starts where the one before ended.

    Args:
        strides: at least one, such as those of the path that a robot follows.
        gravity: g [m/s^2].
        ratio, stretch: see :class:`LateralPath`.
    """
    whole, ends = chained(*strides), accumulate(stride.duration for stride in strides)
    footholds, touchdown, stance = _footholds(whole)
    height = float(whole.cy[0, 0])  # of a robot that falls it may be below its foot
    sections = (end for stride, end in zip(strides, ends, strict=True) if stride.completed)
    section = next((time for time in sections if time > touchdown), np.inf)
    path = LateralPath(
        coefficients=np.array([whole.cx, whole.cy]),
        meta=whole.meta,
        footholds=footholds,
        gravity=float(gravity),
        longest=_SHARE * float(np.sqrt(height / gravity)) if height > 0.0 else np.inf,
        touchdown=touchdown,
        section=section if height > 0.0 else np.inf,
        stance=stance,
        ratio=float(ratio),
        stretch=float(stretch),
        nodes=np.zeros(0),
        ahead=np.zeros((0, 3, COLUMNS)),
    )
    if not np.isfinite(path.section):
        return path
    nodes = _nodes(path)
    return path._replace(nodes=nodes, ahead=_ahead(path, nodes))


def _nodes(path: LateralPath) -> Array:
    """Times from the path's start to its section, as far apart as a step of the integration."""
    nodes = [np.zeros(1)]
    for start, duration in path.meta[:, :2]:
        until = min(start + duration, path.section)
        if until > start + _SAME:
            steps = int(np.ceil((until - start) / path.longest))
            nodes.append(np.linspace(start, until, steps + 1)[1:])
    return np.concatenate(nodes)


def _footholds(stride: Stride) -> tuple[IntArray, float, int]:
    """Foothold of each leg in each segment; time of the first landing, and next to which."""
    meta = stride.meta
    legs = np.arange(2)  # the foothold of each role
    landings: list[tuple[float, int]] = []
    footholds = np.tile(legs, (len(meta), 1))
    for time, *_, reset in stride.events:
        if reset in (Reset.SHIFT, Reset.SWAP):
            legs = legs[::-1].copy()
        elif reset in (Reset.PLACE_REAR, Reset.PLACE_FRONT):
            role = Leg.REAR if reset is Reset.PLACE_REAR else Leg.FRONT
            legs[role] = NEXT + len(landings)
            landings.append((time, int(legs[1 - role])))
        footholds[int(np.searchsorted(meta[:, 0], time - _SAME)) :] = legs
    footholds[meta[:, 5:7] == 0.0] = IN_AIR  # NaN where both legs stand without springs
    first, stance = landings[0] if landings else (np.inf, 0)
    return footholds, first, stance


COLUMNS = 2 + NEXT + 1
"""y, dy/dt and the footholds 0, 1 and 2 that they depend on."""


@compiled
def pulls(path: LateralPath, row: int, time: float, com: Array, out: Array) -> None:
    """Write c_i = f_i / (m l_i), times the ratio, of both legs into ``out`` (2,) [1/s^2].

    ``time`` is since the start of segment ``row`` [s]; ``com`` (6,) is overwritten with x, z and
    their first and second derivatives. 0 for a leg in the air; legs do not pull.
    """
    coefficients, meta = path.coefficients, path.meta
    sample(SERIES, Path(coefficients[0, row], coefficients[1, row]), time, com)
    total = max(com[5] + path.gravity, 0.0) / com[1]
    rear, front = path.footholds[row, 0] >= 0, path.footholds[row, 1] >= 0
    share = 1.0 if front else 0.0
    if rear and front:
        apart = meta[row, 4] - meta[row, 3]
        share = 0.5
        if apart != 0.0 and total > 0.0:
            share = (com[0] - com[4] / total - meta[row, 3]) / apart
            share = min(max(share, 0.0), 1.0)
    elif not rear and not front:
        total = 0.0
    total *= path.ratio
    out[0], out[1] = total * (1.0 - share), total * share


@compiled
def transition(path: LateralPath, start: float, end: float) -> Array:
    """(2, COLUMNS) matrix M of the motion between two times on the path.

    (y, dy/dt)(end) = M (y, dy/dt, y_0, y_1, y_2), y_i the footholds' [m], by the classical
    Runge-Kutta method; ``end`` is at most the path's section [s]. A shift of all of them shifts the
    end alike: M[:, 0] + M[:, 2:].sum(1) = (1, 0).
    """
    motion = np.zeros((2, COLUMNS))
    motion[0, 0] = motion[1, 1] = 1.0
    com, before, middle, after = np.empty(6), np.empty(2), np.empty(2), np.empty(2)
    meta, footholds = path.meta, path.footholds
    for row in range(meta.shape[0]):
        begin, until = max(meta[row, 0], start), min(meta[row, 0] + meta[row, 1], end)
        if until <= begin:
            continue
        steps = int(np.ceil((until - begin) / path.longest))
        h = (until - begin) / steps
        rear, front = footholds[row, 0], footholds[row, 1]
        dt = h * path.stretch if (rear >= 0) != (front >= 0) else h
        t = begin - meta[row, 0]
        pulls(path, row, t, com, before)
        for _ in range(steps):
            pulls(path, row, t + 0.5 * h, com, middle)
            pulls(path, row, t + h, com, after)
            a, b, c = before[0] + before[1], middle[0] + middle[1], after[0] + after[1]
            for j in range(motion.shape[1]):
                fa = fb = fc = 0.0
                if j >= 2:
                    if rear == j - 2:
                        fa, fb, fc = fa + before[0], fb + middle[0], fc + after[0]
                    if front == j - 2:
                        fa, fb, fc = fa + before[1], fb + middle[1], fc + after[1]
                y, v = motion[0, j], motion[1, j]
                k1 = a * y - fa
                v2 = v + 0.5 * dt * k1
                k2 = b * (y + 0.5 * dt * v) - fb
                v3 = v + 0.5 * dt * k2
                k3 = b * (y + 0.5 * dt * v2) - fb
                v4 = v + dt * k3
                k4 = c * (y + dt * v3) - fc
                motion[0, j] = y + dt / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
                motion[1, j] = v + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            before[0], before[1] = after[0], after[1]
            t += h
    return motion


@compiled
def _join(before: Array, after: Array, out: Array) -> None:
    """Write the rows of ``after`` (r, COLUMNS), as they are before a motion (2, COLUMNS)."""
    for r in range(after.shape[0]):
        for c in range(COLUMNS):
            out[r, c] = after[r, 0] * before[0, c] + after[r, 1] * before[1, c]
            if c >= 2:
                out[r, c] += after[r, c]


@compiled
def _ahead(path: LateralPath, nodes: Array) -> Array:
    """The motion from each node on, see :class:`LateralPath`, from the last to the first."""
    last = nodes.shape[0] - 1
    ahead = np.zeros((last + 1, 3, COLUMNS))
    ahead[last, 0, 0] = ahead[last, 1, 0] = ahead[last, 2, 1] = 1.0
    for k in range(last - 1, -1, -1):
        _join(transition(path, nodes[k], nodes[k + 1]), ahead[k + 1], ahead[k])
        if nodes[k] >= path.touchdown - _SAME:
            ahead[k, 0, :] = 0.0
            ahead[k, 0, 0] = 1.0
    return ahead


@compiled
def motion_ahead(path: LateralPath, time: float) -> Array:
    """(3, COLUMNS) motion from a time on the path [s]: rows as in its ``ahead``.

    It is one step of the integration to the next node, and the motion from there on.
    """
    k, out = 0, np.empty((3, COLUMNS))
    while k + 1 < path.nodes.shape[0] and path.nodes[k] <= time:
        k += 1
    _join(transition(path, time, path.nodes[k]), path.ahead[k], out)
    if time >= path.touchdown:
        out[0, :] = 0.0
        out[0, 0] = 1.0
    return out


@compiled
def acceleration(path: LateralPath, time: float, y: float, feet: Array) -> float:
    """d2y/dt2 = sum_i c_i (y - y_i) of the template at a time on the path [m/s^2].

    ``feet`` (3,) are y_i of the feet that were rear and front at the start of the path, and of the
    next foothold [m].
    """
    com, leg = np.empty(6), np.empty(2)
    meta, row = path.meta, 0
    while row + 1 < meta.shape[0] and meta[row + 1, 0] <= time:
        row += 1
    pulls(path, row, min(max(time - meta[row, 0], 0.0), meta[row, 1]), com, leg)
    total = 0.0
    for i in range(2):
        foothold = path.footholds[row, i]
        if 0 <= foothold < feet.shape[0]:
            total += leg[i] * (y - feet[foothold])
    return total
