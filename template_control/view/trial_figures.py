"""Figures of many trials: robustness level by level, campaigns and studies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from template_control.arrays import Array
from template_control.plant.plant import plant_name
from template_control.robustness.campaign import Campaign, Trial
from template_control.robustness.disturbances import AFTER
from template_control.robustness.findings import Finding, Robustness, wilson_interval
from template_control.sweep.study import Study, heat_map
from template_control.sweep.sweep import SweepResult
from template_control.view.style import LEFT, RIGHT, as_text

_SHOWN = {
    "friction": ("friction", 1.0),
    "mass": ("mass [%]", 100.0),
    "push": ("push [N s]", 1.0),
    "direction": ("push, direction [deg]", 1.0),
    "ground_step": ("ground step [cm]", 100.0),
    "noise": ("noise [mrad]", 1e3),
    "delay": ("delay [ms]", 1e3),
    "speed": ("start, speed [%]", 100.0),
    "height": ("start, height [cm]", 100.0),
}
_BINS = 6  # each with as many trials
_COLUMNS = 3


def campaign_figure(campaign: Campaign) -> Figure:
    """Shares of trials, by severity and by each number that is drawn; there is one trial at least.

    Each mark is a sixth of the trials, at their mean: the share without a fall, and the share on
    the gait. Bars are Wilson's 95 % intervals; the scale begins below the lowest of them. Pushes,
    lengths and times are those of the reference template.
    """
    mix = campaign.conditions.mix
    panels = {"severity": np.array([t.severity for t in campaign.trials])}
    for name, (title, factor) in _SHOWN.items():
        low, high = getattr(mix, name)
        if low < high:
            panels[title] = factor * np.array([getattr(t.draw, name) for t in campaign.trials])
    rows = -(-len(panels) // _COLUMNS)
    figure = Figure(figsize=(9.0, 2.2 * rows + 0.6), layout="constrained")
    axes = figure.subplots(rows, _COLUMNS, sharey=True, squeeze=False).ravel()
    for panel, (title, values) in zip(axes, panels.items(), strict=False):
        _share_panel(panel, values, campaign.trials)
        panel.set_xlabel(title, fontsize=9)
    for panel in axes[len(panels) :]:
        panel.set_visible(False)
    figure.legend(
        *axes[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=2
    )
    figure.supylabel("share of the trials [%]", fontsize=9)
    experiment = campaign.conditions.experiment
    robot, plant = as_text(experiment.robot_name), plant_name(experiment.world)
    figure.suptitle(f"{robot} in {plant}: {len(campaign.trials)} trials, all disturbed at once")
    return figure


def _share_panel(axes: Axes, values: Array, trials: Sequence[Trial]) -> None:
    for shift, (label, color, good) in enumerate(
        (
            ("no fall", RIGHT, [not t.fell for t in trials]),
            ("on its gait", LEFT, [t.good for t in trials]),
        )
    ):
        width = 0.01 * (float(np.ptp(values)) or 1.0)
        for part in np.array_split(np.argsort(values, kind="stable"), _BINS):
            if len(part):
                count = int(np.sum(np.array(good)[part]))
                share = count / len(part)
                low, high = wilson_interval(count, len(part))
                sure = 100.0 * np.array([[share - low], [high - share]])
                axes.errorbar(
                    values[part].mean() + shift * width, 100.0 * share, sure, fmt="o", color=color,
                    markersize=3.5, linewidth=1.2, label=label,
                )  # fmt: skip
                label = "_"
    axes.tick_params(labelsize=8)


_RATE, _STANDING, _POINT = "#2a6196", "0.6", "#db7321"
_TEMPLATE = "#3d8a4f"
_LEVEL_COLUMNS = 5


def robustness_figure(found: Robustness) -> Figure:
    """Success rate in per cent over the levels, severity growing to the right.

    The dashed line is the breaking point: the last level up to which all trials succeed. Grey:
    trials without a fall, where success asks for more. The band holds the true rate with 95 %
    confidence. Dotted: what the template alone takes at its section.
    """
    columns = min(_LEVEL_COLUMNS, len(found.findings))
    rows = -(-len(found.findings) // columns)
    figure = Figure(figsize=(2.1 * columns + 0.4, 2.0 * rows + 0.7), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, finding in zip(panels, found.findings, strict=False):
        _level_panel(axes, finding)
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


def _level_panel(axes: Axes, finding: Finding) -> None:
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


def _heat_map(figure: Figure, axes: Axes, study: Study, values: Array) -> None:
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
