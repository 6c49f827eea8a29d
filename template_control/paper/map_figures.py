"""Figures of the closed-form maps' errors (Fig. 5) and of transition strides (Figs. 6, 7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

_COLORS = ("#db7321", "#2a6196", "#6b7078", "#3a9a4a")


def error_figure(edges: Array, counts: Array, means: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Mean errors binned over d_v, with the number of runs in each bin.

    Args:
        edges: (b + 1,) of the bins.
        counts: (b,) runs.
        means: by map, (b,) mean position and velocity errors [%].
    """
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    centres, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    for panel, (axes, label) in enumerate(
        zip(
            figure.subplots(1, 2), ("position error e_v [%]", "velocity error E_v [%]"), strict=True
        )
    ):
        bars = axes.twinx()
        bars.bar(centres, counts, width=0.9 * width, color="0.88", zorder=0)
        bars.set_ylabel("runs")
        axes.set_zorder(bars.get_zorder() + 1)
        axes.patch.set_visible(False)
        for color, (name, values) in zip(_COLORS, means.items(), strict=False):
            axes.plot(centres, values[panel], "o-", color=color, markersize=4, label=name)
        axes.set(xlabel="d_v", ylabel=label, yscale="log")
        axes.legend(loc="lower right")
    return figure


def stride_figure(
    paths: Sequence[tuple[str, Array]],
    legs: Sequence[tuple[Array, Array]],
    events: Sequence[tuple[str, float, float]],
    title: str,
) -> Figure:
    """A stride's CoM path with its legs at the events.

    Args:
        paths: label and (n, 2) x, y of each path [m].
        legs: toe and CoM (2,) of each leg drawn.
        events: name, x and y of each event.
        title: over the figure.
    """
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for toe, com in legs:
        axes.plot([toe[0], com[0]], [toe[1], com[1]], color="0.75", linewidth=1.0, zorder=1)
    for color, (label, path) in zip(_COLORS, paths, strict=False):
        axes.plot(path[:, 0], path[:, 1], color=color, linewidth=1.6, label=label, zorder=2)
    for i, (name, x, y) in enumerate(events):
        axes.plot(x, y, "o", color="black", markersize=3.5, zorder=3)
        axes.annotate(
            name,
            (x, y),
            xytext=(0, 9 + 12 * (i % 2)),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title, ylim=(-0.03, 1.3))
    axes.legend(loc="upper right", ncols=2)
    return figure
