"""Closed-form strides (Section III) that interpret the automaton's tables.

The same tables as the exact kernel's, but each phase is one closed-form path: flight (10),
single stance (11) and double stance (Algorithm 1), in two iterations.
"""

from __future__ import annotations

import numpy as np

from template_control.arrays import Array
from template_control.compiled import inner
from template_control.slip.automaton.vocabulary import MapKind, Outcome
from template_control.slip.dynamics.guards import (
    COEFFICIENTS,
    FLIGHT,
    STANCE,
    Path,
    Watch,
    all_bends,
    arm,
    first_event,
    root,
    sample,
)
from template_control.slip.dynamics.kernel import Scratch, apply_reset, enter, note
from template_control.slip.dynamics.model import Kernel, backward

_NEWTON = 6


@inner
def axial_torsional(
    spread: float, stiffness: float, mass: float, gravity: float, rest_length: float
) -> tuple[float, float, float]:
    """AT-SLIP that stands in for two legs: k_r [N/m], l_r0 [m], k_t [N m/rad], (18) to (25).

    (23) is read as in the notes. ``spread`` is c, the distance of the toes [m].
    """
    half = 0.25 * spread * spread
    weight = mass * gravity
    top = np.sqrt(rest_length**2 - half)
    # (18) is the squared balance 2 k0 (l0 - l) y / l = m g; its root next to l0 is wanted.
    leg = rest_length - 0.5 * weight / stiffness * rest_length / top
    for _ in range(_NEWTON):
        y = np.sqrt(leg * leg - half)
        balance = 2.0 * stiffness * (rest_length - leg) * y / leg - weight
        slope = 2.0 * stiffness * ((rest_length - leg) * half / (leg * leg * y) - y / leg)
        step = balance / slope
        leg -= step
        if abs(step) < 1e-13 * rest_length:
            break
    y = np.sqrt(leg * leg - half)
    k_r = weight / (top - y)
    k_t = stiffness * spread * spread * (4.0 * rest_length**2 - spread * spread)
    return k_r, top, k_t / (8.0 * rest_length**2)


@inner
def harmonic(
    a: Array,
    start: tuple[float, float, float, float],
    momentum: float,
    frequency_squared: float,
    length: float,
    gravity: float,
) -> None:
    """Coefficients of (11) into ``a`` (12,), see :class:`~.guards.Path`.

    A stance starts at x of a pivot, the CoM in polar coordinates about it, and dr/dt [m, rad, m/s].
    ``momentum`` is p / m [m^2/s], ``frequency_squared`` k / m, ``length`` l0, or l_r0 of the AT.
    """
    pivot, r, theta, radial_speed = start
    omega = momentum / (length * length)
    w2 = frequency_squared + 3.0 * omega * omega
    w = np.sqrt(w2)
    for i in range(8, COEFFICIENTS):
        a[i] = 0.0
    a[0] = pivot
    a[1] = (-gravity + length * frequency_squared + 4.0 * length * omega * omega) / w2
    a[2] = radial_speed / w
    a[3] = r - a[1]
    a[5] = w
    a[6] = (2.0 * gravity / length + frequency_squared + omega * omega) / w2 * omega
    a[7] = 2.0 * omega / (length * w)
    a[4] = theta - a[7] * a[2]


@inner
def momentum_changes(a: Array, t: float, gravity: tuple[float, float], torsion: float) -> float:
    """Change of p/m over [0, t] by gravity (12), (13) and the torsional spring (27).

    ``gravity`` acts into the ground, and along it backward [m/s^2]; ``torsion`` is k_t / m.
    """
    w, l1, l2 = a[5], a[2], a[3]
    s, c = np.sin(w * t), np.cos(w * t)
    start_angle = a[4] + a[7] * l1
    end_angle = a[4] + a[6] * t + a[7] * (l1 * c - l2 * s)
    mean_r = a[1] + (l1 - l1 * c + l2 * s) / (w * t)
    change = -0.5 * t * gravity[0] * mean_r * (np.cos(start_angle) + np.cos(end_angle))
    change += 0.5 * t * gravity[1] * mean_r * (np.sin(start_angle) + np.sin(end_angle))
    integral = 0.5 * a[6] * t * t + a[7] / w * (l1 * s - l2 * (1.0 - c)) + a[4] * t
    return change - torsion * (integral - 0.5 * np.pi * t)


