"""Figures of a recorded run: stick diagram, CoM, joint torques, ground forces, and all others."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.run.record import FloatingRecord, Record
from template_control.slip.automaton.vocabulary import Event
from template_control.view.figure_file import save_figure
from template_control.view.free_figures import FREE_FIGURES
from template_control.view.running_figures import apex_return, joint_speeds, turning
from template_control.view.state_figures import (
    energies,
    phase_portrait,
    section_states,
    tracking_errors,
)
from template_control.view.style import (
    COM,
    LEFT,
    RIGHT,
    TEMPLATE,
    TRUNK,
    WINDOW,
    as_text,
    shade,
    window,
)

Array = NDArray[np.float64]

_LEGS = (LEFT, RIGHT)


def _ground(axes: Axes, record: Record) -> None:
    """A line along the ground that is in sight."""
    low, high = axes.get_xlim()
    axes.plot(*np.transpose(record.ground.line(low, high)), color="0.3", linewidth=0.8)
    axes.set_xlim(low, high)


def stick_diagram(record: Record, seconds: float = WINDOW, interval: float = 0.06) -> Figure:
    """The robot at regular times, with its CoM and the template's path (Fig. 12).

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
        interval: time from one drawn pose to the next [s].
    """
    w = window(record, seconds)
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots()
    time = record.time[w]
    rows = np.searchsorted(time, np.arange(time[0], time[-1], interval)) + (w.start or 0)
    height = 2.0 * record.metadata["trunk_com"]
    for row in rows:
        q = record.q[row]
        hip = q[:2]
        top = hip + height * np.array([np.sin(q[2]), np.cos(q[2])])
        axes.plot(*np.stack((hip, top)).T, color=TRUNK, linewidth=1.2, alpha=0.55)
        for foot, leg in enumerate(record.metadata["legs"]):
            points = np.vstack((record.joint[row, leg], record.foot[row, foot]))
            axes.plot(*points.T, color=_LEGS[foot], linewidth=1.0, alpha=0.65)
    template = record.template_com[w]
    axes.plot(*template.T, color=TEMPLATE, linewidth=1.0, linestyle="--", label="template CoM")
    axes.plot(*record.com[rows].T, "o", color=COM, markersize=3.5, label="robot CoM")
    for foot, name in enumerate(("left leg", "right leg")):
        axes.plot([], [], color=_LEGS[foot], label=name)
    _ground(axes, record)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"{as_text(record.metadata['robot'])}: stick diagram")
    axes.set_aspect("equal")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=4, frameon=False)
    return figure


def com_tracking(record: Record, seconds: float = WINDOW) -> Figure:
    """CoM x and y against the template, and the errors, single stance shaded (Fig. 13a).

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    for axes, axis, name in ((upper, 0, "x"), (middle, 1, "y")):
        axes.plot(record.time[w], record.com[w, axis], color=COM, label="robot")
        axes.plot(
            record.time[w],
            record.template_com[w, axis],
            color=TEMPLATE,
            linestyle="--",
            linewidth=1.0,
            label="template",
        )
        axes.set_ylabel(f"CoM {name} [m]")
    error = 1e3 * record.com_error[w]
    lower.plot(record.time[w], error[:, 0], color=LEFT, label="x")
    lower.plot(record.time[w], error[:, 1], color=RIGHT, label="y")
    lower.set(xlabel="time [s]", ylabel="template - robot [mm]")
    for axes in (upper, middle, lower):
        shade(axes, record, w)
        axes.legend(loc="upper right")
    upper.set_title(f"{as_text(record.metadata['robot'])}: centre of mass (single stance shaded)")
    return figure


