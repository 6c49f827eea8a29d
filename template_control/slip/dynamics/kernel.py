"""Compiled interpreter of the automaton's tables: one stride, event-exact.

Every gait runs through :func:`run_stride`; it knows guards as functions and resets as
assignments, and reads which of them belong where from ``Tables``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array, BoolArray, IntArray
from template_control.compiled import constant, inner
from template_control.slip.automaton.hybrid import Tables
from template_control.slip.automaton.vocabulary import MAX_EDGES, NUM_EVENTS, Event, Outcome, Reset
from template_control.slip.dynamics.guards import (
    COEFFICIENTS,
    SERIES,
    Path,
    Watch,
    all_bends,
    arm,
    first_event,
    sample,
)
from template_control.slip.dynamics.model import ORDER, Kernel, backward, expand, steepest

MAX_SEGMENTS = 96
MAX_EVENTS = 16
_SUBSTEPS = 4
_EVENT_TIME = 1e-14  # [s]
_EVERY = constant(True)


class Scratch(NamedTuple):
    """Arrays a stride is written to; one set a thread, reused: see :func:`new_scratch`."""

    cx: Array
    cy: Array
    meta: Array
    events: Array
    recorded: IntArray
    work: Array
    path: Array
    out: Array
    probe: Array
    state: Array
    toes: Array
    lengths: Array
    times: Array
    stiffness: Array
    values: Array
    bends: Array
    armed: BoolArray


def new_scratch(*strides: int) -> Scratch:
    """Fresh arrays for one thread; with a number, so many strides are kept (:func:`scratch_of`)."""
    return Scratch(
        # Polynomials of the path's x, a row a segment.
        cx=np.zeros((*strides, MAX_SEGMENTS, ORDER + 1)),
        cy=np.zeros((*strides, MAX_SEGMENTS, ORDER + 1)),
        meta=np.zeros((*strides, MAX_SEGMENTS, 7)),  # start time, duration, node, toes, stiffnesses
        # Time, event, nodes left and entered, state before the reset.
        events=np.zeros((*strides, MAX_EVENTS, 8)),
        recorded=np.zeros((*strides, 2), np.int64),  # segments and events
        work=np.zeros((2, 4, ORDER + 1)),  # of the series
        path=np.zeros(COEFFICIENTS),  # of a closed-form phase
        out=np.zeros(6),  # samples of a path
        probe=np.zeros(6),
        state=np.zeros(4),  # of the section maps
        toes=np.zeros(2),
        # Of rear and front leg at the last (virtual) bottom, of the rear leg at touchdown [m].
        lengths=np.zeros(3),
        times=np.zeros(2),  # since the section: of the touchdown, of the rear leg's liftoff [s]
        stiffness=np.zeros(2),  # of the phase's legs
        values=np.zeros((2, NUM_EVENTS)),  # the last three: see Watch
        bends=np.zeros(NUM_EVENTS),
        armed=np.zeros(MAX_EDGES, dtype=np.bool_),
    )


@inner
def scratch_of(strides: Scratch, i: int) -> Scratch:
    """Scratch of one of the strides that are kept, for :func:`inner` functions only.

    It owns no reference to its arrays, so a function that counts them would free them.
    """
    s = strides
    own = s.cx[i], s.cy[i], s.meta[i], s.events[i], s.recorded[i]
    work = s.work, s.path, s.out, s.probe, s.state, s.toes, s.lengths, s.times
    return Scratch(*own, *work, s.stiffness, s.values, s.bends, s.armed)


@inner
def apply_reset(reset: int, state: Array, toes: Array, rest_length: float, alpha: float) -> None:
    """Move the ``toes`` as a reset of the automaton says."""
    if reset == Reset.PLACE_REAR:
        toes[0] = state[0] + rest_length * np.cos(alpha)
    elif reset == Reset.PLACE_FRONT:
        toes[1] = state[0] + rest_length * np.cos(alpha)
    elif reset in (Reset.SHIFT, Reset.SWAP):
        rear = toes[0]
        toes[0] = toes[1]
        if reset == Reset.SWAP:
            toes[1] = rear


@inner
def note(event: int, time: float, state: Array, toes: Array, scratch: Scratch) -> None:
    """Write legs' lengths [m] and the time [s] of an event that ``scratch`` keeps them of."""
    lengths, times = scratch.lengths, scratch.times
    if event in (Event.BOTTOM, Event.VIRTUAL_BOTTOM):
        for leg in range(2):
            lengths[leg] = np.sqrt((state[0] - toes[leg]) ** 2 + state[1] ** 2)
    elif event == Event.TOUCHDOWN:
        lengths[2] = np.sqrt((state[0] - toes[0]) ** 2 + state[1] ** 2)
        times[0] = time
    elif event == Event.REAR_LIFTOFF:
        times[1] = time


