"""Figure of a study: a heat map over two axes, else points over one."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.sweep.study import Study, heat_map
from template_control.sweep.sweep import SweepResult
from template_control.view.style import as_text


def study_figure(study: Study, result: SweepResult) -> Figure:
    """The first figure of a study: a heat map of a grid of two axes, else over the first axis.

    Args:
        study: the question.
        result: its trials.

    Returns:
        The Matplotlib figure.

    Raises:
        SweepError: if the study's first figure is no number.
    """
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    values = heat_map(study, result)
    if values is None:
        _points(axes, study, result)
    else:
        _heat_map(figure, axes, study, values)
    axes.set_title(as_text(study.about), fontsize=10)
    return figure


def _points(axes: Axes, study: Study, result: SweepResult) -> None:
    first = study.axes[0]
    places = [item["item"][first] for item in result.items]
    numbers = all(isinstance(place, int | float) for place in places)
    axes.plot(places if numbers else [as_text(str(place)) for place in places],
              result.column(study.figures[0]), "o")  # fmt: skip
    axes.set_xlabel(as_text(first))
    axes.set_ylabel(as_text(study.figures[0]))


def _heat_map(figure: Figure, axes: Axes, study: Study, values: NDArray[np.float64]) -> None:
    image = axes.imshow(values, origin="lower", aspect="auto", cmap="viridis")
    first, second = study.grid
    axes.set_ylabel(as_text(first))
    axes.set_xlabel(as_text(second))
    axes.set_yticks(range(values.shape[0]), [as_text(str(v)) for v in study.grid[first]])
    axes.set_xticks(range(values.shape[1]), [as_text(str(v)) for v in study.grid[second]])
    known = values[np.isfinite(values)]
    middle = 0.5 * (known.min() + known.max()) if known.size else 0.0
    for (row, column), value in np.ndenumerate(values):
        text = "failed" if np.isnan(value) else f"{value:.4g}"
        color = "w" if value < middle else "k"
        axes.text(column, row, text, ha="center", va="center", color=color)
    figure.colorbar(image, label=as_text(study.figures[0]))
