"""Figures of a scenario: of the template alone (Fig. 10), and of a robot with its template."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.run.record import Record
from template_control.run.summary import STANDING
from template_control.slip.automaton.vocabulary import Slot, StrideKind
from template_control.slip.scenario.run import ScenarioRecord
from template_control.view.state_figures import template_energies
from template_control.view.style import (
    COM,
    LEFT,
    RIGHT,
    TEMPLATE,
    TRUNK,
    as_text,
    save_figure,
    shade,
)

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


_WHOLE = slice(None)
_TRANSITIONS: dict[str, str] = {
    StrideKind.WALK_TO_RUN: "walk to run",
    StrideKind.RUN_TO_WALK: "run to walk",
}


def _footholds(record: Record) -> Array:
    """x of every place where a foot landed [m]."""
    found = []
    for foot in range(2):
        stands = record.contact_force[:, foot, 1] > 0.0
        landed = np.flatnonzero(stands[1:] & ~stands[:-1]) + 1
        # A landing rattles for some milliseconds.
        apart = np.diff(record.time[landed], prepend=-np.inf) > 0.1
        found.append(record.foot[landed[apart], foot, 0])
    return np.concatenate(found)


def _stiffnesses(record: Record) -> Array:
    """(T, 2) of the template's rear and front leg [N/m], NaN where it carries nothing."""
    stride = np.maximum(np.searchsorted(record.section_time, record.time, side="right") - 1, 0)
    out = np.full((len(record.time), 2), np.nan)
    for index in np.unique(record.node):
        on = record.node == index
        for leg, slot in enumerate(record.stiffness_slots[index]):
            if slot is not None:
                out[on, leg] = record.section_controls[stride[on], slot]
    return out


def _template_begins(record: Record) -> tuple[float, float]:
    """When [s] and where [m] the robot comes to the first stride that the template makes, too."""
    kinds = record.kinds_of_stride
    first = next((i for i, kind in enumerate(kinds) if kind not in STANDING), 0)
    if first == 0:
        return 0.0, 0.0
    begin = float(record.section_time[first])
    return begin, float(np.interp(begin, record.time, record.com[:, 0]))


def route_figure(record: Record, template: ScenarioRecord) -> Figure:
    """Speed, path of the CoM with footholds, leg stiffnesses and torques, single stance shaded.

    Where the robot stands first, the template begins when the robot has walked off.

    Args:
        record: the robot's run.
        template: the same scenario on the robot's template.
    """
    figure = Figure(figsize=(9.0, 9.6), layout="constrained")
    speed, path, stiffness, torque = figure.subplots(4, 1)
    begin, where = _template_begins(record)
    speed.plot(record.time, record.com_velocity[:, 0], color=COM, linewidth=1.0, label="robot")
    speed.plot(
        begin + template.time, template.state[:, 2], "--", color=TEMPLATE, linewidth=0.8,
        label="the template alone",
    )  # fmt: skip
    speed.step(
        record.section_time[1:], record.section_target[:-1, 0], where="pre", color=RIGHT,
        linewidth=1.0, label="wanted at the next section",
    )  # fmt: skip
    if np.any(record.section_accepted != record.section_target[:, 0]):
        speed.step(
            record.section_time[1:], record.section_accepted[:-1], ":", where="pre", color=TRUNK,
            linewidth=1.2, label="accepted",
        )  # fmt: skip
    speed.set_ylabel("dx/dt [m/s]")
    path.plot(*record.com.T, color=COM, linewidth=1.0, label="robot's CoM")
    path.plot(
        where + template.state[:, 0], template.state[:, 1], "--", color=TEMPLATE, linewidth=0.8,
        label="the template alone",
    )  # fmt: skip
    holds = _footholds(record)
    path.plot(holds, np.zeros(len(holds)), "^", color=TRUNK, markersize=3, label="footholds")
    path.set(xlabel="x [m]", ylabel="y [m]", ylim=(-0.02, 1.15))
    path.margins(x=0)
    for leg, (name, color) in enumerate((("rear", LEFT), ("front", RIGHT))):
        values = 1e-3 * _stiffnesses(record)[:, leg]
        stiffness.plot(record.time, values, color=color, linewidth=1.0, label=f"{name} leg")
    stiffness.set_ylabel("template's leg\nstiffness [kN/m]")
    for joint, name in enumerate(record.joints):
        color = (LEFT, RIGHT, COM, TRUNK)[joint % 4]
        torque.plot(record.time, record.torque[:, joint], color=color, linewidth=0.6, label=name)
    for limit in set(record.torque_limit):
        for sign in (-1.0, 1.0):
            torque.axhline(sign * limit, color="0.4", linestyle=":", linewidth=0.9)
    torque.set(xlabel="time [s]", ylabel="torque [N m]")
    for axes in (speed, stiffness, torque):
        shade(axes, record, _WHOLE)
        _mark_transitions(axes, record)
        axes.set_xlim(0.0, max(record.time[-1], begin + template.time[-1]))
    path.legend(loc="center right", fontsize=7, ncols=3)
    for axes in (speed, stiffness, torque):
        axes.legend(loc="upper right", fontsize=7, ncols=2)
    name = as_text(record.robot_name)
    speed.set_title(f"{name} through its scenario (single stance shaded)")
    return figure


