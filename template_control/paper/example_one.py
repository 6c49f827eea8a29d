"""Fig. 10: Example I, with controllers on each map (Section V-A)."""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.paper.reproduction import MAPS, Reproduction
from template_control.slip.automaton.vocabulary import MapKind, Slot, StrideKind
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario import example_one
from template_control.view.scenario_figures import energy_figure, scenario_figure

_TOP_SPEED = 5.0
_PAPER_STIFFNESS = 28.2e3


def summary(record: ScenarioRecord) -> dict[str, Any]:
    """Summary figures of a run of Example I, SI units."""
    kinds = np.array(record.strides)
    error = record.section_state[1:, 0] - record.wanted_speed
    running, walking = kinds == StrideKind.RUN, kinds == StrideKind.WALK
    phases = np.array([record.energy_phase(i) for i in range(len(kinds))])
    top = np.flatnonzero(running & (record.wanted_speed >= _TOP_SPEED))
    first = int(np.flatnonzero(kinds != StrideKind.WALK)[0])
    step = record.during(first - 1)
    walked = record.state[step.stop, 0] - record.state[step.start, 0]
    rwt = kinds.tolist().index(StrideKind.RUN_TO_WALK)
    return {
        "completed": record.completed,
        "strides": kinds.size,
        "walking_speed_before": float(walked / np.diff(record.section_time)[first - 1]),
        "speed_error_rms": float(np.sqrt(np.mean(error**2))),
        "speed_error_rms_running": float(np.sqrt(np.mean(error[running] ** 2))),
        "speed_error_max": float(np.max(np.abs(error))),
        "stiffness_at_5": float(np.mean(record.controls[top[-1], [Slot.K_SC, Slot.K_SD]])),
        "rwt_apex": record.section_state[rwt, :2].tolist(),
        "rwt_vlo": record.section_state[rwt + 1].tolist(),
        "walking_steps_after": int(np.argmax(kinds[::-1] != StrideKind.WALK)),
        "last_vlo": record.section_state[-1].tolist(),
        "energy_phase_walking": [float(phases[walking].min()), float(phases[walking].max())],
        "energy_phase_running": [float(phases[running].min()), float(phases[running].max())],
        "solve_seconds_median": float(np.median(record.solve_seconds)),
    }


# Name, the paper's number, and ours from :func:`_shown`.
_ROWS = (
    ("completed", "yes", "{ended}"),
    ("walking speed before [m/s]", "1.17", "{walking_speed_before:.3f}"),
    ("speed error RMS, all sections [m/s]", "", "{speed_error_rms:.2g}"),
    ("speed error RMS, running [m/s]", "", "{speed_error_rms_running:.2g}"),
    ("speed error max [m/s]", "", "{speed_error_max:.2g}"),
    ("leg stiffness at 5 m/s [kN/m]", f"{_PAPER_STIFFNESS / 1e3:g}", "{kilonewtons:.2f}"),
    ("apex before RWT", "1.754  0.9766", "{rwt_apex}"),
    ("VLO after RWT", "", "{rwt_vlo}"),
    ("walking steps after RWT", "", "{walking_steps_after}"),
    ("last VLO (target 1.1  0.98  0)", "1.085  0.9807  -0.018", "{last_vlo}"),
    ("energy phase, walking", "out", "{walking[0]:.2f} to {walking[1]:.2f}"),
    ("energy phase, running", "in", "{running[0]:+.2f} to {running[1]:+.2f}"),
)


def _shown(s: dict[str, Any]) -> dict[str, Any]:
    """A summary, with what the table has of it in other words or units."""
    states = ("rwt_apex", "rwt_vlo", "last_vlo")
    return {
        **s,
        **{name: "  ".join(f"{value:.4f}" for value in s[name]) for name in states},
        **{gait: s[f"energy_phase_{gait}"] for gait in ("walking", "running")},
        "ended": "yes" if s["completed"] else "no",
        "kilonewtons": s["stiffness_at_5"] / 1e3,
    }


def fig10() -> Reproduction:
    """Example I on the paper's map, and the tracking error with each map."""
    records = {kind: simulate_scenario(example_one(kind)) for kind in MAPS}
    data = {kind.name.lower(): summary(record) for kind, record in records.items()}
    shown = [_shown(s) for s in data.values()]
    record = records[MapKind.PAPER]
    return Reproduction(
        title="Fig. 10: Example I",
        columns=("", "paper", *(f"{kind.name.lower()} map" for kind in MAPS)),
        rows=[(name, paper, *(text.format(**s) for s in shown)) for name, paper, text in _ROWS],
        data={**data, "published": {"stiffness_at_5": _PAPER_STIFFNESS}},
        notes=(
            "The simulation is exact in every column; the columns differ in the map that the"
            " controllers compute with.",
            "Energy phase: correlation of forward kinetic and gravitational energy over a"
            " stride, -1 out of phase, +1 in phase.",
            "Walking starts at 1.125 m/s at VLO, which is 1.17 m/s on average as in Section"
            " V-A; Table IV's 1.1 m/s would be 1.13 m/s.",
        ),
        figures={"fig10": scenario_figure(record), "fig10_energies": energy_figure(record)},
    )
