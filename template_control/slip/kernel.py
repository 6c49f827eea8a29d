"""Compiled interpreter of the automaton's tables: one stride, event-exact.

Every gait runs through :func:`run_stride`; it knows guards as functions and resets as
assignments, and reads which of them belong where from :class:`~.tables.Tables`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from template_control.slip.tables import Tables
from template_control.slip.taylor import ORDER, evaluate, expand
from template_control.slip.vocabulary import Event, Outcome, Reset

Array = NDArray[np.float64]

# Numba freezes module-level integers into the compiled code.
_TOUCHDOWN = int(Event.TOUCHDOWN)
_REAR_LIFTOFF = int(Event.REAR_LIFTOFF)
_FRONT_LIFTOFF = int(Event.FRONT_LIFTOFF)
_APEX = int(Event.APEX)
_BOTTOM = int(Event.BOTTOM)
_VIRTUAL_BOTTOM = int(Event.VIRTUAL_BOTTOM)
_VLO = int(Event.VLO)
_PASSED_FRONT_FOOT = int(Event.PASSED_FRONT_FOOT)
_FALL = int(Event.FALL)
_BACKWARD = int(Event.BACKWARD)
_PLACE_REAR = int(Reset.PLACE_REAR)
_PLACE_FRONT = int(Reset.PLACE_FRONT)
_SHIFT = int(Reset.SHIFT)
_TIMEOUT = int(Outcome.TIMEOUT)

MAX_SEGMENTS = 96
MAX_EVENTS = 16
_MAX_EDGES = 8
_SUBSTEPS = 4
_ARMING = 1e-10  # a guard must have been this far below zero before it can fire
_EVENT_TIME = 1e-14  # [s], bracket at which a root counts as found


class Model(NamedTuple):
    """The template's physics as the kernel takes it, SI units."""

    mass: float
    gravity: float
    rest_length: float
    max_time: float


class Scratch(NamedTuple):
    """Arrays a stride is written to; one set a thread, reused from call to call.

    Attributes:
        cx, cy: (MAX_SEGMENTS, ORDER + 1) polynomials of the path, one row a segment.
        meta: (MAX_SEGMENTS, 7) start time, duration, node, toes, stiffnesses of a segment.
        events: (MAX_EVENTS, 8) time, event, node left, node entered, state before the reset.
        work: (2, 4, ORDER + 1) for the series.
    """

    cx: Array
    cy: Array
    meta: Array
    events: Array
    work: Array


def new_scratch() -> Scratch:
    """Fresh arrays for one thread."""
    return Scratch(
        np.zeros((MAX_SEGMENTS, ORDER + 1)),
        np.zeros((MAX_SEGMENTS, ORDER + 1)),
        np.zeros((MAX_SEGMENTS, 7)),
        np.zeros((MAX_EVENTS, 8)),
        np.zeros((2, 4, ORDER + 1)),
    )


@njit(cache=True)
def guard(event: int, state: Array, toes: Array, rest_length: float, alpha: float) -> float:
    """Value of a guard of :class:`~.automaton.Event`; it fires when it rises through 0.

    Args:
        event: value of the Event.
        state: (4,) x, y, dx/dt, dy/dt [m, m/s].
        toes: (2,) x of rear and front toe [m].
        rest_length: l0 [m].
        alpha: touchdown angle [rad].
    """
    x, y, u, v = state[0], state[1], state[2], state[3]
    if event == _TOUCHDOWN:
        return rest_length * np.sin(alpha) - y
    if event == _REAR_LIFTOFF:
        return np.sqrt((x - toes[0]) ** 2 + y * y) - rest_length
    if event == _FRONT_LIFTOFF:
        return np.sqrt((x - toes[1]) ** 2 + y * y) - rest_length
    if event == _APEX:
        return -v
    if event == _BOTTOM:
        return (x - toes[0]) * u + y * v
    if event == _VIRTUAL_BOTTOM:
        return (x - 0.5 * (toes[0] + toes[1])) * u + y * v
    if event == _VLO:
        return x - toes[0]
    if event == _PASSED_FRONT_FOOT:
        return x - toes[1]
    if event == _FALL:
        return -y
    return -u


@njit(cache=True)
def _root(
    event: int,
    cx: Array,
    cy: Array,
    lo: float,
    g_lo: float,
    hi: float,
    g_hi: float,
    toes: Array,
    rest_length: float,
    alpha: float,
    state: Array,
) -> float:
    """Time in (lo, hi] at which the guard rises through 0 (Illinois' false position)."""
    side = 0
    for _ in range(60):
        if hi - lo <= _EVENT_TIME:
            break
        t = hi - g_hi * (hi - lo) / (g_hi - g_lo)
        evaluate(cx, cy, t, state)
        g = guard(event, state, toes, rest_length, alpha)
        if g >= 0.0:
            # Close to the root on both sides: the next bracket is as good as this point.
            if hi - t <= _EVENT_TIME or g == 0.0:
                hi = t
                break
            hi, g_hi = t, g
            if side == 1:
                g_lo *= 0.5
            side = 1
        else:
            if t - lo <= _EVENT_TIME:
                break
            lo, g_lo = t, g
            if side == -1:
                g_hi *= 0.5
            side = -1
    return hi


