"""Contents of a replay, frame by frame: samples, stances, forces, springs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from template_control.arrays import Array, BoolArray, IntArray
from template_control.checks.fitting import check
from template_control.checks.ranges import Range
from template_control.errors import ParameterError
from template_control.run.record import Record
from template_control.view.style import interval

_ZIGZAGS = 12
CARRYING = 0.005  # share of the weight that the plant counts as a contact
_STANCE = 0.03  # [s] a shorter contact is a scuff, no foothold
_MOST_FRAMES = 100_000

SPEEDS = Range(0.01, 100.0)  # seconds of the run per second of its replay
FRAME_RATES = Range(1.0, 120.0)  # frames per second of a replay


@dataclass(frozen=True)
class Playback:
    """Frames of a run: samples ``rows`` (F,), and the replay's time ``clock`` (F,) [s]."""

    record: Record
    rows: IntArray
    clock: Array


def playback(
    record: Record,
    *,
    fps: float,
    speed: float = 1.0,
    start: float | None = None,
    end: float | None = None,
) -> Playback:
    """Choose the frames of a replay, with ``speed`` seconds of the run per second.

    ``start`` and ``end`` are of the part to show [s], negative from the run's end; None for all.
    """
    check("speed", speed, Annotated[float, SPEEDS])
    check("fps", fps, Annotated[float, FRAME_RATES])
    record.check_shown()
    begin, stop = interval(record, start, end)
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


def carrying(record: Record) -> BoolArray:
    """(T, n) whether the ground carries each foot."""
    return np.asarray(record.contact_force[:, :, 1] > CARRYING * record.weight)


def stances(record: Record) -> list[list[tuple[int, int]]]:
    """For each foot the first sample of each of its stances, and the one after the last."""
    found = []
    for on in carrying(record).T:
        edges = np.flatnonzero(np.diff(on.astype(np.int8), prepend=0, append=0))
        pairs = edges.reshape(-1, 2).tolist()
        found.append([(a, b) for a, b in pairs if record.time[b - 1] - record.time[a] >= _STANCE])
    return found


def spring(radius: float) -> Array:
    """(N, 2) a zigzag from (0, 0) to (0, 1), ``radius`` to either side: a leg, drawn."""
    turns = np.arange(_ZIGZAGS)
    inner = np.stack(
        (radius * np.where(turns % 2, -1.0, 1.0), 0.15 + 0.7 * (turns + 0.5) / _ZIGZAGS), axis=1
    )
    return np.concatenate(([[0.0, 0.0], [0.0, 0.15]], inner, [[0.0, 0.85], [0.0, 1.0]]))


def coil(shape: Array, begin: Array, end: Array) -> Array:
    """(2, N) x and y of a leg's :func:`spring` between two points (2,) of the picture [m]."""
    span = end - begin
    normal = np.array([-span[1], span[0]]) / max(float(np.linalg.norm(span)), 1e-12)
    return np.asarray(begin[:, None] + np.stack((normal, span), axis=1) @ shape.T)


def force_arrows(force: Array, on: BoolArray, weight: float, length: float) -> Array:
    """Forces (..., d) [N] as arrows [m], zero where a foot is not ``on`` the ground.

    The ``weight`` [N] is 0.4 of the rest ``length`` [m] long. An arrow longer than two weights, at
    an impact, is cut to that.
    """
    arrow = np.where(on[..., None], force / weight, 0.0)
    size = np.linalg.norm(arrow, axis=-1, keepdims=True)
    arrow = arrow * np.minimum(1.0, 2.0 / np.maximum(size, 1e-12))
    return np.asarray(0.4 * length * arrow)
