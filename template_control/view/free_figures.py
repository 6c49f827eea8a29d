"""Figures of a walk in space: its path from above, its sway, and how the trunk stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.run.record import FloatingRecord
from template_control.view.style import (
    COM,
    LEFT,
    RIGHT,
    TEMPLATE,
    TRUNK,
    as_text,
    shade,
    single_stance,
    window,
)

Array = NDArray[np.float64]

_FEET = (("left foot", LEFT), ("right foot", RIGHT))


def footholds(record: FloatingRecord, foot: int) -> tuple[Array, Array]:
    """Where and when a foot stood.

    Args:
        record: the run.
        foot: its index.

    Returns:
        (n, 2) x and y in the world in the middle of each stance [m]; (n,) times [s].
    """
    weight = record.metadata["mass"] * record.metadata["template"]["gravity"]
    stands = record.space_force[:, foot, 2] > 0.02 * weight
    edges = np.flatnonzero(np.diff(np.concatenate(([0], stands.astype(np.int8), [0]))))
    spans = [(a, b) for a, b in edges.reshape(-1, 2) if record.time[b - 1] - record.time[a] > 0.05]
    middle = np.array([(a + b) // 2 for a, b in spans], dtype=np.int64)
    return record.space_foot[middle, foot, :2], record.time[middle]


def from_above(record: FloatingRecord, seconds: float = 4.0) -> Figure:
    """The CoM's path from above with the footholds: of the run, and of its end.

    Args:
        record: the run.
        seconds: how much of its end the lower panel shows [s].
    """
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    whole, end = figure.subplots(2, 1, height_ratios=(3, 2))
    for axes, w in ((whole, slice(None)), (end, window(record, seconds))):
        path, since = record.space_com[w], record.time[w][0]
        axes.plot(path[:, 0], path[:, 1], color=COM, linewidth=0.8, label="CoM")
        for foot, (name, color) in enumerate(_FEET):
            places, times = footholds(record, foot)
            shown = places[times >= since]
            axes.plot(shown[:, 0], shown[:, 1], ".", color=color, markersize=4.0, label=name)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_ylabel("y, to the left [m]")
    whole.set_title(f"{as_text(record.metadata['robot'])}: path from above")
    whole.legend(loc="best")
    end.set_xlabel("x [m]")
    return figure


def lateral_portrait(record: FloatingRecord, seconds: float = 10.0) -> Figure:
    """Sway over its rate, from the foot that stands: left and right are mirror images.

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    axes = figure.subplots()
    sway, single, rear = record.sway[w], single_stance(record)[w], record.rear[w]
    for foot, (name, color) in enumerate(_FEET):
        shown = np.where((single & (rear == foot))[:, None], sway, np.nan)
        axes.plot(1e3 * shown[:, 0], shown[:, 1], color=color, linewidth=0.8, label=f"on {name}")
    axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axes.axvline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axes.set_xlabel("y of the CoM from the stance foot [mm]")
    axes.set_ylabel("dy/dt [m/s]")
    axes.set_title(f"{as_text(record.metadata['robot'])}: sway in single stance")
    axes.legend(loc="best")
    return figure


def attitude(record: FloatingRecord, seconds: float = 4.0) -> Figure:
    """Roll, pitch and yaw of the trunk in the heading frame: over the run, and its end.

    Args:
        record: the run.
        seconds: how much of its end the right column shows [s].
    """
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    panels = figure.subplots(3, 2, sharex="col", width_ratios=(2, 1))
    w = window(record, seconds)
    for row, name in enumerate(("roll", "pitch", "yaw")):
        angle = record.attitude[:, row]
        _line(panels[row, 0], record.time, angle, f"{name} [rad]")
        _line(panels[row, 1], record.time[w], angle[w], "")
        shade(panels[row, 1], record, w)
    panels[0, 0].set_title(f"{as_text(record.metadata['robot'])}: trunk in the heading frame")
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    return figure


def _line(axes: Axes, time: Array, angle: Array, name: str) -> None:
    axes.plot(time, angle, color=TRUNK, linewidth=0.8)
    axes.axhline(0.0, color=TEMPLATE, linewidth=0.5)
    axes.set_ylabel(name)


FREE_FIGURES: dict[str, Callable[[FloatingRecord], Figure]] = {
    "from_above": from_above,
    "lateral_portrait": lateral_portrait,
    "attitude": attitude,
}
"""What only a run in space has, by file name."""
