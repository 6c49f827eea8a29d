"""Figure of a robot's robustness: success rate against level, one panel a disturbance."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from template_control.robustness.disturbances import AFTER
from template_control.robustness.findings import Finding, Robustness
from template_control.view.style import as_text

_RATE, _STANDING, _POINT = "#2a6196", "0.6", "#db7321"
_TEMPLATE = "#3d8a4f"
_COLUMNS = 5


def robustness_figure(found: Robustness) -> Figure:
    """Success rate in per cent over the levels, severity growing to the right.

    The dashed line is the breaking point: the last level up to which all trials succeed. Grey:
    trials without a fall, where success asks for more. The band holds the true rate with 95 %
    confidence. Dotted: what the template alone takes at its section.
    """
    columns = min(_COLUMNS, len(found.findings))
    rows = -(-len(found.findings) // columns)
    figure = Figure(figsize=(2.1 * columns + 0.4, 2.0 * rows + 0.7), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, finding in zip(panels, found.findings, strict=False):
        _panel(axes, finding)
    for axes in panels[len(found.findings) :]:
        axes.set_visible(False)
    figure.supylabel("success rate [%]", fontsize=9)
    figure.suptitle(
        f"{as_text(found.robot)} in {found.plant}: success over {AFTER} steps", fontsize=10
    )
    marks = (
        Line2D([], [], color=_RATE, marker="o", markersize=3.5, label="success"),
        Line2D([], [], color=_STANDING, label="no fall"),
        Line2D([], [], color=_POINT, linestyle="--", label="breaking point"),
        Patch(color=_RATE, alpha=0.15, label="95 % confidence"),
        Line2D([], [], color=_TEMPLATE, linestyle=":", label="the template alone"),
    )
    figure.legend(
        handles=marks, loc="outside lower center", ncols=len(marks), fontsize=8, frameon=False
    )
    return figure


def _panel(axes: Axes, finding: Finding) -> None:
    d = finding.disturbance
    levels = d.unit.factor * np.array([level.level for level in finding.levels])
    rates = 100.0 * np.array([level.rate for level in finding.levels])
    if d.passing:
        standing = 100.0 * np.array([level.standing for level in finding.levels])
        axes.plot(levels, standing, ".-", color=_STANDING, linewidth=1.2)
    sure = 100.0 * np.array([level.interval for level in finding.levels])
    axes.fill_between(levels, *sure.T, color=_RATE, alpha=0.15, linewidth=0.0)
    axes.plot(levels, rates, "o-", color=_RATE, markersize=3.5, linewidth=1.2)
    if finding.template:
        limit = d.unit.factor * finding.template
        axes.axvline(limit, color=_TEMPLATE, linestyle=":", linewidth=1.2)
    if finding.breaking_point is not None:
        axes.axvline(
            d.unit.factor * finding.breaking_point, color=_POINT, linestyle="--", linewidth=1.0
        )
    axes.axhline(50.0, color="0.85", linewidth=0.8, zorder=0)
    if len(levels) > 1 and levels[-1] < levels[0]:
        axes.invert_xaxis()
    axes.set_ylim(-5.0, 105.0)
    axes.set_title(d.title, fontsize=9)
    axes.set_xlabel(d.unit.name or "coefficient", fontsize=8)
    axes.tick_params(labelsize=8)