def joint_torques(record: Record, seconds: float = WINDOW) -> Figure:
    """Joint torques with their limits, single stance shaded (Fig. 13b).

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    names, limits = record.metadata["joints"], record.metadata["torque_limit"]
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    panels = figure.subplots(len(record.metadata["legs"]), 1, sharex=True, squeeze=False)[:, 0]
    for axes, leg in zip(panels, record.metadata["legs"], strict=True):
        for joint, color in zip(leg, (LEFT, RIGHT, COM, TRUNK), strict=False):
            axes.plot(record.time[w], record.torque[w, joint], color=color, label=names[joint])
            for sign in (-1.0, 1.0):
                axes.axhline(sign * limits[joint], color=color, linestyle=":", linewidth=0.9)
        shade(axes, record, w)
        axes.set_ylabel("torque [N m]")
        axes.legend(loc="upper right")
    panels[0].set_title(f"{as_text(record.metadata['robot'])}: joint torques, limits dotted")
    panels[-1].set_xlabel("time [s]")
    return figure


def ground_forces(record: Record, seconds: float = WINDOW) -> Figure:
    """Ground reaction forces of either foot with the template's leg forces.

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    rear = record.rear[w]
    for axes, axis, name in zip(panels, (1, 0), ("vertical", "horizontal"), strict=True):
        template = record.template_force[w, :, axis]
        for foot, color in enumerate(_LEGS):
            label = "left foot" if foot == 0 else "right foot"
            axes.plot(record.time[w], record.contact_force[w, foot, axis], color=color, label=label)
            leg = np.where(rear == foot, template[:, 0], template[:, 1])
            axes.plot(
                record.time[w],
                leg,
                color=TEMPLATE,
                linestyle="--",
                linewidth=0.9,
                label="template" if foot == 0 else None,
            )
        # A landing foot's first sample is its impulse over one physics step; keep the scale.
        span = 1.25 * np.abs(template).max() + 1.0
        axes.set_ylim(-0.05 * span if axis == 1 else -span, span)
        shade(axes, record, w)
        axes.set_ylabel(f"{name} force [N]")
        axes.legend(loc="upper right")
    panels[0].set_title(f"{as_text(record.metadata['robot'])}: ground reaction forces")
    panels[-1].set_xlabel("time [s]")
    return figure


FIGURES: dict[str, Callable[[Record], Figure]] = {
    "stick_diagram": stick_diagram,
    "com": com_tracking,
    "torques": joint_torques,
    "joint_speeds": joint_speeds,
    "forces": ground_forces,
    "phase_portrait": phase_portrait,
    "tracking": tracking_errors,
    "energies": energies,
    "sections": section_states,
    "turning": turning,
    "apex_return": apex_return,
}
"""Every figure of a planar run, by file name."""

_OF_ANY = ("com", "torques", "joint_speeds", "forces", "phase_portrait", "tracking", "sections")


def figures_of(record: Record) -> dict[str, Callable[..., Figure]]:
    """The figures that have something to show of a run: apexes need two that follow each other.

    Args:
        record: the run.
    """
    if isinstance(record, FloatingRecord):
        return {**{name: FIGURES[name] for name in _OF_ANY}, **FREE_FIGURES}
    names = [record.metadata["sections"][i] for i in record.section]
    if (Event.APEX.name, Event.APEX.name) in pairwise(names):
        return FIGURES
    return {name: draw for name, draw in FIGURES.items() if draw is not apex_return}


@checked
def plot(record: Record, figure: str = "stick_diagram") -> Figure:
    """Draw one of the :data:`FIGURES` of a run.

    ``plot(record, "com").savefig("com.png")`` writes it; a notebook shows it.

    Args:
        record: the run.
        figure: name of the figure.

    Raises:
        ParameterError: if there is no such figure of this run.
        RecordError: if the run cannot be shown.
    """
    record.check_shown()
    known = figures_of(record)
    if figure not in known:
        raise ParameterError(
            f"there is no figure {figure!r} of this run: give one of {', '.join(known)}"
        )
    with _style():
        return known[figure](record)


def _style() -> AbstractContextManager[None]:
    return mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})


@checked
def save_figures(record: Record, folder: str | Path, dpi: int = 110) -> list[Path]:
    """Draw the :data:`FIGURES` of a run as PNG, those that :func:`figures_of` names.

    Args:
        record: the run.
        folder: where the files go; it must exist.
        dpi: dots per inch of the files.

    Returns:
        The paths of the files.

    Raises:
        RecordError: if the folder cannot be written or the run cannot be shown.
    """
    record.check_shown()
    paths = []
    with _style():
        for name, draw in figures_of(record).items():
            paths.append(save_figure(draw(record), Path(folder) / f"{name}.png", dpi))
    return paths
