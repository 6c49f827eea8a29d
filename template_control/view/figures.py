"""Figures of a recorded run, by name."""

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
    save_figure,
    shade,
    single_stance,
    window,
)

Array = NDArray[np.float64]


def joint_speeds(record: Record, seconds: float = WINDOW) -> Figure:
    """Joint speeds with their limits, single stance shaded.

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    names = record.joints
    limits = record.velocity_limit
    speed = record.v[:, -len(names) :]
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    panels = figure.subplots(len(record.legs), 1, sharex=True, squeeze=False)[:, 0]
    for axes, leg in zip(panels, record.legs, strict=True):
        for joint, color in zip(leg, (LEFT, RIGHT, COM, TRUNK), strict=False):
            axes.plot(record.time[w], speed[w, joint], color=color, label=names[joint])
            for sign in (-1.0, 1.0):
                axes.axhline(sign * limits[joint], color=color, linestyle=":", linewidth=0.9)
        shade(axes, record, w)
        axes.set_ylabel("speed [rad/s]")
        axes.legend(loc="upper right")
    panels[0].set_title(f"{as_text(record.robot_name)}: joint speeds, limits dotted")
    panels[-1].set_xlabel("time [s]")
    return figure


def apex_return(record: Record) -> Figure:
    """Each apex against the one before it, in speed and in height; the run has two at least.

    A gait that holds ends on the diagonal, at the target. A pair of points on either side of it
    is a limp: the state alternates from step to step.
    """
    apex = record.section == record.sections.index(Event.APEX.name)
    follows = apex[:-1] & apex[1:]
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    shown = zip(figure.subplots(1, 2), (0, 1), ("dx/dt", "y"), ("m/s", "m"), strict=True)
    for axes, column, name, unit in shown:
        z = record.section_state[:, column]
        before, after = z[:-1][follows], z[1:][follows]
        number = np.flatnonzero(follows)
        axes.plot(before, after, color="0.8", linewidth=0.7, zorder=1)
        points = axes.scatter(before, after, c=number, cmap="viridis", s=12, zorder=2)
        low, high = min(before.min(), after.min()), max(before.max(), after.max())
        axes.plot((low, high), (low, high), color=TEMPLATE, linewidth=0.8, linestyle=":")
        target = record.section_target[:-1, column][follows][-1]
        axes.plot(target, target, "*", color=RIGHT, markersize=11, zorder=3, label="last target")
        axes.set(xlabel=f"{name} at an apex [{unit}]", ylabel=f"{name} at the next [{unit}]")
        axes.legend(loc="upper left")
    figure.colorbar(points, label="step")
    figure.suptitle(f"{as_text(record.robot_name)}: from apex to apex")
    return figure


def turning(record: Record, seconds: float = WINDOW) -> Figure:
    """Pitch of the trunk, and angular momentum about the CoM, single stance shaded.

    In flight the angular momentum keeps its value: the trunk turns against the legs.

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(record.time[w], np.degrees(record.q[w, 2]), color=TRUNK)
    lower.plot(record.time[w], record.angular_momentum[w], color=COM)
    upper.set_ylabel("trunk pitch [deg]")
    lower.set_ylabel("angular momentum [N m s]")
    lower.set_xlabel("time [s]")
    for axes in (upper, lower):
        shade(axes, record, w)
    upper.set_title(f"{as_text(record.robot_name)}: trunk and angular momentum (forward positive)")
    return figure


_FEET = (("left foot", LEFT), ("right foot", RIGHT))


