"""Figures of a recorded run, by name."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Count
from template_control.errors import ParameterError
from template_control.run.record import FloatingRecord, Record, SoleRecord
from template_control.slip.automaton.vocabulary import Event, Phase
from template_control.slip.scenario.run import ScenarioRecord
from template_control.view.replay.playback import stances
from template_control.view.scenario_figures import route_figures
from template_control.view.state_figures import (
    energies,
    phase_portrait,
    section_states,
    tracking_errors,
)
from template_control.view.style import (
    AS_TEMPLATE,
    COM,
    DPI,
    LEFT,
    RIGHT,
    SIDES,
    TEMPLATE,
    TRUNK,
    WINDOW,
    Draw,
    Format,
    Look,
    as_text,
    feet_shown,
    figure_style,
    finish,
    legs_shown,
    mark_limits,
    mark_peaks,
    over_time,
    panelled,
    save_figure,
    shade,
    upward,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOOK = Look()
_POSES = 0.06  # [s] from one pose of the stick diagram to the next
_MOST_POSES = 40


def stick_diagram(record: Record, look: Look = _LOOK) -> Figure:
    """The robot at regular times, with its CoM and the template's path (Fig. 12)."""
    w = look.rows(record, WINDOW)
    figure, (axes,) = panelled(3.6)
    time = record.time[w.start : w.stop]
    apart = max(_POSES, (time[-1] - time[0]) / _MOST_POSES)
    rows = np.searchsorted(time, np.arange(time[0], time[-1], apart)) + w.start
    height = 2.0 * record.trunk_com
    for row in rows:
        hip = record.joint[row, record.hinges[0][0]]
        pitch = record.attitude[row, 1] if isinstance(record, FloatingRecord) else record.q[row, 2]
        trunk = np.stack((hip, hip + height * np.array([np.sin(pitch), np.cos(pitch)])))
        if len(record.legs) > len(SIDES):
            trunk = record.joint[row, [leg[0] for leg in record.hinges]]
        axes.plot(*trunk.T, color=TRUNK, linewidth=1.2, alpha=0.55, label="trunk")
        legs = zip(record.hinges, feet_shown(record), record.foot[row], strict=True)
        for leg, (name, color), foot in legs:
            points = np.vstack((record.joint[row, list(leg)], foot))
            label = name.replace("foot", "leg")
            axes.plot(*points.T, color=color, linewidth=1.0, alpha=0.65, label=label)
    axes.plot(*record.template_com[w].T, **AS_TEMPLATE, label="template's CoM")
    axes.plot(*record.com[rows].T, "o", color=COM, markersize=3.5, label="robot's CoM")
    low, high = axes.get_xlim()
    axes.plot(*np.transpose(record.ground.line(low, high)), color="0.3", linewidth=0.8)
    axes.set(xlabel="x [m]", ylabel=f"{upward(record)} [m]", xlim=(low, high), aspect="equal")
    title = f"{as_text(record.robot_name)}, {time[0]:.2f} to {time[-1]:.2f} s"
    return finish(figure, [axes], title, look)


def com_tracking(record: Record, look: Look = _LOOK) -> Figure:
    """The CoM ahead and upward against the template (Fig. 13a)."""
    rows = {
        f"CoM {axis} [m]": (
            (record.com[:, i], {"color": COM, "label": "robot"}),
            (record.template_com[:, i], {**AS_TEMPLATE, "label": "template"}),
        )
        for i, axis in enumerate(("x", upward(record)))
    }
    drawn = over_time(record, look.rows(record, WINDOW), rows, 4.6)
    return finish(*drawn, f"{as_text(record.robot_name)}: centre of mass", look)