@njit(cache=True)
def run_stride(
    tables: Tables,
    model: Model,
    node: int,
    state: Array,
    toes: Array,
    controls: Array,
    record: bool,
    scratch: Scratch,
) -> tuple[int, int, int, int, float]:
    """Run the automaton from ``node`` until a section or a failure.

    Args:
        tables: the packed automaton.
        model: the template; a stride longer than its ``max_time`` counts as failed.
        node: index of the first node.
        state: (4,) x, y, dx/dt, dy/dt [m, m/s], overwritten with the final state.
        toes: (2,) x of rear and front toe [m], overwritten.
        controls: (NUM_SLOTS,) u: touchdown angle [rad] and stiffnesses [N/m] by Slot.
        record: keep every segment and event; otherwise only the last is kept.
        scratch: overwritten.

    Returns:
        Outcome, last node (the one entered, where the section was reached), number of
        segments, number of events, duration [s].
    """
    mass, gravity, rest_length = model.mass, model.gravity, model.rest_length
    max_time = model.max_time
    cx, cy, meta, events, work = scratch
    alpha = controls[0]
    stiffness = np.empty(2)
    probe = np.empty(4)
    previous = np.empty(_MAX_EDGES)
    armed = np.empty(_MAX_EDGES, dtype=np.bool_)
    time, segments, event_count = 0.0, 0, 0
    entered = True
    while time < max_time and segments < MAX_SEGMENTS and event_count < MAX_EVENTS:
        first, last = tables.first_edge[node], tables.first_edge[node + 1]
        rear, front = tables.rear[node], tables.front[node]
        stiffness[0] = controls[rear] if rear >= 0 else 0.0
        stiffness[1] = controls[front] if front >= 0 else 0.0
        if entered:
            for e in range(first, last):
                event = tables.event[e]
                g = guard(event, state, toes, rest_length, alpha)
                previous[e - first] = g
                # Forbidden regions count from the start; an event at zero does not fire there.
                armed[e - first] = g < -_ARMING or event in (_FALL, _BACKWARD)
            entered = False
        row = segments if record else 0
        px, py = cx[row], cy[row]
        step = expand(state, toes, stiffness, mass, gravity, rest_length, px, py, work)
        step = min(step, max_time - time, 0.1 * np.sqrt(rest_length / gravity) * _SUBSTEPS)

        fired, fired_at, t_lo = -1, np.inf, 0.0
        for sub in range(1, _SUBSTEPS + 1):
            t_hi = step * sub / _SUBSTEPS
            evaluate(px, py, t_hi, probe)
            x, y, u, v = probe[0], probe[1], probe[2], probe[3]
            for e in range(first, last):
                event = tables.event[e]
                probe[0], probe[1], probe[2], probe[3] = x, y, u, v
                g = guard(event, probe, toes, rest_length, alpha)
                i = e - first
                if armed[i] and g >= 0.0:
                    t = t_lo
                    if previous[i] < 0.0:
                        t = _root(
                            event,
                            px,
                            py,
                            t_lo,
                            previous[i],
                            t_hi,
                            g,
                            toes,
                            rest_length,
                            alpha,
                            probe,
                        )
                    if t < fired_at:
                        fired, fired_at = e, t
                elif g < -_ARMING:
                    armed[i] = True
                previous[i] = g
            if fired >= 0:
                break
            t_lo = t_hi
        if fired >= 0:
            step = fired_at
        evaluate(px, py, step, state)
        meta[row, 0], meta[row, 1], meta[row, 2] = time, step, node
        meta[row, 3], meta[row, 4] = toes[0], toes[1]
        meta[row, 5], meta[row, 6] = stiffness[0], stiffness[1]
        segments += 1
        time += step
        if fired < 0:
            continue

        outcome, target = tables.outcome[fired], tables.target[fired]
        row = event_count if record else 0
        events[row, 0], events[row, 1] = time, tables.event[fired]
        events[row, 2], events[row, 3] = node, target
        events[row, 4:8] = state
        event_count += 1
        reset = tables.reset[fired]
        if reset == _PLACE_REAR:
            toes[0] = state[0] + rest_length * np.cos(alpha)
        elif reset == _PLACE_FRONT:
            toes[1] = state[0] + rest_length * np.cos(alpha)
        elif reset == _SHIFT:
            toes[0] = toes[1]
        if outcome >= 0:
            return outcome, (target if target >= 0 else node), segments, event_count, time
        node = target
        entered = True
    return _TIMEOUT, node, segments, event_count, time


@njit(cache=True)
def vlo_map(
    tables: Tables,
    model: Model,
    node: int,
    z: Array,
    controls: Array,
    scratch: Scratch,
    z_next: Array,
) -> int:
    """VLO return map (7), (9) for one state; returns the Outcome's value.

    Args:
        z: (3,) dx/dt, y, dy/dt at VLO [m/s, m, m/s].
        z_next: (3,) overwritten with the next VLO state.
        The rest as in :func:`run_stride`.
    """
    state = np.empty(4)
    toes = np.zeros(2)
    state[0], state[1], state[2], state[3] = 0.0, z[1], z[0], z[2]
    outcome = run_stride(tables, model, node, state, toes, controls, False, scratch)[0]
    z_next[0], z_next[1], z_next[2] = state[2], state[1], state[3]
    return outcome
