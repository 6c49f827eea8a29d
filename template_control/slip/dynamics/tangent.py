"""Tangents of a stride: its exact derivatives, carried along the Taylor series of its path.

Within a phase the variational equation

    d2(dp)/dt2 = G(t) (dp - dtoe) + F(t) dkappa / m

has a solution by the path's own recurrences: G = kappa/m ((l0/r - 1) 1 - l0 d d'/r^3) and
F = (l0/r - 1) d are series of a leg's vector d = p - toe. At an event the guard's differential
gives the time's, dt = -dg / (dg/dt), and the state moves along its path by dt: together the
saltation matrix. Resets move toes, and with them their tangents.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import constant, inner
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Reset, Slot
from template_control.slip.dynamics.guards import SERIES, Path, guard_gradient, sample
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.dynamics.model import ORDER, Kernel

_ALPHA = 3 + int(Slot.TOUCHDOWN_ANGLE)

COLUMNS = 3 + NUM_SLOTS
"""What a stride is differentiated by: dx/dt, y, dy/dt at its start, then the controls by Slot."""

_INPUTS = 8  # of a phase: x, y, dx/dt, dy/dt, rear and front toe, rear and front stiffness
_REAR, _FRONT, _LANDED = map(constant, range(3))  # legs, and a row
_TOE, _KAPPA = 4, 6


class Tangents(NamedTuple):
    """Arrays that tangents are written to; one set a thread, reused: see :func:`new_tangents`."""

    state: Array
    toes: Array
    lengths: Array
    times: Array
    flow: Array
    leg: Array
    force: Array
    pull: Array
    series: Array
    guard: Array
    carried: Array


def new_tangents() -> Tangents:
    """Fresh arrays for one thread."""
    return Tangents(
        state=np.zeros((4, COLUMNS)),  # derivatives of x, y, dx/dt, dy/dt
        toes=np.zeros((2, COLUMNS)),  # of the x of rear and front toe
        # Of rear and front leg at the (virtual) bottom, and of the rear leg at touchdown.
        lengths=np.zeros((3, COLUMNS)),
        times=np.zeros((3, COLUMNS)),  # of the touchdown, the rear leg's liftoff, the last event
        flow=np.zeros((4, _INPUTS)),  # of a phase's final state by what it begins with
        # Series of a leg: r^2, r^-3, 1/r, d_x/r^3, d_x^2/r^3, d_x d_y/r^3.
        leg=np.zeros((6, ORDER - 1)),
        force=np.zeros((2, 3, ORDER - 1)),  # of G of each leg: xx, xy, yy
        pull=np.zeros((2, 2, ORDER - 1)),  # of F / m of each leg: x, y
        series=np.zeros((2, ORDER + 1, _INPUTS)),  # of dx and dy by input
        guard=np.zeros(7),  # gradient of a guard
        carried=np.zeros(4),  # a column of `state` in the making
    )


@inner
def _products(a: Array, b: Array, c: Array, d: Array, n: int) -> tuple[float, float]:
    """Coefficients ``n`` of the products a b and c d of series, two independent sums."""
    first = second = 0.0
    for j in range(n + 1):
        first += a[j] * b[n - j]
        second += c[j] * d[n - j]
    return first, second


@inner
def _leg_series(
    leg: int,
    toe: float,
    stiffness: float,
    body: tuple[float, float],
    degree: int,
    path: Path,
    tangents: Tangents,
) -> None:
    """Write a leg's G and F / m as series along a path, up to a degree."""
    squared, cube, inverse, tilt, xx, xy = tangents.leg
    force, pull = tangents.force[leg], tangents.pull[leg]
    (mass, rest_length), share, (cx, cy) = body, stiffness / body[0], path
    start = cx[0]
    cx[0] = start - toe  # the series of d_x, until the end of this function
    for n in range(degree - 1):
        x, y = _products(cx, cx, cy, cy, n)
        squared[n] = x + y
        if n == 0:
            cube[0] = squared[0] ** -1.5
        else:
            total = 0.0
            for j in range(n):
                total += (-1.5 * (n - j) - j) * squared[n - j] * cube[j]
            cube[n] = total / (n * squared[0])
        inverse[n], tilt[n] = _products(cube, squared, cube, cx, n)
        xx[n], xy[n] = _products(tilt, cx, tilt, cy, n)
        stretch = rest_length * inverse[n] - (1.0 if n == 0 else 0.0)
        force[0, n] = share * (stretch - rest_length * xx[n])
        force[1, n] = -share * rest_length * xy[n]
        force[2, n] = share * (stretch - rest_length * (inverse[n] - xx[n]))
    for n in range(degree - 1):
        x, y = _products(inverse, cx, inverse, cy, n)
        pull[0, n] = (rest_length * x - cx[n]) / mass
        pull[1, n] = (rest_length * y - cy[n]) / mass
    cx[0] = start


