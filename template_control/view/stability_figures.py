"""Figures of gait branches, basins of attraction (Fig. 8) and the deadbeat set (Fig. 9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from template_control.arrays import Array, BoolArray, IntArray
from template_control.checks.checked import checked
from template_control.slip.gaits.branch import BranchPoint, Kind, Special
from template_control.view.style import COM, LEFT, RIGHT, TRUNK, gallery, panelled

_POINT: dict[str, Any] = {"marker": ".", "markersize": 3}
_SPECIAL: dict[str, Any] = {"color": "black", "fillstyle": "none", "markersize": 5}
_LOOKS: dict[Kind | Special, dict[str, Any]] = {
    Kind.STABLE: {**_POINT, "color": LEFT},
    Kind.SADDLE: {**_POINT, "color": RIGHT},
    Kind.UNSTABLE: {**_POINT, "color": TRUNK},
    Kind.NEUTRAL: {**_POINT, "color": COM},
    Special.FOLD: {**_SPECIAL, "marker": "D"},
    Special.SADDLE_NODE: {**_SPECIAL, "marker": "s"},
    Special.FLIP: {**_SPECIAL, "marker": "v"},
    Special.NEIMARK_SACKER: {**_SPECIAL, "marker": "o"},
}
_SPEED = "mean speed [m/s]"
_MAPS = (RIGHT, LEFT, COM)
UNITS = {
    "energy": ("energy [J]", "E [J]", 1.0),
    "angle": ("touchdown angle [deg]", "alpha [deg]", 180.0 / np.pi),
    "stiffness": ("leg stiffness [kN/m]", "k [kN/m]", 1e-3),
    "height": ("height [m]", "y [m]", 1.0),
    "speed": ("dx/dt [m/s]", "dx/dt [m/s]", 1.0),
}
"""By quantity: its label in a figure, its header in a table, and its factor from SI units."""


@checked
def branch_figure(
    points: Sequence[BranchPoint], over: str, show: Sequence[str], controlled: bool = False
) -> Figure:
    """Quantities and the largest eigenvalue along a branch, coloured by stability.

    Args:
        points: of the branch, in order.
        over: quantity on the horizontal axis.
        show: quantities on the vertical axes.
        controlled: ``over`` is of the controller's target, not of the gait it leads to.
    """
    label, _, unit = UNITS[over]
    if controlled:
        label, over = f"target's {label}", "target"
    x = unit * np.array([p.quantity(over) for p in points])
    curves = [(UNITS[s][0], UNITS[s][2] * np.array([p.quantity(s) for p in points])) for s in show]
    largest = np.array([np.abs(p.eigenvalues).max() for p in points])
    curves.append(("largest |eigenvalue|", largest))
    figure, panels = panelled(3.4, 1, len(curves))
    for axes, (name, y) in zip(panels, curves, strict=True):
        axes.plot(x, y, color="0.8", linewidth=0.8, zorder=1)
        for what in (*Kind, *dict.fromkeys(p.special for p in points if p.special)):
            of = np.array([(p.special or p.kind) is what for p in points])
            if of.any():
                axes.plot(x[of], y[of], linestyle="", label=what.value, **_LOOKS[what])
        axes.set(xlabel=label, ylabel=name)
    axes.axhline(1.0, color="0.4", linewidth=0.8)
    axes.set_ylim(0.0, min(3.0, max(1.1, 1.1 * largest.max())))
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, fontsize=8)
    return figure


@checked
def basin_figure(
    energies: Array,
    heights: Array,
    angles: Array,
    steps: IntArray,
    converges: BoolArray,
) -> Figure:
    """Slices of a basin of attraction at several energies.

    Args:
        energies: (e,) [J].
        heights: (h,) y at VLO [m].
        angles: (a,) velocity angle, positive downward [deg].
        steps: (e, a, h) steps to fall.
        converges: (e, a, h) whether the walk converges to the equilibrium.
    """
    columns = min(4, len(energies))
    figure, panels = gallery(len(energies), columns, (2.3, 0.3), sharex=True, sharey=True)
    extent = (heights[0], heights[-1], angles[0], angles[-1])
    for axes, energy, fall, good in zip(panels, energies, steps, converges, strict=False):
        image = axes.imshow(
            np.where(good, np.nan, fall), origin="lower", extent=extent, aspect="auto",
            cmap="Greys", vmin=0, vmax=1.3 * steps.max(),
        )  # fmt: skip
        axes.contourf(
            heights, angles, good.astype(float), levels=[0.5, 1.5], colors=[LEFT], alpha=0.85
        )
        axes.set_title(f"{energy:.2f} J", fontsize=9)
    figure.supxlabel("y at VLO [m]", fontsize=10)
    figure.supylabel("velocity angle, downward [deg]", fontsize=10)
    figure.colorbar(image, ax=figure.axes, label="steps to fall (blue: converges)")
    return figure


@checked
def deadbeat_figure(
    heights: Array,
    angles: Array,
    settled: Mapping[str, BoolArray],
    least_angles: Array,
    shares: Mapping[str, Array],
    published: float,
) -> Figure:
    """The deadbeat set, where a map's controller fails on it, and Pz_in over alpha_min.

    Args:
        heights, angles: (n,) y [m] and velocity angle [deg] of the set.
        settled: by map, (n,) whether the step leads into the basin; the first is drawn.
        least_angles: (m,) alpha_min [deg].
        shares: by map, (m,) Pz_in.
        published: the paper's alpha_min [deg].
    """
    figure, (left, right) = panelled(3.8, 1, 2)
    name, inside = next(iter(settled.items()))
    left.plot(heights[inside], angles[inside], ".", color=_MAPS[1], markersize=1.5, label="settles")
    left.plot(
        heights[~inside], angles[~inside], "x", color="0.55", markersize=3, label=f"fails ({name})"
    )
    left.set(xlabel="y at VLO [m]", ylabel="velocity angle, downward [deg]")
    left.legend(loc="best", markerscale=2)
    for color, (label, values) in zip(_MAPS, shares.items(), strict=False):
        right.plot(least_angles, 100.0 * values, color=color, linewidth=1.4, label=label)
    right.axvline(published, color="0.4", linewidth=0.8, linestyle="--", label="paper, 100 %")
    right.set(xlabel="alpha_min [deg]", ylabel="Pz_in [%]")
    right.legend(loc="lower right")
    return figure


def speed_family_figure(
    quantities: Mapping[str, Sequence[Array]], pairs: Mapping[str, Mapping[str, Sequence[Array]]]
) -> Figure:
    """Gaits against their mean speed, one line for each chain of a family.

    ``quantities`` are by the axis' label, values of each chain, and ``pairs`` by the axis' and the
    curve's label, which share a panel.
    """
    x = quantities[_SPEED]
    panels = {k: {"": v} for k, v in quantities.items() if k != _SPEED} | dict(pairs)
    columns = -(-len(panels) // 2)
    figure, found = panelled(4.6, 2, columns, 2.6 * columns)
    for axes, (label, curves) in zip(found, panels.items(), strict=False):
        for colour, (name, chains) in zip(_MAPS, curves.items(), strict=False):
            for i, (speeds, values) in enumerate(zip(x, chains, strict=True)):
                axes.plot(speeds, values, color=colour, label=name if name and i == 0 else None)
        axes.set(xlabel=_SPEED, ylabel=label)
        if len(curves) > 1:
            axes.legend(fontsize="small")
    return figure
