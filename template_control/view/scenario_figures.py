"""Figures of a simulated scenario: the panels of Fig. 10."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.slip.automaton.vocabulary import Slot, StrideKind
from template_control.slip.scenario.run import ScenarioRecord
from template_control.view.figure_file import save_figure
from template_control.view.style import as_text

Array = NDArray[np.float64]

_REAR, _FRONT, _COM, _GUIDE = "#2a6196", "#db7321", "#3a9a4a", "#6b7078"
_AROUND = 1.2  # [s] shown on either side of a transition


def _shade(axes: Axes, record: ScenarioRecord, horizontal: Array) -> None:
    """Grey over single stance."""
    single = np.array([name == "SS" for name in record.metadata["phases"]])[record.node]
    axes.fill_between(
        horizontal,
        0.0,
        1.0,
        where=single.tolist(),
        transform=axes.get_xaxis_transform(),
        color="0.92",
        linewidth=0,
        zorder=0,
    )
    axes.margins(x=0)


def _path(axes: Axes, record: ScenarioRecord) -> None:
    x = record.state[:, 0]
    _shade(axes, record, x)
    axes.plot(x, record.state[:, 1], color=_COM, linewidth=1.2, label="CoM")
    axes.plot(
        record.foothold[:, 1],
        np.zeros(len(record.foothold)),
        "^",
        color=_GUIDE,
        markersize=4,
        label="footholds",
        clip_on=False,
    )
    axes.set(xlabel="x [m]", ylabel="y [m]", ylim=(0.0, 1.15))
    axes.legend(loc="center right", ncols=2)


def _controls(stiffness: Axes, angle: Axes, record: ScenarioRecord) -> None:
    loaded = np.where(record.stiffness > 0.0, record.stiffness / 1e3, np.nan)
    for leg, (name, color) in enumerate((("rear", _REAR), ("front", _FRONT))):
        stiffness.plot(record.time, loaded[:, leg], color=color, linewidth=1.0, label=name)
    stiffness.set_ylabel("leg stiffness\n[kN/m]")
    stiffness.legend(loc="upper right", ncols=2)
    degrees = np.degrees(record.controls[:, Slot.TOUCHDOWN_ANGLE])
    angle.step(record.section_time[:-1], degrees, where="post", color=_REAR, linewidth=1.0)
    angle.set_ylabel("touchdown\nangle [deg]")
    for axes in (stiffness, angle):
        _shade(axes, record, record.time)


def _speed(axes: Axes, record: ScenarioRecord) -> None:
    _shade(axes, record, record.time)
    axes.plot(record.time, record.state[:, 2], color=_COM, linewidth=1.0, label="CoM")
    axes.plot(
        record.section_time[1:],
        record.wanted_speed,
        "--",
        color=_GUIDE,
        linewidth=1.0,
        label="wanted at the next section",
    )
    axes.set(xlabel="time [s]", ylabel="dx/dt [m/s]")
    axes.legend(loc="upper right")


def scenario_figure(record: ScenarioRecord) -> Figure:
    """CoM path with footholds, stiffness, touchdown angle and speed (Fig. 10a, b)."""
    figure = Figure(figsize=(9.0, 7.2), layout="constrained")
    path, stiffness, angle, speed = figure.subplots(
        4, 1, gridspec_kw={"height_ratios": [1.0, 1.2, 0.9, 1.1]}
    )
    _path(path, record)
    _controls(stiffness, angle, record)
    _speed(speed, record)
    name, map_name = as_text(record.metadata["name"]), record.metadata["map"]
    path.set_title(f"{name}, controllers on the {map_name} map")
    return figure


def energy_figure(record: ScenarioRecord) -> Figure:
    """Energies around each transition (Fig. 10c, d)."""
    transitions = [
        i
        for i, kind in enumerate(record.strides)
        if kind in (StrideKind.WALK_TO_RUN, StrideKind.RUN_TO_WALK)
    ]
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, max(len(transitions), 1), squeeze=True))
    energies = record.energies()
    for axes, i in zip(panels, transitions, strict=False):
        begin, end = record.section_time[i : i + 2]
        w = (record.time > begin - _AROUND) & (record.time < end + _AROUND)
        _shade(axes, record, record.time)
        # Offsets do not matter here; what matters is whether the curves move together.
        for name, label, color in (
            ("forward", "forward kinetic", _REAR),
            ("gravity", "gravitational", _FRONT),
            ("total", "total", _GUIDE),
        ):
            e = energies[name][w]
            axes.plot(record.time[w], e - e[0], color=color, linewidth=1.1, label=label)
        axes.axvspan(begin, end, color=_COM, alpha=0.12, linewidth=0)
        axes.set(
            xlabel="time [s]",
            ylabel="energy less its first value [J]",
            xlim=(record.time[w][0], record.time[w][-1]),
            title="walk to run" if record.strides[i] == StrideKind.WALK_TO_RUN else "run to walk",
        )
        axes.legend(loc="best")
    return figure


@checked
def save_scenario_figures(record: ScenarioRecord, folder: str | Path) -> list[Path]:
    """Write the figures as PNG; a run without transitions has no energy figure.

    Args:
        record: the scenario's run.
        folder: where the files go; it must exist.

    Returns:
        The paths of the files.

    Raises:
        RecordError: if a file cannot be written.
    """
    figures = {"scenario": scenario_figure(record)}
    if {StrideKind.WALK_TO_RUN, StrideKind.RUN_TO_WALK} & set(record.strides):
        figures["energies"] = energy_figure(record)
    return [save_figure(figure, Path(folder) / f"{name}.png") for name, figure in figures.items()]