@inner
def _spring(
    x: float, y: float, pivot: float, toes: Array, stiffness: Array, rest_length: float
) -> tuple[float, float]:
    """Of the loaded legs at (x, y): radial force times r, and torque about the pivot [N m]."""
    fx = fy = 0.0
    for leg in range(2):
        if stiffness[leg] == 0.0:
            continue
        d = x - toes[leg]
        length = np.sqrt(d * d + y * y)
        share = stiffness[leg] * (rest_length / length - 1.0)
        fx += share * d
        fy += share * y
    d = x - pivot
    return fx * d + fy * y, d * fy - y * fx


@inner
def corrected(
    a: Array,
    t: float,
    momentum: float,
    toes: Array,
    stiffness: Array,
    kernel: Kernel,
    out: Array,
) -> float:
    """Improve the path ``a`` in place by one deferred correction; p/m at ``t`` [m^2/s].

    The true radial acceleration and torque at the start, middle and end of the first path
    differ from what it assumes by a defect; a quadratic in time through the three is added
    to the right-hand side of the radial equation, which still has a closed-form solution.
    The angular rate p(t) / (m r(t)^2) is interpolated through the same three points.
    """
    mass, gravity, rest_length = kernel.mass, kernel.gravity, kernel.rest_length
    along = backward(kernel, stiffness)
    w2 = a[5] * a[5]
    # Radial defects and torques at 0, t/2 and t.
    pull_0 = pull_1 = pull_2 = torque_0 = torque_1 = torque_2 = 0.0
    angle = a[4] + a[7] * a[2]
    radius = a[1] + a[3]
    speed = a[5] * a[2]
    r1 = r2 = radius
    s, c = np.sin(angle), np.cos(angle)
    x, y = a[0] + radius * c, radius * s
    for i in range(3):
        if i > 0:
            sample(STANCE, Path(a, a), 0.5 * i * t, out)
            x, y = out[0], out[1]
        d = x - a[0]
        r = np.sqrt(d * d + y * y)
        force, torque = _spring(x, y, a[0], toes, stiffness, rest_length)
        pull = force / (r * mass) - (gravity * y + along * d) / r + w2 * (r - a[1])
        torque = torque / mass - gravity * d + along * y
        if i == 0:
            pull_0, torque_0 = pull, torque
        elif i == 1:
            pull_1, torque_1, r1 = pull, torque, r
        else:
            pull_2, torque_2, r2 = pull, torque, r
    p1 = momentum + t / 24.0 * (5.0 * torque_0 + 8.0 * torque_1 - torque_2)
    p2 = momentum + t / 6.0 * (torque_0 + 4.0 * torque_1 + torque_2)
    pull_0 += momentum * momentum / radius**3
    pull_1 += p1 * p1 / r1**3
    pull_2 += p2 * p2 / r2**3
    # pull = q0 + q1 t + q2 t^2 through the three points.
    q0 = pull_0
    q1 = (4.0 * pull_1 - 3.0 * pull_0 - pull_2) / t
    q2 = 2.0 * (pull_0 - 2.0 * pull_1 + pull_2) / (t * t)
    a[1] += q0 / w2 - 2.0 * q2 / (w2 * w2)
    a[8] = q1 / w2
    a[9] = q2 / w2
    a[2] = (speed - a[8]) / a[5]
    a[3] = radius - a[1]
    a[7] = 0.0
    # Angular rate through three points of the new radius.
    rates_0 = momentum / (radius * radius)
    s, c = np.sin(0.5 * a[5] * t), np.cos(0.5 * a[5] * t)
    r1 = a[1] + (a[8] + 0.5 * a[9] * t) * 0.5 * t + a[2] * s + a[3] * c
    s, c = 2.0 * s * c, c * c - s * s
    r2 = a[1] + (a[8] + a[9] * t) * t + a[2] * s + a[3] * c
    rates_1, rates_2 = p1 / (r1 * r1), p2 / (r2 * r2)
    a[4] = angle
    a[6] = rates_0
    a[10] = 0.5 * (4.0 * rates_1 - 3.0 * rates_0 - rates_2) / t
    a[11] = 2.0 / 3.0 * (rates_0 - 2.0 * rates_1 + rates_2) / (t * t)
    return p2


