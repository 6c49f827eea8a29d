"""Figures of what running adds: joint speeds, apexes from step to step, the trunk's turning."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from template_control.run.record import Record
from template_control.slip.automaton.vocabulary import Event
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


def joint_speeds(record: Record, seconds: float = WINDOW) -> Figure:
    """Joint speeds with their limits, single stance shaded.

    Args:
        record: the run.
        seconds: how much of its end is shown [s].
    """
    w = window(record, seconds)
    names = record.metadata["joints"]
    limits = record.metadata.get("velocity_limit", ())  # earlier versions did not keep it
    speed = record.v[:, -len(names) :]
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    panels = figure.subplots(len(record.metadata["legs"]), 1, sharex=True, squeeze=False)[:, 0]
    for axes, leg in zip(panels, record.metadata["legs"], strict=True):
        for joint, color in zip(leg, (LEFT, RIGHT, COM, TRUNK), strict=False):
            axes.plot(record.time[w], speed[w, joint], color=color, label=names[joint])
            for sign in (-1.0, 1.0) if limits else ():
                axes.axhline(sign * limits[joint], color=color, linestyle=":", linewidth=0.9)
        shade(axes, record, w)
        axes.set_ylabel("speed [rad/s]")
        axes.legend(loc="upper right")
    panels[0].set_title(f"{as_text(record.metadata['robot'])}: joint speeds, limits dotted")
    panels[-1].set_xlabel("time [s]")
    return figure


def apex_return(record: Record) -> Figure:
    """Each apex against the one before it, in speed and in height; the run has two at least.

    A gait that holds ends on the diagonal, at the target. A pair of points on either side of it
    is a limp: the state alternates from step to step.
    """
    apex = record.section == record.metadata["sections"].index(Event.APEX.name)
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
    figure.suptitle(f"{as_text(record.metadata['robot'])}: from apex to apex")
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
    upper.set_title(
        f"{as_text(record.metadata['robot'])}: trunk and angular momentum (forward positive)"
    )
    return figure