@inner
def _flight(step: float, flow: Array) -> None:
    """Write the derivatives of a flight's end by its beginning."""
    flow[:] = 0.0
    for i in range(4):
        flow[i, i] = 1.0
    flow[0, 2] = flow[1, 3] = step


@inner
def _stance(rear: bool, front: bool, step: float, degree: int, tangents: Tangents) -> None:
    """Write the derivatives of a phase's end, after ``step`` [s], by its beginning.

    ``rear`` and ``front`` say which legs are on the ground; :func:`_leg_series` comes before.
    """
    force, pull, flow = tangents.force, tangents.pull, tangents.flow
    dx, dy = tangents.series
    dx[:] = 0.0
    dy[:] = 0.0
    dx[0, 0] = dy[0, 1] = dx[1, 2] = dy[1, 3] = 1.0
    for n in range(degree - 1):
        scale = 1.0 / ((n + 1) * (n + 2))
        for j in range(n + 1):
            xx = xy = yy = 0.0
            if rear:
                xx, xy, yy = force[0, 0, j], force[0, 1, j], force[0, 2, j]
            if front:
                xx, xy, yy = xx + force[1, 0, j], xy + force[1, 1, j], yy + force[1, 2, j]
            xx, xy, yy = scale * xx, scale * xy, scale * yy
            for c in range(_INPUTS):
                dx[n + 2, c] += xx * dx[n - j, c] + xy * dy[n - j, c]
                dy[n + 2, c] += xy * dx[n - j, c] + yy * dy[n - j, c]
        if rear:
            dx[n + 2, _KAPPA] += scale * pull[0, 0, n]
            dy[n + 2, _KAPPA] += scale * pull[0, 1, n]
        if front:
            dx[n + 2, _TOE + 1] -= scale * force[1, 0, n]
            dy[n + 2, _TOE + 1] -= scale * force[1, 1, n]
            dx[n + 2, _KAPPA + 1] += scale * pull[1, 0, n]
            dy[n + 2, _KAPPA + 1] += scale * pull[1, 1, n]
    flow[:] = 0.0
    for n in range(degree, -1, -1):
        for c in range(_INPUTS):
            flow[2, c] = flow[2, c] * step + flow[0, c]
            flow[3, c] = flow[3, c] * step + flow[1, c]
            flow[0, c] = flow[0, c] * step + dx[n, c]
            flow[1, c] = flow[1, c] * step + dy[n, c]
    # The ground looks the same everywhere: CoM and toes moved alike move the path alike.
    for i in range(4):
        moved = (1.0 if i == 0 else 0.0) - flow[i, 0]
        if rear:
            flow[i, _TOE] = moved - flow[i, _TOE + 1]
        else:
            flow[i, _TOE + 1] = moved


@inner
def _carry(rear: int, front: int, tangents: Tangents) -> None:
    """Apply a phase's flow to the tangents; ``rear`` and ``front`` are the legs' slots or -1."""
    state, toes, flow, carried = tangents.state, tangents.toes, tangents.flow, tangents.carried
    for c in range(COLUMNS):
        for i in range(4):
            total = flow[i, _TOE] * toes[0, c] + flow[i, _TOE + 1] * toes[1, c]
            for j in range(4):
                total += flow[i, j] * state[j, c]
            if c == 3 + rear:
                total += flow[i, _KAPPA]
            if c == 3 + front:
                total += flow[i, _KAPPA + 1]
            carried[i] = total
        for i in range(4):
            state[i, c] = carried[i]


@inner
def _lengthen(row: int, leg: int, at: Array, toes: Array, tangents: Tangents) -> None:
    """Write the derivatives of a leg's length into a row of ``tangents.lengths``."""
    d, y = at[0] - toes[leg], at[1]
    length = np.sqrt(d * d + y * y)
    for c in range(COLUMNS):
        along = d * (tangents.state[0, c] - tangents.toes[leg, c]) + y * tangents.state[1, c]
        tangents.lengths[row, c] = along / length


