"""``template-control slip``: the template goes through a scenario."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from template_control import view
from template_control.checks import option_types as values
from template_control.cli.go import NO_STANDS
from template_control.cli.report import output_folder
from template_control.slip.automaton.vocabulary import MapKind, StrideKind
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario import load_scenario
from template_control.storage import Files
from template_control.terminal import Table, plain_console

_MAPS = {kind.name.lower(): kind for kind in MapKind}
_NAMES = {
    StrideKind.WALK: "walking",
    StrideKind.WALK_TO_RUN: "walk to run",
    StrideKind.RUN: "running",
    StrideKind.RUN_TO_WALK: "run to walk",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Simulate the bipedal SLIP through a scenario (TOML): a speed profile with gait"
        " switches. Ends with a table and a folder with the run and figures. Exit status:"
        " 0, 1 if a stride failed, 2 for bad input."
    )
    parser.formatter_class = argparse.ArgumentDefaultsHelpFormatter
    parser.add_argument(
        "scenario", type=values.path, help="the scenario, such as examples/example_one.toml"
    )
    parser.add_argument(
        "--map",
        choices=tuple(_MAPS),
        help="return map the controllers compute with, instead of the scenario's",
    )
    parser.add_argument(
        "--output",
        type=values.path,
        default=Path("runs/slip"),
        help="folder for run.npz and figures",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the table as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")


def run(options: argparse.Namespace) -> int:
    """Simulate; returns 0, or 1 if a stride failed."""
    scenario = load_scenario(options.scenario)
    if options.map is not None:
        scenario = replace(scenario, map_kind=_MAPS[options.map])
    if scenario.stands:
        plain_console(stderr=True).print(NO_STANDS)
    files = Files()
    with output_folder(options.output) as folder:
        with plain_console(stderr=True).status("simulating") as status:
            record = simulate_scenario(
                scenario, lambda now: status.update(f"simulating, {now:.1f} s")
            )
        path = files.write(lambda: record.save(folder / "run.npz"))
        if not options.no_figures:
            files.write(lambda: view.save_scenario_figures(record, folder))
    figures = {**summarise_scenario(record), "record": None if path is None else str(path)}
    if options.json:
        print(json.dumps(figures))
    else:
        _print(figures)
    files.raise_pending()
    return 0 if record.completed else 1


def summarise_scenario(record: ScenarioRecord) -> dict[str, Any]:
    """Figures of a scenario, SI units."""
    error = record.section_state[1:, 0] - record.wanted_speed
    counts = Counter(record.strides)
    return {
        "scenario": record.metadata["name"],
        "map": record.metadata["map"],
        "completed": record.completed,
        "failure": record.metadata["failure"] or None,
        "strides": {name: counts.get(kind, 0) for kind, name in _NAMES.items()},
        "duration": float(record.section_time[-1]),
        "distance": float(record.state[-1, 0] - record.state[0, 0]) if len(record.time) else 0.0,
        "speed_error_rms": float(np.sqrt(np.mean(error**2))) if error.size else None,
        "speed_error_max": float(np.max(np.abs(error))) if error.size else None,
        "not_reached": int(np.sum(~record.reached)),
        "last_section": record.section_state[-1].tolist(),
        "solve_seconds_median": float(np.median(record.solve_seconds)) if error.size else None,
    }


def _print(figures: dict[str, Any]) -> None:
    table = Table(title=f"{figures['scenario']}, {figures['map']} map", show_header=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_row("ended", "as planned" if figures["completed"] else figures["failure"])
    for name, count in figures["strides"].items():
        table.add_row(f"strides, {name}", f"{count}")
    table.add_row("duration", f"{figures['duration']:.2f} s")
    table.add_row("distance", f"{figures['distance']:.2f} m")
    if figures["speed_error_rms"] is not None:
        table.add_row(
            "speed error at sections, RMS / max",
            f"{figures['speed_error_rms']:.3g} / {figures['speed_error_max']:.3g} m/s",
        )
        table.add_row("controller, median", f"{1e3 * figures['solve_seconds_median']:.2f} ms")
    table.add_row("targets not met on the map", f"{figures['not_reached']}")
    table.add_row(
        "last section dx/dt, y, dy/dt", "  ".join(f"{z:.4f}" for z in figures["last_section"])
    )
    table.add_row("record", figures["record"] or "not saved")
    plain_console().print(table)
