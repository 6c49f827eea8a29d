"""Figure of a campaign: share of good trials against how severe they were."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.robustness.campaigns.campaign import Campaign, Trial
from template_control.robustness.findings import wilson_interval
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
    """Shares of trials, by severity and by each number that is drawn.

    Each mark is a sixth of the trials, at their mean: the share without a fall, and the share on
    the gait. Bars are Wilson's 95 % intervals; the scale begins below the lowest of them. Pushes,
    lengths and times are those of the reference template.

    Args:
        campaign: with at least one trial.
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
        _panel(panel, values, campaign.trials)
        panel.set_xlabel(title, fontsize=9)
    for panel in axes[len(panels) :]:
        panel.set_visible(False)
    figure.legend(
        *axes[0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=2
    )
    figure.supylabel("share of the trials [%]", fontsize=9)
    robot, plant = as_text(campaign.conditions.robot.model), campaign.conditions.plant
    figure.suptitle(f"{robot} in {plant}: {len(campaign.trials)} trials, all disturbed at once")
    return figure


def _panel(axes: Axes, values: NDArray[np.float64], trials: Sequence[Trial]) -> None:
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
                axes.errorbar(
                    values[part].mean() + shift * width,
                    100.0 * share,
                    100.0 * np.array([[share - low], [high - share]]),
                    fmt="o",
                    color=color,
                    markersize=3.5,
                    linewidth=1.2,
                    label=label,
                )
                label = "_"
    axes.tick_params(labelsize=8)
