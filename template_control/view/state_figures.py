"""Figures of a walk's state: phase portrait, tracking errors, energies, states at the sections."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from template_control.arrays import Array, IntArray
from template_control.run.record import Record
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.maps.section import PADDED, VLO, Section, section_of
from template_control.view.style import (
    COM,
    LEFT,
    RIGHT,
    TEMPLATE,
    TRUNK,
    WINDOW,
    Look,
    as_text,
    finish,
    in_words,
    shade,
    upward,
)

_LOOK = Look()


def _sections(record: Record) -> list[Section]:
    """The kind of each section of the run."""
    kinds = [section_of(Event[name]) for name in record.sections]
    return [kinds[i] for i in record.section]


def _where(record: Record) -> str:
    """The run's section, such as "VLO", or that it has several."""
    return in_words(record.sections[0]) if len(record.sections) == 1 else "the sections"


def _energies_at(record: Record, sections: list[Section], states: Array) -> Array:
    """Energy of states (n, 3) at ``sections`` (n) [J]."""
    p = record.template
    return np.array([s.energy(p, z[: s.dimension]) for s, z in zip(sections, states, strict=True)])


def _broken(values: Array, rear: IntArray) -> Array:
    """NaN where the stance foot changes, so that no line joins the two steps."""
    out = values.copy()
    out[1:][np.diff(rear) != 0] = np.nan
    return out


def phase_portrait(record: Record, look: Look = _LOOK) -> Figure:
    """Height against its rate, and x from the rear stance foot against dx/dt, with every section.

    The whole run is pale, what the look shows is strong. The planner's state has its dx/dt from the
    angular momentum about the stance foot.
    """
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    upright, forward = figure.subplots(1, 2)
    samples = np.arange(len(record.time))
    toe = record.of_legs(record.foot)[samples, record.rear, 0]
    target, last = record.section_target[-1], in_words(_sections(record)[-1].name)
    rows = np.minimum(np.searchsorted(record.time, record.section_time), len(record.time) - 1)
    panels: tuple[tuple[Axes, int, Array, tuple[float, float]], ...] = (
        (upright, 1, np.zeros(len(toe)), (target[1], target[2])),
        (forward, 0, toe, (0.0, target[0])),
    )
    for axes, axis, origin, wanted in panels:
        for position, velocity, color, style, name in (
            (record.com, record.com_velocity, COM, "-", "robot"),
            (record.template_com, record.template_velocity, TEMPLATE, "--", "template"),
        ):
            across, rate = position[:, axis] - origin, velocity[:, axis]
            for w, strength in (
                (Look().rows(record), {"linewidth": 0.6, "alpha": 0.15}),
                (look.rows(record, WINDOW), {"linewidth": 1.2, "linestyle": style, "label": name}),
            ):
                axes.plot(_broken(across[w], record.rear[w]), rate[w], color=color, **strength)
        across = record.com[rows, axis] - origin[rows]
        axes.plot(
            across, record.com_velocity[rows, axis], "o", color=RIGHT, markersize=3, zorder=4,
            label=f"robot at {_where(record)}",
        )  # fmt: skip
        seen = record.section_state[:, 1 if axis else 0], record.section_state[:, 2]
        planned = seen if axis else (np.zeros(len(rows)), seen[0])
        if not (axis or _sections(record)[-1] is VLO):
            continue  # only at VLO it is known how far ahead of the foot the CoM is
        axes.plot(
            *planned, "o", color=RIGHT, fillstyle="none", markersize=4, zorder=4,
            label="state used by the planner",
        )  # fmt: skip
        axes.plot(*wanted, "*", color=LEFT, markersize=11, zorder=5, label=f"{last} of the gait")
    up = upward(record)
    upright.set(xlabel=f"{up} [m]", ylabel=f"d{up}/dt [m/s]")
    forward.set(xlabel="x from the rear stance foot [m]", ylabel="dx/dt [m/s]")
    for axes in (upright, forward):
        axes.locator_params(axis="x", nbins=6)
    title = f"{as_text(record.robot_name)}: phase portrait"
    return finish(figure, (upright, forward), title, look)


