"""Closed-form strides (Section III) that interpret the automaton's tables.

The same tables as the exact kernel's, but each phase is one closed-form path: flight (10),
single stance (11) and double stance (Algorithm 1), in two iterations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import inner
from template_control.slip.automaton.vocabulary import MapKind, Outcome
from template_control.slip.dynamics.guards import all_bends
from template_control.slip.dynamics.kernel import Scratch, apply_reset, note_bottom
from template_control.slip.dynamics.locate import Watch, arm, first_event, root
from template_control.slip.dynamics.model import Kernel, Model, backward, model_of
from template_control.slip.dynamics.path import FLIGHT, STANCE, Path, sample
from template_control.slip.dynamics.stance_map import (
    Launch,
    axial_torsional,
    corrected,
    harmonic,
    momentum_changes,
    polar,
)

Array = NDArray[np.float64]

_GEYER = int(MapKind.GEYER)
_PAPER = int(MapKind.PAPER)
_IMPROVED = int(MapKind.IMPROVED)
_TIMEOUT = int(Outcome.TIMEOUT)
_FALL = int(Outcome.FALL)
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
    event, guess = watch.events[edge], t.real
    t = root(STANCE, path, event, guess, (0.5 * guess, 1.5 * guess), _EVENT_TIME, watch)
    if t.real >= 0.0:
        return t
    watch.values[0, event], watch.armed[0] = 0.0, False
    alone = Watch(watch.events[edge : edge + 1], *watch[1:])
    fired, t = first_event(STANCE, path, 3.0 * guess, 0.1 * guess, _EVENT_TIME, alone)
    return t if fired >= 0 else 0.0 * t - 1.0


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
def _potential(state: Array, toes: Array, stiffness: Array, model: Model) -> float:
    """Energy over mass of gravity, of what else acts along the ground, and of springs [J/kg]."""
    x, y = state[0], state[1]
    potential = model.gravity * y + backward(model, stiffness) * x
    for leg in range(2):
        if stiffness[leg] == 0.0:
            continue
        d = model.rest_length - np.sqrt((x - toes[leg]) ** 2 + y * y)
        potential += 0.5 * stiffness[leg] / model.mass * d * d
    return potential


@inner
def _stance(
    map_kind: int, model: Model, state: Array, stiffness: Array, a: Array, watch: Watch
) -> int:
    """Carry ``state`` to the end of a stance phase; the edge that fires.

    ``_NO_EVENT`` if none does, ``_GOES_ON`` where the phase is too long for one path.
    """
    mass, gravity, rest_length = model.mass, model.gravity, model.rest_length
    pull = (gravity, backward(model, stiffness))
    toes, out = watch.toes, watch.out
    torsion = 0.0 * state[0]
    if stiffness[0] == 0.0 or stiffness[1] == 0.0:
        leg = 0 if stiffness[1] == 0.0 else 1
        pivot, k, length = toes[leg], stiffness[leg], rest_length + 0.0 * state[0]
    else:
        pivot = 0.5 * (toes[0] + toes[1])
        mean = 0.5 * (stiffness[0] + stiffness[1])
        if stiffness[0].real != stiffness[1].real:
            # The AT-SLIP stands for two equal legs; for others only the correction is right.
            map_kind = _IMPROVED
        k, length, torsion = axial_torsional(toes[1] - toes[0], mean, mass, gravity, rest_length)
    r, theta = polar(state[0] - pivot, state[1])
    c, s = (state[0] - pivot) / r, state[1] / r
    radial = state[2] * c + state[3] * s
    momentum = r * (state[3] * c - state[2] * s)
    w2 = k / mass
    start = Launch(pivot, r, theta, radial)
    harmonic(a, start, momentum, w2, length, gravity)
    path = Path(a, a)
    horizon, accuracy = model.max_time + 0.0 * r, _EVENT_TIME
    if map_kind == _IMPROVED:
        horizon, accuracy = _PIECE / a[5], _NODE_TIME
    substep = _SUBSTEP * np.sqrt(rest_length / gravity)
    edge, t = first_event(STANCE, path, horizon.real, substep, accuracy, watch)
    if map_kind != _IMPROVED and edge < 0:
        return _NO_EVENT
    if edge >= 0 and t == 0.0:
        return edge  # the phase ends as it begins: there is nothing to correct over no time
    if map_kind == _IMPROVED:
        if edge < 0:
            edge = _GOES_ON
            t = _SAFE_SHARE * horizon
        end = corrected(a, t, momentum, toes, stiffness, model, out)
    elif map_kind == _PAPER:
        end = momentum + momentum_changes(a, t, pull, torsion / mass)
        harmonic(a, start, end, w2, length, gravity)
    else:
        end = momentum
    if map_kind != _GEYER and edge >= 0:
        t = _follow(path, edge, t, watch)
        if t.real < 0.0:
            return _NO_EVENT
    before = 0.5 * (state[2] ** 2 + state[3] ** 2) + _potential(state, toes, stiffness, model)
    _end_velocity(a, end, t, state, out)
    if map_kind == _IMPROVED:
        # Energy is conserved within a phase, so the end speed is known.
        squared = 2.0 * (before - _potential(state, toes, stiffness, model))
        ratio = squared / (state[2] ** 2 + state[3] ** 2)
        if ratio.real > 0.0:
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
    """As :func:`~.kernel.run_stride`, with one closed-form map a phase.

    Args:
        map_kind: value of a MapKind other than EXACT.
        The rest as in :func:`~.kernel.run_stride`; ``state`` and ``toes`` are overwritten.

    Returns:
        The Outcome's value.
    """
    tables, model, node = kernel.tables, model_of(kernel), kernel.node
    alpha = controls[0]
    rest_length = model.rest_length
    touchdown_height = rest_length * np.sin(alpha)
    a, out, probe, stiffness = scratch.path, scratch.out, scratch.probe, scratch.stiffness
    values, armed, bends = scratch.values, scratch.armed, scratch.bends
    event = -1
    for _ in range(_MAX_PIECES):
        rear, front = tables.rear[node], tables.front[node]
        stiffness[0] = controls[rear] if rear >= 0 else 0.0
        stiffness[1] = controls[front] if front >= 0 else 0.0
        first_edge = tables.first_edge[node]
        guards = tables.event[first_edge : tables.first_edge[node + 1]]
        watch = Watch(
            guards, toes, rest_length, touchdown_height, values, armed, bends, out=out, probe=probe
        )
        arm(watch, state, event)
        if stiffness[0] == 0.0 and stiffness[1] == 0.0:
            for i in range(4):
                a[i] = state[i]
            a[4], a[5] = model.gravity, model.along
            pull = model.gravity + abs(model.along)
            speed = abs(state[2].real) + abs(state[3].real) + pull * model.max_time
            all_bends(state, toes, rest_length, (speed, pull, 0.0), model.max_time, bends)
            path = Path(a, a)
            substep = _SUBSTEP * np.sqrt(rest_length / model.gravity)
            edge, t = first_event(FLIGHT, path, model.max_time, substep, _EVENT_TIME, watch)
            sample(FLIGHT, path, t, out)
            for i in range(4):
                state[i] = out[i]
        else:
            bends[:] = 0.0  # such a path's guards are looked at where substeps end
            edge = _stance(map_kind, model, state, stiffness, a, watch)
        if edge == _NO_EVENT or not np.isfinite(state[0].real + state[2].real):
            return _TIMEOUT
        if edge == _GOES_ON:
            event = -1
            continue
        edge += first_edge
        event = tables.event[edge]
        note_bottom(event, state, toes, scratch.bottom)
        apply_reset(tables.reset[edge], state, toes, rest_length, alpha)
        if tables.outcome[edge] >= 0:
            return tables.outcome[edge]
        node = tables.target[edge]
    return _TIMEOUT