def _mark_transitions(axes: Axes, record: Record) -> None:
    for begin, end, _ in _transitions(record):
        axes.axvspan(begin, end, color=COM, alpha=0.15, linewidth=0)


def _transitions(record: Record) -> list[tuple[float, float, str]]:
    """Begin and end of each transition that was completed [s], and its name."""
    kinds = record.kinds_of_stride[:-1]
    times = record.section_time
    return [
        (float(times[i]), float(times[i + 1]), _TRANSITIONS[kind])
        for i, kind in enumerate(kinds)
        if kind in _TRANSITIONS
    ]


def transition_energies(record: Record) -> Figure:
    """Energies of the robot's CoM and of the template around each transition (Fig. 10c, d).

    Args:
        record: the run; it has one transition at least.
    """
    transitions = _transitions(record)
    p = record.template
    forward = 0.5 * p.mass * record.com_velocity[:, 0] ** 2
    gravity = p.mass * p.gravity * record.com[:, 1]
    total = template_energies(record)["total"]
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    panels = figure.subplots(1, len(transitions), squeeze=False)[0]
    for axes, (begin, end, name) in zip(panels, transitions, strict=True):
        w = (record.time > begin - _AROUND) & (record.time < end + _AROUND)
        shade(axes, record, _WHOLE)
        for label, energy, color in (
            ("forward kinetic", forward, LEFT),
            ("gravitational", gravity, RIGHT),
            ("template's total", total, TEMPLATE),
        ):
            axes.plot(record.time[w], energy[w] - energy[w][0], color=color, label=label)
        axes.axvspan(begin, end, color=COM, alpha=0.15, linewidth=0)
        axes.set(xlabel="time [s]", title=name, xlim=(record.time[w][0], record.time[w][-1]))
    panels[0].set_ylabel("energy less its first value [J]")
    panels[0].legend(loc="best")
    return figure


def route_figures(record: Record, template: ScenarioRecord) -> dict[str, Figure]:
    """The figures by name; a run without transitions has none of their energies.

    Args:
        record: the robot's run.
        template: the same scenario on the robot's template.
    """
    figures = {"scenario": route_figure(record, template)}
    if _transitions(record):
        figures["transitions"] = transition_energies(record)
    return figures


@checked
def save_route_figures(record: Record, template: ScenarioRecord, folder: str | Path) -> list[Path]:
    """Write the :func:`route_figures` as PNG.

    Args:
        record: the robot's run.
        template: the same scenario on the robot's template.
        folder: where the files go; it must exist.

    Returns:
        The paths of the files.
    """
    paths = []
    for name, figure in route_figures(record, template).items():
        paths.append(save_figure(figure, Path(folder) / f"{name}.png"))
    return paths