def _of_joints(record: Record, values: Array, limits: Array, what: str, look: Look) -> Figure:
    """Values (T, nu) of the joints, a panel a leg, with their ``limits``."""
    quantity, unit = what.split("|")
    names = [" / ".join(record.joints[i] for i in pair) for pair in zip(*record.legs, strict=True)]
    colors = (LEFT, RIGHT, COM, TRUNK)
    rows = {}
    for leg, (foot, _) in zip(record.legs, feet_shown(record), strict=True):
        side = foot.removesuffix("foot").rstrip(" _")
        rows[f"{side} leg\n{quantity} [{unit}]"] = [
            (values[:, joint], {"color": color, "linewidth": 0.9, "label": name})
            for joint, color, name in zip(leg, colors, names, strict=False)
        ]
    w, height = look.rows(record, WINDOW), 2.5 * len(rows)
    figure, panels = over_time(record, w, rows, height, sharey=True)
    for axes, leg in zip(panels, record.legs, strict=True):
        mark_limits(axes, limits[list(leg)].tolist(), unit)
    return finish(figure, panels, f"{as_text(record.robot_name)}: joint {quantity}s", look)


def joint_torques(record: Record, look: Look = _LOOK) -> Figure:
    """Joint torques with their limits (Fig. 13b)."""
    return _of_joints(record, record.torque, record.torque_limit, "torque|N m", look)


def joint_speeds(record: Record, look: Look = _LOOK) -> Figure:
    """Joint speeds with their limits."""
    speed = record.v[:, -len(record.joints) :]
    return _of_joints(record, speed, record.velocity_limit, "speed|rad/s", look)


def ground_forces(record: Record, look: Look = _LOOK) -> Figure:
    """Ground reaction forces of both template legs with the template's own; impacts by their size.

    A landing foot's first sample is its impulse over one physics step. The scale is that of the
    template's forces.
    """
    w = look.rows(record, WINDOW)
    figure, panels = panelled(5.0, 2, sharex=True)
    time = record.time[w]
    for axes, axis, way in zip(panels, (1, 0), ("vertical", "horizontal"), strict=True):
        template = record.template_force[w, :, axis]
        span = 1.25 * np.abs(template).max() + 1.0
        axes.set_ylim(-0.05 * span if axis == 1 else -span, span)
        for side, (name, color) in enumerate(legs_shown(record)):
            force = record.contact_force[w][:, list(record.groups[side]), axis].sum(axis=1)
            axes.plot(time, force, color=color, linewidth=0.9, label=name)
            leg = np.where(record.rear[w] == side, template[:, 0], template[:, 1])
            axes.plot(time, leg, "--", color=TEMPLATE, linewidth=0.9, label="template's legs")
            mark_peaks(axes, time, force, color)
        shade(axes, record, w)
        axes.set_ylabel(f"{way} force [N]")
    panels[-1].set_xlabel("time [s]")
    return finish(figure, panels, f"{as_text(record.robot_name)}: ground reaction forces", look)


def apex_return(record: Record, look: Look = _LOOK) -> Figure:
    """Each apex against the one before it, in speed and in height; the run has two at least.

    A gait that holds ends on the diagonal, at the target. A pair of points on either side of it is
    a limp: the state alternates from step to step.
    """
    apex = record.section == record.sections.index(Event.APEX.name)
    follows = apex[:-1] & apex[1:]
    figure, panels = panelled(4.6, 1, 2)
    columns = zip(record.section_state.T, record.section_target[:-1][follows][-1], strict=True)
    names = ("dx/dt", "m/s"), ("y", "m")
    for axes, (z, target), (name, unit) in zip(panels, columns, names, strict=False):
        before, after = z[:-1][follows], z[1:][follows]
        axes.plot(before, after, color="0.8", linewidth=0.7, zorder=1)
        number = np.flatnonzero(follows)
        points = axes.scatter(before, after, c=number, cmap="viridis", s=12, zorder=2)
        ends = min(before.min(), after.min()), max(before.max(), after.max())
        axes.plot(ends, ends, ":", color=TEMPLATE, linewidth=0.8, label="no change")
        axes.plot(target, target, "*", color=RIGHT, markersize=11, zorder=3, label="last target")
        axes.set(xlabel=f"{name} at an apex [{unit}]", ylabel=f"{name} at the next [{unit}]")
        axes.locator_params(axis="x", nbins=5)
    figure.colorbar(points, label="step")
    return finish(figure, panels, f"{as_text(record.robot_name)}: from apex to apex", look)