def tracking_errors(record: Record, look: Look = _LOOK) -> Figure:
    """CoM errors ahead and upward, template less robot, over the run."""
    w = look.rows(record)
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    error = 1e3 * record.com_error
    for column, (axes, axis, color) in enumerate(
        zip(panels, ("x", upward(record)), (LEFT, RIGHT), strict=True)
    ):
        values = error[:, column]
        axes.axhline(0.0, color="0.6", linewidth=0.8)
        axes.plot(record.time[w], values[w], color=color, linewidth=0.8)
        rms = np.sqrt(np.mean(values[w.start : w.stop] ** 2))
        axes.set_title(f"RMS {rms:.3g} mm", loc="right", fontsize=8)
        axes.set_ylabel(f"{axis}: template\nless robot [mm]")
        axes.margins(x=0)
        if np.any(record.push[w.start : w.stop]):
            pushed = record.push[w.start : w.stop] != 0.0
            axes.fill_between(
                record.time[w.start : w.stop], 0.0, 1.0, where=pushed.tolist(), label="push",
                transform=axes.get_xaxis_transform(), color=RIGHT, alpha=0.25, linewidth=0,
            )  # fmt: skip
    panels[-1].set_xlabel("time [s]")
    return finish(figure, panels, f"{as_text(record.robot_name)}: CoM error", look)


def leg_stiffness(record: Record) -> Array:
    """(T, 2) stiffness of the template's rear and front leg [N/m], NaN where it carries nothing.

    It is what the automaton gives to the leg in the node, and the planner chose for the step.
    """
    step = np.maximum(np.searchsorted(record.section_time, record.time, side="right") - 1, 0)
    found = np.full((len(record.time), 2), np.nan)
    for index in np.unique(record.node):
        on = record.node == index
        for leg, slot in enumerate(record.stiffness_slots[index]):
            if slot is not None:
                found[on, leg] = record.section_controls[step[on], slot]
    return found


def template_energies(record: Record) -> dict[str, Array]:
    """The template's energies along the run, each (T,) [J]: kinetic, gravity, spring, total.

    A leg's spring energy is F^2 / (2 k) of its recorded force.
    """
    p, stiffness = record.template, leg_stiffness(record)
    # A template that touches down before the robot's foot does has both legs loaded in the robot's
    # single stance: the front one then has the rear one's stiffness.
    stiffness = np.nan_to_num(np.where(np.isnan(stiffness), stiffness[:, :1], stiffness))
    force_squared = np.sum(record.template_force**2, axis=2)
    stored = np.divide(
        force_squared, 2.0 * stiffness, out=np.zeros_like(stiffness), where=stiffness > 0.0
    )
    kinetic = 0.5 * p.mass * np.sum(record.template_velocity**2, axis=1)
    gravity = p.mass * p.gravity * record.template_com[:, 1]
    spring = stored.sum(axis=1)
    return {
        "kinetic": kinetic,
        "gravity": gravity,
        "spring": spring,
        "total": kinetic + gravity + spring,
    }


def energies(record: Record, look: Look = _LOOK) -> Figure:
    """Energies of the robot's CoM and of the template."""
    w = look.rows(record, WINDOW)
    p = record.template
    template = template_energies(record)
    kinetic = 0.5 * p.mass * np.sum(record.com_velocity**2, axis=1)
    gravity = p.mass * p.gravity * record.com[:, 1]
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    time = record.time[w]
    for axes, robot, name, label in (
        (panels[0], kinetic, "kinetic", "kinetic [J]"),
        (panels[1], gravity, "gravity", "gravitational [J]"),
    ):
        axes.plot(time, robot[w], color=COM)
        axes.plot(time, template[name][w], "--", color=TEMPLATE, linewidth=1.0)
        axes.set_ylabel(label)
    lower = panels[2]
    lower.plot(time, (kinetic + gravity)[w], color=COM, label="robot's CoM")
    lower.plot(
        time, (template["total"] - template["spring"])[w], "--", color=TEMPLATE, linewidth=1.0,
        label="template",
    )  # fmt: skip
    lower.plot(time, template["total"][w], color=TEMPLATE, label="template with its springs")
    target = _energies_at(record, _sections(record)[-1:], record.section_target[-1:])[0]
    label = f"gait at {in_words(_sections(record)[-1].name)}"
    lower.axhline(target, color=LEFT, linewidth=1.2, linestyle=":", label=label)
    lower.set(xlabel="time [s]", ylabel="sum [J]")
    for axes in panels:
        shade(axes, record, w)
    return finish(figure, [lower], f"{as_text(record.robot_name)}: energies", look)


