"""Figures of a walk's state: phase portrait, tracking errors, energies, states at the sections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from template_control.arrays import Array
from template_control.run.record import Record
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.maps.section import PADDED, VLO, Section, section_of
from template_control.view.style import (
    AS_TEMPLATE,
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
    over_time,
    panelled,
    upward,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOOK = Look()


def _sections(record: Record) -> list[Section]:
    """The kind of each section of the run."""
    return [section_of(Event[record.sections[i]]) for i in record.section]


def _where(record: Record) -> str:
    """The run's section, such as "VLO", or that it has several."""
    return in_words(record.sections[0]) if len(record.sections) == 1 else "the sections"


def _energies_at(record: Record, sections: list[Section], states: Array) -> Array:
    """Energy of states (n, 3) at ``sections`` (n) [J]."""
    p = record.template
    return np.array([s.energy(p, z[: s.dimension]) for s, z in zip(sections, states, strict=True)])


def phase_portrait(record: Record, look: Look = _LOOK) -> Figure:
    """Height against its rate, and x from the rear stance foot against dx/dt, with every section.

    The whole run is pale, what the look shows is strong. The planner's state has its dx/dt from the
    angular momentum about the stance foot.
    """
    figure, (upright, forward) = panelled(4.4, 1, 2)
    toe = record.of_legs(record.foot)[np.arange(len(record.time)), record.rear, 0]
    last = _sections(record)[-1]
    rows = np.minimum(np.searchsorted(record.time, record.section_time), len(record.time) - 1)
    # x from the foot, which is zero at VLO, and the state: dx/dt, y, dy/dt.
    planned = np.insert(record.section_state, 0, 0.0, axis=1).T
    wanted = np.insert(record.section_target[-1], 0, 0.0)
    for axes, axis, origin in ((upright, 1, np.zeros(len(toe))), (forward, 0, toe)):
        shown = slice(2 * axis, 2 * axis + 2)
        axes.locator_params(axis="x", nbins=6)
        for position, velocity, color, style, name in (
            (record.com, record.com_velocity, COM, "-", "robot"),
            (record.template_com, record.template_velocity, TEMPLATE, "--", "template"),
        ):
            across, rate = position[:, axis] - origin, velocity[:, axis]
            for w, strength in (
                (Look().rows(record), {"linewidth": 0.6, "alpha": 0.15}),
                (look.rows(record, WINDOW), {"linewidth": 1.2, "linestyle": style, "label": name}),
            ):
                rear = record.rear[w]
                joins = np.diff(rear, prepend=rear[0]) != 0  # two steps, that no line is to join
                axes.plot(np.where(joins, np.nan, across[w]), rate[w], color=color, **strength)
        axes.plot(
            record.com[rows, axis] - origin[rows], record.com_velocity[rows, axis], "o",
            color=RIGHT, markersize=3, zorder=4, label=f"robot at {_where(record)}",
        )  # fmt: skip
        if not (axis or last is VLO):
            continue  # only at VLO it is known how far ahead of the foot the CoM is
        axes.plot(
            *planned[shown], "o", color=RIGHT, fillstyle="none", markersize=4, zorder=4,
            label="state used by the planner",
        )  # fmt: skip
        label = f"{in_words(last.name)} of the gait"
        axes.plot(*wanted[shown], "*", color=LEFT, markersize=11, zorder=5, label=label)
    up = upward(record)
    upright.set(xlabel=f"{up} [m]", ylabel=f"d{up}/dt [m/s]")
    forward.set(xlabel="x from the rear stance foot [m]", ylabel="dx/dt [m/s]")
    title = f"{as_text(record.robot_name)}: phase portrait"
    return finish(figure, (upright, forward), title, look)


def tracking_errors(record: Record, look: Look = _LOOK) -> Figure:
    """CoM errors ahead and upward, template less robot, over the run."""
    w = look.rows(record)
    whole = slice(w.start, w.stop)
    figure, panels = panelled(4.2, 2, sharex=True)
    names = zip(("x", upward(record)), (LEFT, RIGHT), strict=True)
    for axes, (axis, color), values in zip(panels, names, 1e3 * record.com_error.T, strict=True):
        axes.axhline(0.0, color="0.6", linewidth=0.8)
        axes.plot(record.time[w], values[w], color=color, linewidth=0.8)
        rms = np.sqrt(np.mean(values[whole] ** 2))
        axes.set_title(f"RMS {rms:.3g} mm", loc="right", fontsize=8)
        axes.set_ylabel(f"{axis}: template\nless robot [mm]")
        axes.margins(x=0)
        if np.any(record.push[whole]):
            axes.fill_between(
                record.time[whole], 0.0, 1.0, where=(record.push[whole] != 0.0).tolist(),
                label="push", transform=axes.get_xaxis_transform(), color=RIGHT, alpha=0.25,
                linewidth=0,
            )  # fmt: skip
    panels[-1].set_xlabel("time [s]")
    return finish(figure, panels, f"{as_text(record.robot_name)}: CoM error", look)


def leg_stiffness(record: Record) -> Array:
    """(T, 2) stiffness of the template's rear and front leg [N/m], NaN where it carries nothing."""
    step = np.maximum(np.searchsorted(record.section_time, record.time, side="right") - 1, 0)
    found = np.full((len(record.time), 2), np.nan)
    for index in np.unique(record.node):
        on = record.node == index
        for leg, slot in enumerate(record.stiffness_slots[index]):
            if slot is not None:
                found[on, leg] = record.section_controls[step[on], slot]
    return found


