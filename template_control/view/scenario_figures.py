"""Figures of a scenario: of the template alone (Fig. 10), and of a robot with its template."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.run.record import Record
from template_control.run.summary import STANDING
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.scenario.run import ScenarioRecord
from template_control.view.replay.playback import stances
from template_control.view.state_figures import leg_stiffness, template_energies
from template_control.view.style import (
    AS_TEMPLATE,
    COM,
    LEFT,
    RIGHT,
    TEMPLATE,
    TRANSITIONS,
    TRUNK,
    Draw,
    Look,
    as_text,
    finish,
    mark_limits,
    mark_transitions,
    panelled,
    save_figure,
    shade,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOOK = Look()
_WHOLE = slice(None)
ROUTE_FIGURES = ("scenario", "transitions")  # file names of a scenario's further figures
_AROUND = 1.2  # [s] shown on either side of a transition
_ENERGIES = ("forward kinetic", LEFT), ("gravitational", RIGHT), ("template's total", TEMPLATE)


def _mark_footholds(axes: Axes, x: Array) -> None:
    """Footholds along the lower edge of a panel over x [m]."""
    axes.plot(
        x, np.zeros(len(x)), "^", color=TRUNK, markersize=4, label="footholds", clip_on=False,
        transform=axes.get_xaxis_transform(),
    )  # fmt: skip


def scenario_figure(record: ScenarioRecord) -> Figure:
    """CoM path with footholds, stiffness, touchdown angle and speed (Fig. 10a, b)."""
    figure, panels = panelled(7.2, 4, gridspec_kw={"height_ratios": [1.0, 1.2, 0.9, 1.1]})
    path, stiffness, angle, speed = panels
    x, time = record.state[:, 0], record.time
    path.plot(x, record.state[:, 1], color=COM, linewidth=1.2, label="CoM")
    _mark_footholds(path, record.foothold[:, 1])
    path.set(xlabel="x [m]", ylabel="y [m]")
    loaded = np.where(record.stiffness > 0.0, record.stiffness / 1e3, np.nan)
    _plot_legs(stiffness, time, loaded, "leg stiffness\n[kN/m]")
    degrees = np.degrees(record.controls[:, Slot.TOUCHDOWN_ANGLE])
    angle.step(record.section_time[:-1], degrees, where="post", color=LEFT, linewidth=1.0)
    angle.set_ylabel("touchdown\nangle [deg]")
    speed.plot(time, record.state[:, 2], color=COM, linewidth=1.0, label="CoM")
    speed.plot(
        record.section_time[1:], record.wanted_speed, "--", color=TRUNK, linewidth=1.0,
        label="wanted at the next section",
    )  # fmt: skip
    speed.set(xlabel="time [s]", ylabel="dx/dt [m/s]")
    for axes in panels:
        shade(axes, record, _WHOLE, x if axes is path else None)
    name, map_name = as_text(record.metadata["name"]), record.metadata["map"]
    return finish(figure, panels, f"{name}, controllers on the {map_name} map", _LOOK)


def _plot_legs(axes: Axes, time: Array, values: Array, name: str) -> None:
    """Values (T, 2) of the template's rear and front leg."""
    for leg, (side, color) in enumerate((("rear", LEFT), ("front", RIGHT))):
        axes.plot(time, values[:, leg], color=color, linewidth=1.0, label=f"{side} leg")
    axes.set_ylabel(name)


def energy_figure(record: ScenarioRecord) -> Figure:
    """Energies around each transition (Fig. 10c, d)."""
    e = record.energies()
    energies = e["forward"], e["gravity"], e["total"]
    return _around_transitions(record, energies, as_text(record.metadata["name"]), _LOOK)


def _around_transitions(
    record: Record | ScenarioRecord, energies: tuple[Array, Array, Array], title: str, look: Look
) -> Figure:
    """Energies (T,) around each transition, less their first values."""
    spans = _transitions(record)
    figure, panels = panelled(3.8, 1, max(len(spans), 1))
    for axes, span in zip(panels, spans, strict=False):
        begin, end, name = span
        w = (record.time > begin - _AROUND) & (record.time < end + _AROUND)
        shade(axes, record, _WHOLE)
        for energy, (label, color) in zip(energies, _ENERGIES, strict=True):
            axes.plot(record.time[w], energy[w] - energy[w][0], color=color, label=label)
        mark_transitions(axes, [span])
        axes.set(xlabel="time [s]", xlim=(record.time[w][0], record.time[w][-1]))
        axes.set_title(name, fontsize=9)
    panels[0].set_ylabel("energy less its first value [J]")
    return finish(figure, panels, f"{title}: energies at transitions", look)