_MAX_PIECES = 24
_NO_EVENT, _GOES_ON = -1, -2
_PIECE = 2.7  # radians of the spring's oscillation that one improved path covers at most
_SAFE_SHARE = 0.7  # of a piece without an event: the corrected path may meet one before its end
_SUBSTEP = 0.32  # of sqrt(l0 / g)
_EVENT_TIME = 1e-11  # [s]
_NODE_TIME = 1e-10  # [s], of the first path's event where it only places the correction's nodes


@inner
def _follow(path: Path, edge: int, t: float, watch: Watch) -> float:
    """Time of the same event on a corrected path, from its time on the first; -1 if none."""
    event, guess = watch.events[edge], t
    t = root(STANCE, path, event, guess, (0.5 * guess, 1.5 * guess), _EVENT_TIME, watch)
    if t >= 0.0:
        return t
    watch.values[0, event], watch.armed[0] = 0.0, False
    alone = Watch(watch.events[edge : edge + 1], *watch[1:])
    fired, t = first_event(STANCE, path, 3.0 * guess, 0.1 * guess, _EVENT_TIME, alone)
    return t if fired >= 0 else -1.0


@inner
def _end_velocity(a: Array, momentum: float, t: float, state: Array, out: Array) -> None:
    """State at ``t``: position and radial speed of the path, angular rate p / (m r^2)."""
    sample(STANCE, Path(a, a), t, out)
    x, y = out[0] - a[0], out[1]
    r = np.sqrt(x * x + y * y)
    c, s = x / r, y / r
    radial, tangential = out[2] * c + out[3] * s, momentum / r
    state[0], state[1] = out[0], out[1]
    state[2], state[3] = radial * c - tangential * s, radial * s + tangential * c


@inner
def _potential(state: Array, toes: Array, stiffness: Array, kernel: Kernel) -> float:
    """Energy over mass of gravity, of what else acts along the ground, and of springs [J/kg]."""
    x, y = state[0], state[1]
    potential = kernel.gravity * y + backward(kernel, stiffness) * x
    for leg in range(2):
        if stiffness[leg] == 0.0:
            continue
        d = kernel.rest_length - np.sqrt((x - toes[leg]) ** 2 + y * y)
        potential += 0.5 * stiffness[leg] / kernel.mass * d * d
    return potential