@inner
def enter(
    kernel: Kernel, node: int, toes: Array, controls: Array, height: float, scratch: Scratch
) -> Watch:
    """Write the legs' stiffnesses in a node, and watch its guards, with a touchdown height [m]."""
    s, tables, stiffness = scratch, kernel.tables, scratch.stiffness
    rear, front = tables.rear[node], tables.front[node]
    stiffness[0] = controls[rear] if rear >= 0 else 0.0
    stiffness[1] = controls[front] if front >= 0 else 0.0
    guards = tables.event[tables.first_edge[node] : tables.first_edge[node + 1]]
    own = (s.values, s.armed, s.bends, s.out, s.probe)
    return Watch(guards, toes, kernel.rest_length, height, *own)


@inner
def run_stride(
    kernel: Kernel,
    state: Array,
    toes: Array,
    controls: Array,
    record: bool,
    scratch: Scratch,
) -> tuple[int, int, int, int, float]:
    """Run the automaton from the kernel's node until a section or a failure.

    ``state`` and ``toes`` are overwritten with the final ones. If not to ``record``, only the last
    segment and event are kept. Returns the Outcome, the last node (the one entered, where the
    section was reached), the numbers of segments and events, and the duration [s].
    """
    tables, node = kernel.tables, kernel.node
    gravity, rest_length, max_time = kernel.gravity, kernel.rest_length, kernel.max_time
    degree, tolerance = kernel.degree, kernel.tolerance
    cx, cy, meta, events = scratch[:4]
    work, out, stiffness, bends = scratch.work, scratch.out, scratch.stiffness, scratch.bends
    alpha = controls[0]
    touchdown_height = rest_length * np.sin(alpha)
    time, segments, event_count = 0.0, 0, 0
    entered, event = True, -1
    while time < max_time and segments < MAX_SEGMENTS and event_count < MAX_EVENTS:
        watch = enter(kernel, node, toes, controls, touchdown_height, scratch)
        if entered:
            arm(watch, state, event)
            entered = False
        row = segments if record else 0
        px, py = cx[row, : degree + 1], cy[row, : degree + 1]
        physics = (kernel.mass, gravity, backward(kernel, stiffness), rest_length, tolerance)
        horizon = expand(state, toes, stiffness, physics, px, py, work)
        horizon = min(horizon, max_time - time, 0.1 * np.sqrt(rest_length / gravity) * _SUBSTEPS)
        all_bends(state, toes, rest_length, steepest(px, py, horizon), horizon, bends)
        path = Path(px, py)
        fired, step = first_event(SERIES, path, horizon, horizon / _SUBSTEPS, _EVENT_TIME, watch)
        if fired >= 0:
            sample(SERIES, path, step, out)
        for i in range(4):
            state[i] = out[i]
        meta[row, 0], meta[row, 1], meta[row, 2] = time, step, node
        for leg in range(2):
            meta[row, 3 + leg], meta[row, 5 + leg] = toes[leg], stiffness[leg]
        segments += 1
        time += step
        if fired < 0:
            continue

        fired += tables.first_edge[node]
        outcome, target, event = tables.outcome[fired], tables.target[fired], tables.event[fired]
        row = event_count if record else 0
        events[row, 0], events[row, 1] = time, event
        events[row, 2], events[row, 3] = node, target
        for i in range(4):
            events[row, 4 + i] = state[i]
        event_count += 1
        note(event, time, state, toes, scratch)
        apply_reset(tables.reset[fired], state, toes, rest_length, alpha)
        if outcome >= 0:
            return outcome, (target if target >= 0 else node), segments, event_count, time
        node = target
        entered = True
    return Outcome.TIMEOUT, node, segments, event_count, time


def plain(kernel: Kernel) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """A kernel as :func:`record_stride` takes it: its tables, and its other fields."""
    return tuple(kernel.tables), tuple(kernel[1:])


@inner
def record_stride(
    kernel: tuple[tuple[Any, ...], tuple[Any, ...]],
    state: Array,
    toes: Array,
    controls: Array,
    scratch: tuple[Any, ...],
) -> tuple[int, int, int, int, float]:
    """:func:`run_stride` for Python, with every segment and event.

    All are plain tuples (:func:`plain`): a call takes named ones in twice the time.
    """
    tables, numbers = kernel
    named = Kernel(Tables(*tables), *numbers)
    return run_stride(named, state, toes, controls, _EVERY, Scratch(*scratch))