@inner
def _fire(
    event: int, at: Array, alpha: float, toes: Array, rest_length: float, tangents: Tangents
) -> None:
    """Move the tangents' state from the event's time to where the guard is zero.

    ``at`` (6,) are x, y and their first and second derivatives at the event.
    """
    g, state, moved = tangents.guard, tangents.state, tangents.toes
    guard_gradient(event, at, toes, g)
    rate = g[0] * at[2] + g[1] * at[3] + g[2] * at[4] + g[3] * at[5]
    for c in range(COLUMNS):
        change = g[4] * moved[0, c] + g[5] * moved[1, c]
        for i in range(4):
            change += g[i] * state[i, c]
        if c == _ALPHA:
            change += g[6] * rest_length * np.cos(alpha)
        time = -change / rate
        tangents.times[2, c] += time
        for i in range(4):
            state[i, c] += at[2 + i] * time
    if event in (Event.BOTTOM, Event.VIRTUAL_BOTTOM):
        _lengthen(_REAR, _REAR, at, toes, tangents)
        _lengthen(_FRONT, _FRONT, at, toes, tangents)
    elif event == Event.TOUCHDOWN:
        _lengthen(_LANDED, _REAR, at, toes, tangents)
    note = 0 if event == Event.TOUCHDOWN else 1
    if event in (Event.TOUCHDOWN, Event.REAR_LIFTOFF):
        for c in range(COLUMNS):
            tangents.times[note, c] = tangents.times[2, c]


@inner
def _reset(reset: int, alpha: float, rest_length: float, tangents: Tangents) -> None:
    """Move the toes' tangents as :func:`~.kernel.apply_reset` moves the toes."""
    state, toes = tangents.state, tangents.toes
    for c in range(COLUMNS):
        placed = state[0, c] - (rest_length * np.sin(alpha) if c == _ALPHA else 0.0)
        if reset == Reset.PLACE_REAR:
            toes[0, c] = placed
        elif reset == Reset.PLACE_FRONT:
            toes[1, c] = placed
        elif reset in (Reset.SHIFT, Reset.SWAP):
            rear = toes[0, c]
            toes[0, c] = toes[1, c]
            if reset == Reset.SWAP:
                toes[1, c] = rear


@inner
def stride_tangents(kernel: Kernel, controls: Array, scratch: Scratch, tangents: Tangents) -> None:
    """Derivatives of a stride that :func:`~.kernel.run_stride` has recorded in ``scratch``.

    ``state``, ``toes``, ``lengths`` and ``times`` of ``tangents`` are overwritten with the
    derivatives at the stride's end by dx/dt, y, dy/dt at its start, where x is 0, and by the
    controls, along series of the kernel's degree.
    """
    tables, alpha, rest_length = kernel.tables, controls[0], kernel.rest_length
    degree = kernel.degree
    body = kernel.mass, rest_length
    tangents.state[:] = 0.0
    tangents.toes[:] = 0.0
    tangents.lengths[:] = np.nan
    tangents.times[:] = np.nan
    tangents.times[2] = 0.0
    tangents.state[2, 0] = tangents.state[1, 1] = tangents.state[3, 2] = 1.0
    segments, events, fired = scratch.recorded[0], scratch.recorded[1], 0
    for i in range(segments):
        path = Path(scratch.cx[i, : degree + 1], scratch.cy[i, : degree + 1])
        meta = scratch.meta[i]
        step, node = meta[1], int(meta[2])
        rear, front = tables.rear[node], tables.front[node]
        if rear >= 0:
            _leg_series(_REAR, meta[3], meta[5], body, degree, path, tangents)
        if front >= 0:
            _leg_series(_FRONT, meta[4], meta[6], body, degree, path, tangents)
        if rear >= 0 or front >= 0:
            _stance(rear >= 0, front >= 0, step, degree, tangents)
        else:
            _flight(step, tangents.flow)
        _carry(rear, front, tangents)
        at = scratch.events[fired]
        if fired == events or at[0] != meta[0] + step or at[2] != node:
            continue  # the series ends here, and the phase goes on
        event = int(at[1])
        sample(SERIES, path, step, scratch.out)
        _fire(event, scratch.out, alpha, meta[3:5], rest_length, tangents)
        for edge in range(tables.first_edge[node], tables.first_edge[node + 1]):
            if tables.event[edge] == event:
                _reset(tables.reset[edge], alpha, rest_length, tangents)
        fired += 1
