"""``template-control slip``: the template goes through a scenario."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from template_control import view
from template_control.checks import option_types as values
from template_control.cli.report import NO_STANDS, output_folder
from template_control.run.summary import STRIDES, rms
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario import load_scenario
from template_control.storage import Files
from template_control.terminal import figures_table, plain_console, report

_MAPS = {kind.name.lower(): kind for kind in MapKind}


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
    values.add_folder(parser, "runs/slip", "folder for run.npz and figures")
    values.add_json(parser)


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
    title = f"{figures['scenario']}, {figures['map']} map"
    report(options.json, figures, figures_table(title, _rows(figures)))
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
        "strides": {name: counts.get(kind, 0) for kind, name in STRIDES.items()},
        "duration": float(record.section_time[-1]),
        "distance": float(record.state[-1, 0] - record.state[0, 0]) if len(record.time) else 0.0,
        "speed_error_rms": rms(error),
        "speed_error_max": float(np.max(np.abs(error))) if error.size else None,
        "not_reached": int(np.sum(~record.reached)),
        "last_section": record.section_state[-1].tolist(),
        "solve_seconds_median": float(np.median(record.solve_seconds)) if error.size else None,
    }


def _rows(figures: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "ended", "as planned" if figures["completed"] else figures["failure"]
    for name, count in figures["strides"].items():
        yield f"strides, {name}", f"{count}"
    yield "duration", f"{figures['duration']:.2f} s"
    yield "distance", f"{figures['distance']:.2f} m"
    rms, most = figures["speed_error_rms"], figures["speed_error_max"]
    if rms is not None:
        yield "speed error at sections, RMS / max", f"{rms:.3g} / {most:.3g} m/s"
        yield "controller, median", f"{1e3 * figures['solve_seconds_median']:.2f} ms"
    yield "targets not met on the map", f"{figures['not_reached']}"
    yield "last section dx/dt, y, dy/dt", "  ".join(f"{z:.4f}" for z in figures["last_section"])
    yield "record", figures["record"] or "not saved"