def turning(record: Record, look: Look = _LOOK) -> Figure:
    """Pitch of the trunk, and angular momentum about the CoM, which in flight keeps its value."""
    rows = {
        "trunk pitch [deg]": [(np.degrees(record.q[:, 2]), {"color": TRUNK, "linewidth": 0.9})],
        "angular momentum\n[N m s]": [(record.angular_momentum, {"color": COM, "linewidth": 0.9})],
    }
    drawn = over_time(record, look.rows(record, WINDOW), rows, 4.2, zero=True)
    name = as_text(record.robot_name)
    return finish(*drawn, f"{name}: trunk and angular momentum, forward positive", look)


def attitude(record: FloatingRecord, look: Look = _LOOK) -> Figure:
    """Roll, pitch and yaw of the trunk in the heading frame."""
    angles = zip(("roll", "pitch", "yaw"), np.degrees(record.attitude).T, strict=True)
    line = {"color": TRUNK, "linewidth": 0.9}
    rows = {f"{name} [deg]": [(values, line)] for name, values in angles}
    w, height = look.rows(record, 2.0 * WINDOW), 0.8 + 1.7 * len(rows)
    drawn = over_time(record, w, rows, height, zero=True)
    return finish(*drawn, f"{as_text(record.robot_name)}: trunk in the heading frame", look)