def footholds(record: FloatingRecord, foot: int) -> tuple[Array, Array]:
    """Where and when a foot stood.

    Args:
        record: the run.
        foot: its index.

    Returns:
        (n, 2) x and y in the world in the middle of each stance [m]; (n,) times [s].
    """
    weight = record.weight
    stands = record.space_force[:, foot, 2] > 0.02 * weight
    edges = np.flatnonzero(np.diff(np.concatenate(([0], stands.astype(np.int8), [0]))))
    spans = [(a, b) for a, b in edges.reshape(-1, 2) if record.time[b - 1] - record.time[a] > 0.05]
    middle = np.array([(a + b) // 2 for a, b in spans], dtype=np.int64)
    return record.space_foot[middle, foot, :2], record.time[middle]


def from_above(record: FloatingRecord, seconds: float = 4.0) -> Figure:
    """The CoM's path from above with the footholds: of the run, and of its end.

    Args:
        record: the run.
        seconds: how much of its end the lower panel shows [s].
    """
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    whole, end = figure.subplots(2, 1, height_ratios=(3, 2))
    for axes, w in ((whole, slice(None)), (end, window(record, seconds))):
        path, since = record.space_com[w], record.time[w][0]
        axes.plot(path[:, 0], path[:, 1], color=COM, linewidth=0.8, label="CoM")
        for foot, (name, color) in enumerate(_FEET):
            places, times = footholds(record, foot)
            shown = places[times >= since]
            axes.plot(shown[:, 0], shown[:, 1], ".", color=color, markersize=4.0, label=name)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_ylabel("y, to the left [m]")
    whole.set_title(f"{as_text(record.robot_name)}: path from above")
    whole.legend(loc="best")
    end.set_xlabel("x [m]")
    return figure


def lateral_portrait(record: FloatingRecord, seconds: float = 10.0) -> Figure:
    """Sway over its rate, from the foot that stands: left and right are mirror images.

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    axes = figure.subplots()
    sway, single, rear = record.sway[w], single_stance(record)[w], record.rear[w]
    for foot, (name, color) in enumerate(_FEET):
        shown = np.where((single & (rear == foot))[:, None], sway, np.nan)
        axes.plot(1e3 * shown[:, 0], shown[:, 1], color=color, linewidth=0.8, label=f"on {name}")
    axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axes.axvline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axes.set_xlabel("y of the CoM from the stance foot [mm]")
    axes.set_ylabel("dy/dt [m/s]")
    axes.set_title(f"{as_text(record.robot_name)}: sway in single stance")
    axes.legend(loc="best")
    return figure


def attitude(record: FloatingRecord, seconds: float = 4.0) -> Figure:
    """Roll, pitch and yaw of the trunk in the heading frame: over the run, and its end.

    Args:
        record: the run.
        seconds: how much of its end the right column shows [s].
    """
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    panels = figure.subplots(3, 2, sharex="col", width_ratios=(2, 1))
    w = window(record, seconds)
    for row, name in enumerate(("roll", "pitch", "yaw")):
        angle = record.attitude[:, row]
        _line(panels[row, 0], record.time, angle, f"{name} [rad]")
        _line(panels[row, 1], record.time[w], angle[w], "")
        shade(panels[row, 1], record, w)
    panels[0, 0].set_title(f"{as_text(record.robot_name)}: trunk in the heading frame")
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    return figure


def _line(axes: Axes, time: Array, angle: Array, name: str) -> None:
    axes.plot(time, angle, color=TRUNK, linewidth=0.8)
    axes.axhline(0.0, color=TEMPLATE, linewidth=0.5)
    axes.set_ylabel(name)


FREE_FIGURES: dict[str, Callable[[FloatingRecord], Figure]] = {
    "from_above": from_above,
    "lateral_portrait": lateral_portrait,
    "attitude": attitude,
}
"""What only a run in space has, by file name."""


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
    height = 2.0 * record.trunk_com
    for row in rows:
        q = record.q[row]
        hip = q[:2]
        top = hip + height * np.array([np.sin(q[2]), np.cos(q[2])])
        axes.plot(*np.stack((hip, top)).T, color=TRUNK, linewidth=1.2, alpha=0.55)
        for foot, leg in enumerate(record.legs):
            points = np.vstack((record.joint[row, leg], record.foot[row, foot]))
            axes.plot(*points.T, color=_LEGS[foot], linewidth=1.0, alpha=0.65)
    template = record.template_com[w]
    axes.plot(*template.T, color=TEMPLATE, linewidth=1.0, linestyle="--", label="template CoM")
    axes.plot(*record.com[rows].T, "o", color=COM, markersize=3.5, label="robot CoM")
    for foot, name in enumerate(("left leg", "right leg")):
        axes.plot([], [], color=_LEGS[foot], label=name)
    _ground(axes, record)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"{as_text(record.robot_name)}: stick diagram")
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
    upper.set_title(f"{as_text(record.robot_name)}: centre of mass (single stance shaded)")
    return figure


def joint_torques(record: Record, seconds: float = WINDOW) -> Figure:
    """Joint torques with their limits, single stance shaded (Fig. 13b).

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    names, limits = record.joints, record.torque_limit
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    panels = figure.subplots(len(record.legs), 1, sharex=True, squeeze=False)[:, 0]
    for axes, leg in zip(panels, record.legs, strict=True):
        for joint, color in zip(leg, (LEFT, RIGHT, COM, TRUNK), strict=False):
            axes.plot(record.time[w], record.torque[w, joint], color=color, label=names[joint])
            for sign in (-1.0, 1.0):
                axes.axhline(sign * limits[joint], color=color, linestyle=":", linewidth=0.9)
        shade(axes, record, w)
        axes.set_ylabel("torque [N m]")
        axes.legend(loc="upper right")
    panels[0].set_title(f"{as_text(record.robot_name)}: joint torques, limits dotted")
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
    panels[0].set_title(f"{as_text(record.robot_name)}: ground reaction forces")
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
    names = [record.sections[i] for i in record.section]
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