def template_energies(record: Record) -> dict[str, Array]:
    """The template's energies along the run, each (T,) [J]; a leg's spring has F^2 / (2 k)."""
    p, stiffness = record.template, leg_stiffness(record)
    # A template that touches down before the robot's foot does has both legs loaded in the robot's
    # single stance: the front one then has the rear one's stiffness.
    stiffness = np.nan_to_num(np.where(np.isnan(stiffness), stiffness[:, :1], stiffness))
    force_squared, none = np.sum(record.template_force**2, axis=2), np.zeros_like(stiffness)
    stored = np.divide(force_squared, 2.0 * stiffness, out=none, where=stiffness > 0.0)
    kinetic = 0.5 * p.mass * np.sum(record.template_velocity**2, axis=1)
    gravity, spring = p.mass * p.gravity * record.template_com[:, 1], stored.sum(axis=1)
    total = kinetic + gravity + spring
    return {"kinetic": kinetic, "gravity": gravity, "spring": spring, "total": total}


def energies(record: Record, look: Look = _LOOK) -> Figure:
    """Energies of the robot's CoM and of the template."""
    p, template, robot = record.template, template_energies(record), {"color": COM}
    kinetic = 0.5 * p.mass * np.sum(record.com_velocity**2, axis=1)
    gravity = p.mass * p.gravity * record.com[:, 1]
    rows = {
        "kinetic [J]": ((kinetic, robot), (template["kinetic"], AS_TEMPLATE)),
        "gravitational [J]": ((gravity, robot), (template["gravity"], AS_TEMPLATE)),
        "sum [J]": (
            (kinetic + gravity, {**robot, "label": "robot's CoM"}),
            (template["total"] - template["spring"], {**AS_TEMPLATE, "label": "template"}),
            (template["total"], {"color": TEMPLATE, "label": "template with its springs"}),
        ),
    }
    figure, panels = over_time(record, look.rows(record, WINDOW), rows, 6.4)
    target = _energies_at(record, _sections(record)[-1:], record.section_target[-1:])[0]
    label = f"gait at {in_words(_sections(record)[-1].name)}"
    panels[-1].axhline(target, color=LEFT, linewidth=1.2, linestyle=":", label=label)
    return finish(figure, panels, f"{as_text(record.robot_name)}: energies", look)


def section_states(record: Record, look: Look = _LOOK) -> Figure:
    """State and energy at each section against the target's and what the planner expected.

    dx/dt is from the angular momentum where a foot stands. The energy is E = m v^2 / 2 + m g y, at
    VLO with k0 (l0 - y)^2 / 2, as in Section IV-D.
    """
    state, expected = record.section_state, record.section_predicted[:-1]
    # What a stride was to end in is the target of the section where it began.
    target = np.vstack((record.section_target[:1], record.section_target[:-1]))
    sections, up, p = _sections(record), upward(record), record.template
    columns = [
        [*values.T, _energies_at(record, of, values)]
        for of, values in ((sections, state), (sections[1:], expected), (sections, target))
    ]
    speed, length, energy = p.speed_unit, p.rest_length, float(columns[2][3][0])
    least = 0.002 * speed, 0.001 * length, 0.002 * speed, 0.001 * energy
    names = "dx/dt [m/s]", f"{up} [m]", f"d{up}/dt [m/s]", "energy [J]"
    shown = list(zip(*columns, least, names, strict=True))
    if all(section.dimension < PADDED for section in sections):
        del shown[2]  # zero at every apex
    steps = np.arange(len(state))
    figure, panels = panelled(1.75 * len(shown), len(shown), sharex=True)
    for axes, (values, predicted, wanted, near, name) in zip(panels, shown, strict=True):
        axes.step(steps, wanted, ":", where="mid", color=LEFT, linewidth=1.0, label="target")
        axes.plot(
            steps[1:], predicted, "x", color="0.55", markersize=4, label="expected by the planner"
        )
        axes.plot(steps, values, "o-", color=COM, label="reached", linewidth=0.9, markersize=3.5)
        axes.set_ylabel(name)
        # A first step on its target is no reason to magnify rounding errors.
        axes.update_datalim([(0.0, wanted[0] - near), (0.0, wanted[0] + near)])
        axes.autoscale_view()
        axes.ticklabel_format(axis="y", useOffset=False)
    accepted, line = record.section_accepted[:-1], {"color": TRUNK, "linewidth": 1.0}
    if np.any(accepted != target[1:, 0]):
        panels[0].step(steps[1:], accepted, "--", where="mid", label="accepted", **line)
    far = np.flatnonzero(~record.section_nominal)
    if len(far):
        panels[0].plot(
            far, state[far, 0], "s", color=RIGHT, fillstyle="none", markersize=7,
            label="step off the planner's own law",
        )  # fmt: skip
    begin, *_, end = record.time[look.rows(record)].tolist()
    first, last = np.searchsorted(record.section_time, (begin - 1e-9, end + 1e-9)).tolist()
    panels[-1].set(xlabel="step", xlim=(first - 0.5, max(last, first + 1) - 0.5))
    panels[-1].xaxis.get_major_locator().set_params(integer=True, min_n_ticks=1)
    title = f"{as_text(record.robot_name)}: at {_where(record)}"
    return finish(figure, panels, title, look)