def section_states(record: Record, look: Look = _LOOK) -> Figure:
    """State and energy at each section against the target's and what the planner expected.

    dx/dt is from the angular momentum where a foot stands. The energy is E = m v^2 / 2 + m g y, at
    VLO with k0 (l0 - y)^2 / 2, as in Section IV-D.
    """
    state, expected = record.section_state, record.section_predicted[:-1]
    # What a stride was to end in is the target of the section where it began.
    target = np.vstack((record.section_target[:1], record.section_target[:-1]))
    sections = _sections(record)
    steps, p, up = np.arange(len(state)), record.template, upward(record)
    common: dict[str, Any] = {"linewidth": 0.9, "markersize": 3.5}
    energy = (
        _energies_at(record, sections, state),
        _energies_at(record, sections[1:], expected),
        _energies_at(record, sections, target),
    )
    shown = [
        ((state[:, 0], expected[:, 0], target[:, 0]), 0.002 * p.speed_unit, "dx/dt [m/s]"),
        ((state[:, 1], expected[:, 1], target[:, 1]), 0.001 * p.rest_length, f"{up} [m]"),
        ((state[:, 2], expected[:, 2], target[:, 2]), 0.002 * p.speed_unit, f"d{up}/dt [m/s]"),
        (energy, 0.001 * float(energy[2][0]), "energy [J]"),
    ]
    if all(section.dimension < PADDED for section in sections):
        del shown[2]  # zero at every apex
    figure = Figure(figsize=(9.0, 1.75 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), 1, sharex=True)
    for axes, ((values, predicted, wanted), least, name) in zip(panels, shown, strict=True):
        axes.step(
            steps, wanted, where="mid", color=LEFT, linewidth=1.0, linestyle=":", label="target"
        )
        axes.plot(
            steps[1:], predicted, "x", color="0.55", markersize=4, label="expected by the planner"
        )
        axes.plot(steps, values, "o-", color=COM, label="reached", **common)
        axes.set_ylabel(name)
        # A first step on its target is no reason to magnify rounding errors.
        axes.update_datalim([(0.0, wanted[0] - least), (0.0, wanted[0] + least)])
        axes.autoscale_view()
        axes.ticklabel_format(axis="y", useOffset=False)
    if np.any(record.section_accepted[:-1] != target[1:, 0]):
        panels[0].step(
            steps[1:], record.section_accepted[:-1], where="mid", color=TRUNK, linewidth=1.0,
            linestyle="--", label="accepted",
        )  # fmt: skip
    far = np.flatnonzero(~record.section_nominal)
    if len(far):
        panels[0].plot(
            far, state[far, 0], "s", color=RIGHT, fillstyle="none", markersize=7,
            label="step off the planner's own law",
        )  # fmt: skip
    panels[-1].set(xlabel="step", xlim=_steps(record, look))
    panels[-1].xaxis.get_major_locator().set_params(integer=True, min_n_ticks=1)
    title = f"{as_text(record.robot_name)}: at {_where(record)}"
    return finish(figure, panels, title, look)


def _steps(record: Record, look: Look) -> tuple[float, float]:
    """Least and greatest number of a step to show."""
    begin, *_, end = record.time[look.rows(record)].tolist()
    first, last = np.searchsorted(record.section_time, (begin - 1e-9, end + 1e-9)).tolist()
    return first - 0.5, max(last, first + 1) - 0.5
