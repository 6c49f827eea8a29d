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
from template_control.view.style import LEFT, RIGHT, as_text, gallery, panelled

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
    figure, axes = gallery(len(panels), _COLUMNS, (2.2, 0.6), sharey=True)
    for panel, (title, values) in zip(axes, panels.items(), strict=True):
        _share_panel(panel, values, campaign.trials)
        panel.set_xlabel(title, fontsize=9)
    figure.legend(
        *axes[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=2
    )
    figure.supylabel("share of the trials [%]", fontsize=9)
    experiment = campaign.conditions.experiment
    robot, plant = as_text(experiment.robot_name), plant_name(experiment.world)
    figure.suptitle(f"{robot} in {plant}: {len(campaign.trials)} trials, all disturbed at once")
    return figure


def _share_panel(axes: Axes, values: Array, trials: Sequence[Trial]) -> None:
    width = 0.01 * (float(np.ptp(values)) or 1.0)
    for shift, (label, color, good) in enumerate(
        (
            ("no fall", RIGHT, np.array([not t.fell for t in trials])),
            ("on its gait", LEFT, np.array([t.good for t in trials])),
        )
    ):
        for part in np.array_split(np.argsort(values, kind="stable"), _BINS):
            if len(part):
                count, share = int(good[part].sum()), float(good[part].mean())
                low, high = wilson_interval(count, len(part))
                sure = 100.0 * np.array([[share - low], [high - share]])
                axes.errorbar(
                    values[part].mean() + shift * width, 100.0 * share, sure, fmt="o", color=color,
                    markersize=3.5, linewidth=1.2, label=label,
                )  # fmt: skip
                label = "_"
    axes.tick_params(labelsize=8)


_STANDING, _TEMPLATE = "0.6", "#3d8a4f"
_LEVEL_COLUMNS = 5


def robustness_figure(found: Robustness) -> Figure:
    """Success rate in per cent over the levels, severity growing to the right.

    The dashed line is the breaking point: the last level up to which all trials succeed. Grey:
    trials without a fall, where success asks for more. The band holds the true rate with 95 %
    confidence. Dotted: what the template alone takes at its section.
    """
    columns = min(_LEVEL_COLUMNS, len(found.findings))
    size = (2.0, 0.7), 2.1 * columns + 0.4
    figure, panels = gallery(len(found.findings), columns, *size, sharey=True)
    for axes, finding in zip(panels, found.findings, strict=True):
        _level_panel(axes, finding)
    figure.supylabel("success rate [%]", fontsize=9)
    figure.suptitle(
        f"{as_text(found.robot)} in {found.plant}: success over {AFTER} steps", fontsize=10
    )
    marks = (
        Line2D([], [], color=LEFT, marker="o", markersize=3.5, label="success"),
        Line2D([], [], color=_STANDING, label="no fall"),
        Line2D([], [], color=RIGHT, linestyle="--", label="breaking point"),
        Patch(color=LEFT, alpha=0.15, label="95 % confidence"),
        Line2D([], [], color=_TEMPLATE, linestyle=":", label="the template alone"),
    )
    figure.legend(
        handles=marks, loc="outside lower center", ncols=len(marks), fontsize=8, frameon=False
    )
    return figure


def _level_panel(axes: Axes, finding: Finding) -> None:
    d, tried = finding.disturbance, finding.levels
    levels = d.unit.factor * np.array([level.level for level in tried])
    if d.passing:
        standing = [100.0 * level.standing for level in tried]
        axes.plot(levels, standing, ".-", color=_STANDING, linewidth=1.2)
    sure = 100.0 * np.array([level.interval for level in tried])
    axes.fill_between(levels, *sure.T, color=LEFT, alpha=0.15, linewidth=0.0)
    rates = [100.0 * level.rate for level in tried]
    axes.plot(levels, rates, "o-", color=LEFT, markersize=3.5, linewidth=1.2)
    for level, color, style, width in (
        (finding.template or None, _TEMPLATE, ":", 1.2),
        (finding.breaking_point, RIGHT, "--", 1.0),
    ):
        if level is not None:
            axes.axvline(d.unit.factor * level, color=color, linestyle=style, linewidth=width)
    axes.axhline(50.0, color="0.85", linewidth=0.8, zorder=0)
    if len(levels) > 1 and levels[-1] < levels[0]:
        axes.invert_xaxis()
    axes.set_ylim(-5.0, 105.0)
    axes.set_title(d.title, fontsize=9)
    axes.set_xlabel(d.unit.name or "coefficient", fontsize=8)
    axes.tick_params(labelsize=8)


def study_figure(study: Study, result: SweepResult) -> Figure:
    """Matplotlib figure of a study's first: a heat map of a grid of two axes, else over the first.

    Args:
        study: the question.
        result: its trials.

    Raises:
        SweepError: if the study's first figure is no number.
    """
    figure, (axes,) = panelled(4.4, width=6.4)
    values = heat_map(study, result)
    if values is None:
        first = study.axes[0]
        places = [item["item"][first] for item in result.items]
        if not all(isinstance(place, int | float) for place in places):
            places = [as_text(str(place)) for place in places]
        axes.plot(places, result.column(study.figures[0]), "o")
        axes.set(xlabel=as_text(first), ylabel=as_text(study.figures[0]))
    else:
        _heat_map(figure, axes, study, values)
    axes.set_title(as_text(study.about), fontsize=10)
    return figure


def _heat_map(figure: Figure, axes: Axes, study: Study, values: Array) -> None:
    image = axes.imshow(values, origin="lower", aspect="auto", cmap="viridis")
    for axis, (name, given) in zip((axes.yaxis, axes.xaxis), study.grid.items(), strict=True):
        axis.set_label_text(as_text(name))
        axis.set_ticks(range(len(given)), [as_text(str(v)) for v in given])
    known = values[np.isfinite(values)]
    middle = 0.5 * (known.min() + known.max()) if known.size else 0.0
    for (row, column), value in np.ndenumerate(values):
        text = "failed" if np.isnan(value) else f"{value:.4g}"
        color = "w" if value < middle else "k"
        axes.text(column, row, text, ha="center", va="center", color=color)
    figure.colorbar(image, label=as_text(study.figures[0]))