@checked
def save_scenario_figures(record: ScenarioRecord, folder: str | Path) -> list[Path]:
    """Write the figures as PNG, and return their paths; without transitions none of energies.

    Args:
        record: the scenario's run.
        folder: where the files go; it must exist.

    Raises:
        RecordError: if a file cannot be written.
    """
    figures = {"scenario": scenario_figure(record)}
    if _transitions(record):
        figures["energies"] = energy_figure(record)
    return [save_figure(figure, Path(folder) / f"{name}.png") for name, figure in figures.items()]


def route_figure(template: ScenarioRecord, record: Record, look: Look = _LOOK) -> Figure:
    """Speed, path of the CoM with footholds, leg stiffnesses and torques, with the template's.

    Where the robot stands first, its template begins when it has walked off.
    """
    figure, panels = panelled(9.6, 4)
    speed, path, stiffness, torque = panels
    kinds, begin, where = record.kinds_of_stride, 0.0, 0.0
    if first := next((i for i, kind in enumerate(kinds) if kind not in STANDING), 0):
        begin = float(record.section_time[first])
        where = float(np.interp(begin, record.time, record.com[:, 0]))
    w = look.rows(record)
    alone = {**AS_TEMPLATE, "linewidth": 0.8, "label": "the template alone"}
    speed.plot(record.time, record.com_velocity[:, 0], color=COM, linewidth=1.0, label="robot")
    speed.plot(begin + template.time, template.state[:, 2], **alone)
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
    path.plot(*record.com[w].T, color=COM, linewidth=1.0, label="robot")
    shown = begin + template.time <= record.time[w][-1]
    path.plot(where + template.state[shown, 0], template.state[shown, 1], **alone)
    left, *_, right = record.com[w, 0].tolist()
    spans = enumerate(stances(record))
    holds = np.array([record.foot[first, foot, 0] for foot, of in spans for first, _ in of])
    _mark_footholds(path, holds[(holds >= left) & (holds <= right)])
    path.set(xlabel="x [m]", ylabel="CoM y [m]", xlim=(left, right))
    name = "template's leg\nstiffness [kN/m]"
    _plot_legs(stiffness, record.time, 1e-3 * leg_stiffness(record), name)
    for joint, name in enumerate(record.joints):
        color = (LEFT, RIGHT, COM, TRUNK)[joint % 4]
        torque.plot(record.time, record.torque[:, joint], color=color, linewidth=0.6, label=name)
    mark_limits(torque, [float(limit) for limit in record.torque_limit], "N m")
    torque.set(xlabel="time [s]", ylabel="torque [N m]")
    for axes in (speed, stiffness, torque):
        shade(axes, record, _WHOLE)
        mark_transitions(axes, _transitions(record))
        axes.set_xlim(record.time[w][0], record.time[w][-1])
    return finish(figure, panels, f"{as_text(record.robot_name)} through its scenario", look)


def _transitions(record: Record | ScenarioRecord) -> list[tuple[float, float, str]]:
    """Begin and end of each transition that was completed [s], and its name."""
    times = record.section_time
    kinds = record.kinds_of_stride if isinstance(record, Record) else record.strides
    return [
        (float(times[i]), float(times[i + 1]), TRANSITIONS[kind])
        for i, kind in enumerate(kinds[: len(times) - 1])
        if kind in TRANSITIONS
    ]


def transition_energies(record: Record, look: Look = _LOOK) -> Figure:
    """Energies of the robot's CoM and of the template around each transition (Fig. 10c, d)."""
    p = record.template
    forward = 0.5 * p.mass * record.com_velocity[:, 0] ** 2
    gravity = p.mass * p.gravity * record.com[:, 1]
    energies = forward, gravity, template_energies(record)["total"]
    return _around_transitions(record, energies, as_text(record.robot_name), look)


def route_figures(record: Record, template: ScenarioRecord) -> dict[str, Draw]:
    """Figures of a robot and its template in a scenario; without transitions no energies."""
    figures: dict[str, Draw] = {"scenario": partial(route_figure, template)}
    return figures | ({"transitions": transition_energies} if _transitions(record) else {})
