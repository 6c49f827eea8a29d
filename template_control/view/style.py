"""Shared parts of figures: colours, time window, shading of single stance, file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.run.record import Record
from template_control.slip.automaton.vocabulary import Phase
from template_control.storage import atomic_path

LEFT, RIGHT, TRUNK, COM, TEMPLATE = "#2a6196", "#db7321", "#6b7078", "#3a9a4a", "#111111"
WINDOW = 2.2  # [s], about four steps


def window(record: Record, seconds: float = WINDOW) -> slice:
    """Samples of the end of a run.

    Args:
        record: the run.
        seconds: how much of its end [s].

    Returns:
        A slice of the record's samples.
    """
    return slice(int(np.searchsorted(record.time, record.time[-1] - seconds)), None)


def as_text(name: str) -> str:
    """A user's name for a title: its dollar signs begin no formula, and it stays on one line."""
    return " ".join(name.split()).replace("$", r"\$")


def single_stance(record: Record) -> NDArray[np.bool_]:
    """(T,) whether the robot's controller was in single stance."""
    return record.in_phase(Phase.SS)


def shade(axes: Axes, record: Record, w: slice) -> None:
    """Shade single stance in grey, as in Fig. 13.

    Args:
        axes: a panel over time [s].
        record: the run.
        w: the samples that the panel shows, from :func:`window`.
    """
    axes.fill_between(
        record.time[w],
        0.0,
        1.0,
        where=single_stance(record)[w].tolist(),
        transform=axes.get_xaxis_transform(),
        color="0.92",
        linewidth=0,
        zorder=0,
    )
    axes.margins(x=0)


DPI = 110


def save_figure(figure: Figure, path: str | Path, dpi: int = DPI) -> Path:
    """Write a figure; a file that is there is replaced by a whole one or stays.

    Args:
        figure: what to draw.
        path: of the file; its ending tells the format.
        dpi: dots per inch, of a picture made of dots.

    Raises:
        RecordError: if the file cannot be written.
    """
    with atomic_path(path) as place:
        figure.savefig(place, dpi=dpi)
    return Path(path)