def footholds(record: FloatingRecord, foot: int) -> tuple[Array, Array]:
    """Footholds of one foot, in the middle of each stance.

    Args:
        record: the run.
        foot: its index.

    Returns:
        (n, 2) x and y in the world [m]; (n,) times [s].
    """
    middle = np.array([(a + b) // 2 for a, b in stances(record)[foot]], dtype=np.int64)
    return record.space_foot[middle, foot, :2], record.time[middle]


def from_above(record: FloatingRecord, look: Look = _LOOK) -> Figure:
    """The CoM's path from above with the footholds."""
    w = look.rows(record)
    path, time = record.space_com[w], record.time[w]
    forward, side = np.ptp(path[:, :2], axis=0) + 0.6 * record.template.rest_length
    # As high as a figure 9 inches wide needs for equal scales, and for its axes and legend.
    figure, (axes,) = panelled(float(np.clip(8.2 * side / forward + 1.1, 2.0, 8.0)))
    axes.plot(path[:, 0], path[:, 1], color=COM, linewidth=0.8, label="CoM")
    for foot, (name, color) in enumerate(feet_shown(record)):
        places, times = footholds(record, foot)
        seen = places[(times >= time[0]) & (times <= time[-1])]
        axes.plot(seen[:, 0], seen[:, 1], ".", color=color, markersize=4.0, label=name)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y, to the left [m]")
    return finish(figure, [axes], f"{as_text(record.robot_name)}: path from above", look)


def lateral_portrait(record: FloatingRecord, look: Look = _LOOK) -> Figure:
    """Sway over its rate in single stance, from the foot that stands: left and right mirrored."""
    w = look.rows(record)
    figure, (axes,) = panelled(5.0, width=6.0)
    sway, single, rear = record.sway[w], record.in_phase(Phase.SS)[w], record.rear[w]
    for foot, (name, color) in enumerate(legs_shown(record)):
        shown = np.where((single & (rear == foot))[:, None], sway, np.nan)
        axes.plot(1e3 * shown[:, 0], shown[:, 1], color=color, linewidth=0.8, label=f"on {name}")
    axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axes.axvline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axes.set(xlabel="y of the CoM from the stance foot [mm]", ylabel="dy/dt [m/s]")
    return finish(figure, [axes], f"{as_text(record.robot_name)}: sway in single stance", look)


def pressure(record: SoleRecord, look: Look = _LOOK) -> Figure:
    """The centre of pressure in each sole, seen from above; x forward is up in the figure."""
    from matplotlib.patches import Rectangle

    w = look.rows(record)
    figure, panels = panelled(6.0, 1, len(record.soles), 6.0, sharex=True, sharey=True)
    points, single = 1e3 * record.centre_of_pressure[w], record.in_phase(Phase.SS)[w]
    for foot, (name, color) in enumerate(feet_shown(record)):
        axes, (x, y, length, width) = panels[foot], 1e3 * record.soles[foot]
        corner = y - width, x - length
        axes.add_patch(Rectangle(corner, 2.0 * width, 2.0 * length, fill=False, color="0.3"))
        for part, phase, mark in ((single, "on one sole", color), (~single, "on both", "0.6")):
            seen = points[part, foot]
            axes.plot(seen[:, 1], seen[:, 0], ".", color=mark, markersize=2.0, label=phase)
        axes.plot(0.0, 0.0, "+", color="0.3", label="toe")
        axes.set(xlabel="y, to the left [mm]", title=name, aspect="equal")
    panels[0].invert_xaxis()  # left is to the left; the axes are shared
    panels[0].set_ylabel("x, forward [mm]")
    return finish(figure, panels, f"{as_text(record.robot_name)}: centre of pressure", look)


FIGURES: dict[str, Draw] = {
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

FREE_FIGURES: dict[str, Draw] = {
    "from_above": from_above,
    "lateral_portrait": lateral_portrait,
    "attitude": attitude,
}
"""Figures that only a floating-base run has, by file name."""

SOLE_FIGURES: dict[str, Draw] = {"pressure": pressure}
"""Figures that only a run on flat feet has, by file name."""

_PLANAR_ONLY = ("energies", "turning", "apex_return")


def figures_of(record: Record, template: ScenarioRecord | None = None) -> dict[str, Draw]:
    """The figures that have something to show of a run, and of its scenario on the template."""
    of_route = {} if template is None else route_figures(record, template)
    if isinstance(record, FloatingRecord):
        shared = {name: draw for name, draw in FIGURES.items() if name not in _PLANAR_ONLY}
        own = SOLE_FIGURES if isinstance(record, SoleRecord) else {}
        return {**shared, **FREE_FIGURES, **own, **of_route}
    names = [record.sections[i] for i in record.section]
    idle = () if (Event.APEX.name, Event.APEX.name) in pairwise(names) else ("apex_return",)
    return {name: draw for name, draw in FIGURES.items() if name not in idle} | of_route


def _chosen(
    record: Record, names: Sequence[str] | None, template: ScenarioRecord | None = None
) -> dict[str, Draw]:
    """Some figures of a run by name, by default all of :func:`figures_of`."""
    record.check_shown()
    known = figures_of(record, template)
    for name in names or ():
        if name not in known:
            raise ParameterError(
                f"there is no figure {name!r} of this run: give one of {', '.join(known)}"
            )
    return {name: known[name] for name in (known if names is None else names)}


@checked
def plot(record: Record, figure: str = "stick_diagram", look: Look | None = None) -> Figure:
    """Draw one of the :data:`FIGURES` of a run.

    ``plot(record, "com").savefig("com.png")`` writes it; a notebook shows it.

    Args:
        record: the run.
        figure: name of the figure.
        look: part of the run, and whether the title stands in the figure.

    Raises:
        ParameterError: if there is no such figure of this run.
        RecordError: if the run cannot be shown.
    """
    (draw,) = _chosen(record, [figure]).values()
    with figure_style():
        return draw(record, look or _LOOK)


@checked
def save_figures(
    record: Record,
    folder: str | Path,
    dpi: Count = DPI,
    figures: Sequence[str] | None = None,
    look: Look | None = None,
    file_format: Format = "png",
    template: ScenarioRecord | None = None,
) -> list[Path]:
    """Draw the figures of a run into files; returns their paths.

    Args:
        record: the run.
        folder: where the files go; it must exist.
        dpi: dots per inch of pictures made of dots.
        figures: names; None: those that :func:`figures_of` names.
        look: part of the run, and whether the titles stand in the figures.
        file_format: of the files.
        template: of a run through a scenario, the same one on the robot's template: there are
            figures of both then.

    Raises:
        ParameterError: if there is no such figure of this run.
        RecordError: if the folder cannot be written or the run cannot be shown.
    """
    with figure_style():
        return [
            save_figure(draw(record, look or _LOOK), Path(folder) / f"{name}.{file_format}", dpi)
            for name, draw in _chosen(record, figures, template).items()
        ]
