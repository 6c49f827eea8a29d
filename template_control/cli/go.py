"""Report of a robot's way through a scenario, with its template's next to it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from template_control.cli.report import failures_text, joint_table, nearest_text
from template_control.run.record import Record
from template_control.run.summary import OTHERS, STRIDES, summarise
from template_control.slip.scenario.run import ScenarioRecord
from template_control.terminal import show, table

NO_STANDS = "the template cannot stand: it leaves out the stands, and begins in a walk"
_FROM_THE_RUN = (
    "robot", "fell", "fall_reason", "duration", "speed_error_rms", "accepted_speed",
    "nearest_speed_taken", "joint_torque", "joint_speed", "joint_angle", "saturated_share",
    "qp_failures", "qp_failed_share", "real_time_factor",
)  # fmt: skip


def summarise_route(record: Record, template: ScenarioRecord, path: str | None) -> dict[str, Any]:
    """Figures of a robot's way through a scenario, and of its template's, SI units.

    ``template`` is the record of the same scenario on the robot's template.
    """
    run = summarise(record, path)
    error = template.section_state[1:, 0] - template.wanted_speed
    return {
        **{name: run[name] for name in _FROM_THE_RUN},
        "completed": bool(record.arrived),
        "top_speed": float(record.section_state[:, 0].max()),
        "strides": {
            **{name: run["strides"].get(name, 0) for name in STRIDES.values()},
            **{name: run["strides"][name] for name in OTHERS.values() if name in run["strides"]},
        },
        "template": {
            "completed": template.completed,
            "top_speed": float(template.section_state[:, 0].max()),
            "speed_error_rms": float(np.sqrt(np.mean(error**2))) if error.size else None,
        },
        "record": path,
    }


def print_route_table(figures: dict[str, Any]) -> None:
    """The figures of :func:`summarise_route` as a table on standard output."""
    title, columns = f"{figures['robot']} and its template", ("", "robot", "template")
    show(table(title, columns, _rows(figures)), joint_table(figures))


def _rows(figures: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    other = figures["template"]
    words = {True: "as planned", False: "no"}
    ended = figures["fall_reason"] or words[figures["completed"]]
    yield "completed", ended, words[other["completed"]]
    for name, key in (
        ("top speed at a section", "top_speed"),
        ("speed less the wanted, RMS", "speed_error_rms"),
    ):
        yield name, *("" if x is None else f"{x:.3f} m/s" for x in (figures[key], other[key]))
    accepted = figures["accepted_speed"]
    if accepted["strides"]:
        yield "change of speed reduced", nearest_text(accepted)
        yield "speed less the accepted, RMS", f"{accepted['error_rms']:.3f} m/s"
    nearest = figures["nearest_speed_taken"]
    if nearest["strides"]:
        yield "nearest speed taken", nearest_text(nearest)
    yield "duration", f"{figures['duration']:.2f} s"
    for name, count in figures["strides"].items():
        yield f"strides, {name}", f"{count}"
    yield "ticks with a torque at its limit", f"{100 * figures['saturated_share']:.2f} %"
    yield "QP failures", failures_text(figures)
    yield "record", figures["record"] or "not saved"
