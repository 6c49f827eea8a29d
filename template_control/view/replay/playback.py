"""Contents of a replay, frame by frame: samples, template legs, forces, footholds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from template_control.checks.fitting import check
from template_control.checks.ranges import Range
from template_control.errors import ParameterError
from template_control.run.record import Record
from template_control.view.style import interval

Array = NDArray[np.float64]

_ZIGZAGS = 12
_CARRYING = 0.005  # of the weight: what the plant counts as a contact
_STANCE = 0.03  # [s] a shorter contact is a scuff, no foothold
_MOST_FRAMES = 100_000

SPEEDS = Range(0.01, 100.0)
"""Seconds of the run per second of its replay."""
FRAME_RATES = Range(1.0, 120.0)
"""Frames per second of a replay."""


@dataclass(frozen=True)
class Playback:
    """F frames of a run: the sample of each, ``rows`` (F,), and its time ``clock`` (F,) [s].

    The clock begins at the replay's beginning.
    """

    record: Record
    rows: NDArray[np.int64]
    clock: Array


@dataclass(frozen=True)
class Foothold:
    """A place x [m] that a foot, 0 left or 1 right, stood on from a ``time`` on [s]."""

    foot: int
    x: float
    time: float


def playback(
    record: Record,
    *,
    fps: float,
    speed: float = 1.0,
    start: float | None = None,
    end: float | None = None,
) -> Playback:
    """Choose the frames of a replay.

    ``fps`` [1/s] is from 1 to 120, ``speed``, in seconds of the run per second of the replay, from
    0.01 to 100. ``start`` and ``end`` are of the part to show [s], negative from the run's end;
    None for its beginning and end. A ParameterError if a number is out of its range, a RecordError
    if the run cannot be shown.
    """
    check("speed", speed, Annotated[float, SPEEDS])
    check("fps", fps, Annotated[float, FRAME_RATES])
    record.check_shown()
    whole = float(record.time[0]), float(record.time[-1])
    begin, stop = interval(record, start, end, whole)
    duration = (stop - begin) / speed
    if duration * fps > _MOST_FRAMES:
        raise ParameterError(
            f"the replay would have {duration * fps:.0f} frames, more than {_MOST_FRAMES}:"
            " give a lower fps, a higher speed, or a shorter part by start and end"
        )
    clock = np.arange(max(int(duration * fps + 1e-9), 1) + 1) / fps
    clock[-1] = min(clock[-1], max(duration, clock[-2] + 1e-3))
    moments = begin + speed * clock
    middles = 0.5 * (record.time[1:] + record.time[:-1])
    return Playback(record, np.searchsorted(middles, moments), clock)


def carrying(record: Record) -> NDArray[np.bool_]:
    """(T, n) whether the ground carries each foot."""
    return np.asarray(record.contact_force[:, :, 1] > _CARRYING * record.weight)


def template_legs(record: Record) -> tuple[Array, NDArray[np.bool_]]:
    """The template's rear and front leg, which run from its CoM to the robot's feet.

    Their toes (T, 2, 2) [m], and (T, 2) whether each leg pushes.
    """
    samples = np.arange(len(record.time))
    feet = record.of_legs(record.foot)
    toes = np.stack((feet[samples, record.rear], feet[samples, 1 - record.rear]), axis=1)
    return toes, np.linalg.norm(record.template_force, axis=2) > _CARRYING * record.weight


def spring(radius: float) -> Array:
    """(N, 2) a zigzag from (0, 0) to (0, 1), ``radius`` to either side: a leg, drawn."""
    turns = np.arange(_ZIGZAGS)
    inner = np.stack(
        (radius * np.where(turns % 2, -1.0, 1.0), 0.15 + 0.7 * (turns + 0.5) / _ZIGZAGS), axis=1
    )
    return np.concatenate(([[0.0, 0.0], [0.0, 0.15]], inner, [[0.0, 0.85], [0.0, 1.0]]))


def coil(shape: Array, begin: Array, end: Array) -> Array:
    """(2, N) x and y of a leg's spring between two points (2,) of the picture [m].

    ``shape`` is from :func:`spring`.
    """
    span = end - begin
    normal = np.array([-span[1], span[0]]) / max(float(np.linalg.norm(span)), 1e-12)
    return np.asarray(begin[:, None] + np.stack((normal, span), axis=1) @ shape.T)


def force_arrows(record: Record) -> Array:
    """(T, n, 2) the ground's force on each foot as an arrow, zero where it does not carry [m].

    The weight is 0.4 rest lengths long. An arrow longer than two weights, at an impact, is
    cut to that.
    """
    arrow = arrows_of(record.contact_force, record)
    arrow[~carrying(record)] = 0.0
    return arrow


def arrows_of(force: Array, record: Record) -> Array:
    """Forces (..., 2) or (..., 3) [N] as arrows, see :func:`force_arrows`."""
    arrow = force / record.weight
    size = np.linalg.norm(arrow, axis=-1, keepdims=True)
    arrow = arrow * np.minimum(1.0, 2.0 / np.maximum(size, 1e-12))
    return np.asarray(0.4 * record.template.rest_length * arrow)


def footholds(record: Record) -> list[Foothold]:
    """Footholds by time."""
    found = []
    for foot, on in enumerate(carrying(record).T):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], on, [False])).astype(np.int8)))
        for first, after in edges.reshape(-1, 2):
            if record.time[after - 1] - record.time[first] >= _STANCE:
                x = float(np.median(record.foot[first:after, foot, 0]))
                found.append(Foothold(foot, x, float(record.time[first])))
    return sorted(found, key=lambda foothold: foothold.time)
