"""Figures of Example II: VLO states by step, and torques about a liftoff (Figs. 12 and 13)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from template_control.run.record import Record
from template_control.view.style import COM, LEFT, RIGHT, TEMPLATE, TRUNK, shade

Array = NDArray[np.float64]

_COLORS = (TEMPLATE, RIGHT, LEFT, COM)


@dataclass(frozen=True)
class Liftoff:
    """The first liftoff of a run; joints are lifting hip, knee, standing hip, knee.

    Attributes:
        beta: direction from the lifting foot to the CoM [rad].
        load: vertical force on that foot in the last tick before [N].
        jump: (4,) |torque| difference across the liftoff's tick [N m].
        peak: (4,) largest |torque| from the touchdown before to the one after [N m].
    """

    beta: float
    load: float
    jump: Array
    peak: Array


def beginning(record: Record, seconds: float) -> Record:
    """Cut a run down to its first seconds.

    Args:
        record: the run.
        seconds: time at which the samples end [s].

    Returns:
        The run with fewer samples; its sections and its metadata are still all there.
    """
    count, end = len(record.time), int(np.searchsorted(record.time, seconds))
    cut = {
        f.name: getattr(record, f.name)[:end]
        for f in fields(record)
        if f.name != "metadata" and len(getattr(record, f.name)) == count
    }
    return replace(record, **cut)


def _entries(record: Record, node: str) -> NDArray[np.intp]:
    """Samples at which the run enters ``node`` of the automaton."""
    inside = record.node == record.metadata["nodes"].index(node)
    return np.flatnonzero(inside[1:] & ~inside[:-1]) + 1


def _step(record: Record, first: int = 0) -> tuple[int, int, int]:
    """Samples of the ``first`` touchdown, the liftoff after it, and the next touchdown."""
    begin, end = _entries(record, "DS_sc^w")[first:][:2]
    lifts = _entries(record, "SS_bv^w")
    return int(begin), int(lifts[lifts > begin][0]), int(end)


def _joints(record: Record, lifted: int) -> list[int]:
    """Joints of the leg that lifts off, then those of the one that stands."""
    standing = int(record.rear[lifted])
    legs = record.metadata["legs"]
    return [*legs[1 - standing], *legs[standing]]


def liftoff(record: Record) -> Liftoff:
    """Measure the first liftoff of a run that has two touchdowns and every sample."""
    begin, lifted, end = _step(record)
    joints = _joints(record, lifted)
    foot = 1 - int(record.rear[lifted])
    x, y = record.com[lifted] - [record.foot[lifted, foot, 0], 0.0]
    torque = record.torque[:, joints]
    return Liftoff(
        beta=float(np.arctan2(y, x)),
        load=float(record.contact_force[lifted, foot, 1]),
        jump=np.abs(torque[lifted] - torque[lifted - 1]),
        peak=np.abs(torque[begin:end]).max(axis=0),
    )


def states_figure(
    states: dict[tuple[str, str], Array],
    planners: tuple[str, ...],
    plants: tuple[str, ...],
    target: Array,
) -> Figure:
    """y, phi and E at VLO over the steps: a row of panels for each plant, a line for each planner.

    Args:
        states: (steps + 1, 3) y [m], phi [rad], E [J] of each walk, by (planner, plant); not every
            planner walks on every plant.
        planners, plants: names in the order they are drawn in.
        target: (3,) y, phi, E of the equilibrium.
    """
    figure = Figure(figsize=(9.5, 1.7 * len(plants) + 0.6), layout="constrained")
    panels = figure.subplots(len(plants), 3, sharex=True, sharey="col", squeeze=False)
    unit = np.array([1.0, 180.0 / np.pi, 1.0])
    spans = np.array(((0.96, 1.005), (-12.0, 6.0), (819.0, 832.0)))
    for row, plant in zip(panels, plants, strict=True):
        for j, axes in enumerate(row):
            axes.axhline(target[j] * unit[j], color="0.75", linewidth=2.5, zorder=0)
            for planner, color in zip(planners, _COLORS, strict=True):
                if (planner, plant) not in states:
                    continue
                z = states[planner, plant] * unit
                # A fall is drawn as far as it is on the picture.
                off = np.flatnonzero(np.any((z < spans[:, 0]) | (z > spans[:, 1]), axis=1))
                end = int(off[0]) if off.size else len(z)
                axes.plot(z[:end, j], color=color, linewidth=1.0, label=planner)
                if off.size:
                    axes.plot(end - 1, z[end - 1, j], "x", color=color, markersize=6)
            axes.set_ylim(*spans[j])
        row[0].set_ylabel(f"{plant}\n")
    for axes, name in zip(panels[0], ("y [m]", "phi [deg], downward", "E [J]"), strict=True):
        axes.set_title(name, fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel("step")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(planners), frameon=False)
    return figure


def liftoff_figure(settled: Record, records: dict[str, Record]) -> Figure:
    """CoM of a settled walk, and torques of a first step with each liftoff rule.

    A step is shown from touchdown to touchdown.

    Args:
        settled: a run that ends on its gait; one of its last steps is shown.
        records: at most five runs by the name of their liftoff rule, every sample kept.
    """
    figure = Figure(figsize=(9.0, 2.2 * (len(records) + 1)), layout="constrained")
    panels = figure.subplots(len(records) + 1, 1)
    begin, _, end = _step(settled, len(settled.section_time) - 3)
    w = slice(begin, end)
    com, template = settled.com[w], settled.template_com[w]
    panels[0].plot(*com.T, color=COM, linewidth=2.0, label="robot")
    panels[0].plot(*template.T, color=TEMPLATE, linestyle="--", linewidth=1.0, label="template")
    panels[0].set(xlabel="CoM x [m]", ylabel="CoM y [m]", title="(a) settled walk")
    panels[0].legend(loc="upper left", frameon=False)
    names = ("lifting hip", "lifting knee", "standing hip", "standing knee")
    for axes, (rule, record), letter in zip(panels[1:], records.items(), "bcdef", strict=False):
        begin, lifted, end = _step(record)
        w = slice(begin, end)
        for joint, name, color in zip(
            _joints(record, lifted), names, (LEFT, COM, RIGHT, TRUNK), strict=True
        ):
            axes.plot(
                record.time[w], record.torque[w, joint], color=color, linewidth=1.2, label=name
            )
        shade(axes, record, w)
        axes.set(ylabel="torque [N m]", ylim=(-360, 360), title=f"({letter}) liftoff: {rule}")
    panels[1].legend(loc="upper right", ncols=4, frameon=False, fontsize=8)
    panels[-1].set_xlabel("time [s], single stance shaded")
    return figure