@inner
def _stance(
    map_kind: int, kernel: Kernel, state: Array, stiffness: Array, a: Array, watch: Watch
) -> int:
    """Carry ``state`` to a stance phase's end; the edge, ``_NO_EVENT``, or ``_GOES_ON``."""
    mass, gravity, rest_length = kernel.mass, kernel.gravity, kernel.rest_length
    pull = (gravity, backward(kernel, stiffness))
    toes, out = watch.toes, watch.out
    torsion = 0.0
    if stiffness[0] == 0.0 or stiffness[1] == 0.0:
        leg = 0 if stiffness[1] == 0.0 else 1
        pivot, k, length = toes[leg], stiffness[leg], rest_length
    else:
        pivot = 0.5 * (toes[0] + toes[1])
        mean = 0.5 * (stiffness[0] + stiffness[1])
        if stiffness[0] != stiffness[1]:
            # The AT-SLIP stands for two equal legs; for others only the correction is right.
            map_kind = MapKind.IMPROVED
        k, length, torsion = axial_torsional(toes[1] - toes[0], mean, mass, gravity, rest_length)
    d, y = state[0] - pivot, state[1]
    r, theta = np.sqrt(d * d + y * y), np.arctan2(y, d)
    c, s = d / r, y / r
    radial = state[2] * c + state[3] * s
    momentum = r * (state[3] * c - state[2] * s)
    w2 = k / mass
    start = (pivot, r, theta, radial)
    harmonic(a, start, momentum, w2, length, gravity)
    path = Path(a, a)
    horizon, accuracy = kernel.max_time, _EVENT_TIME
    if map_kind == MapKind.IMPROVED:
        horizon, accuracy = _PIECE / a[5], _NODE_TIME
    substep = _SUBSTEP * np.sqrt(rest_length / gravity)
    edge, t = first_event(STANCE, path, horizon, substep, accuracy, watch)
    if map_kind != MapKind.IMPROVED and edge < 0:
        return _NO_EVENT
    if edge >= 0 and t == 0.0:
        return edge  # the phase ends as it begins: there is nothing to correct over no time
    if map_kind == MapKind.IMPROVED:
        if edge < 0:
            edge = _GOES_ON
            t = _SAFE_SHARE * horizon
        end = corrected(a, t, momentum, toes, stiffness, kernel, out)
    elif map_kind == MapKind.PAPER:
        end = momentum + momentum_changes(a, t, pull, torsion / mass)
        harmonic(a, start, end, w2, length, gravity)
    else:
        end = momentum
    if map_kind != MapKind.GEYER and edge >= 0:
        t = _follow(path, edge, t, watch)
        if t < 0.0:
            return _NO_EVENT
    before = 0.5 * (state[2] ** 2 + state[3] ** 2) + _potential(state, toes, stiffness, kernel)
    _end_velocity(a, end, t, state, out)
    if map_kind == MapKind.IMPROVED:
        # Energy is conserved within a phase, so the end speed is known.
        squared = 2.0 * (before - _potential(state, toes, stiffness, kernel))
        ratio = squared / (state[2] ** 2 + state[3] ** 2)
        if ratio > 0.0:
            scale = np.sqrt(ratio)
            state[2] *= scale
            state[3] *= scale
    return edge


@inner
def closed_form_stride(
    kernel: Kernel,
    map_kind: int,
    state: Array,
    toes: Array,
    controls: Array,
    scratch: Scratch,
) -> int:
    """As :func:`~.kernel.run_stride`, with one closed-form map a phase; the Outcome's value."""
    tables, node = kernel.tables, kernel.node
    alpha = controls[0]
    rest_length = kernel.rest_length
    touchdown_height = rest_length * np.sin(alpha)
    a, out, stiffness, bends = scratch.path, scratch.out, scratch.stiffness, scratch.bends
    event = -1
    for _ in range(_MAX_PIECES):
        watch = enter(kernel, node, toes, controls, touchdown_height, scratch)
        arm(watch, state, event)
        if stiffness[0] == 0.0 and stiffness[1] == 0.0:
            for i in range(4):
                a[i] = state[i]
            a[4], a[5] = kernel.gravity, kernel.along
            pull = kernel.gravity + abs(kernel.along)
            speed = abs(state[2]) + abs(state[3]) + pull * kernel.max_time
            all_bends(state, toes, rest_length, (speed, pull, 0.0), kernel.max_time, bends)
            path = Path(a, a)
            substep = _SUBSTEP * np.sqrt(rest_length / kernel.gravity)
            edge, t = first_event(FLIGHT, path, kernel.max_time, substep, _EVENT_TIME, watch)
            sample(FLIGHT, path, t, out)
            for i in range(4):
                state[i] = out[i]
        else:
            bends[:] = 0.0  # such a path's guards are looked at where substeps end
            edge = _stance(map_kind, kernel, state, stiffness, a, watch)
        if edge == _NO_EVENT or not np.isfinite(state[0] + state[2]):
            return Outcome.TIMEOUT
        if edge == _GOES_ON:
            event = -1
            continue
        edge += tables.first_edge[node]
        event = tables.event[edge]
        note(event, np.nan, state, toes, scratch)
        apply_reset(tables.reset[edge], state, toes, rest_length, alpha)
        if tables.outcome[edge] >= 0:
            return tables.outcome[edge]
        node = tables.target[edge]
    return Outcome.TIMEOUT
