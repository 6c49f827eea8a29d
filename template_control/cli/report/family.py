"""``template-control gaits --family``: make the walking gaits by speed, and show them."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table

from template_control import storage
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.gaits.family_search import (
    FamilyCost,
    Member,
    SearchEffort,
    family_data,
    search_family,
)
from template_control.storage import Files
from template_control.terminal import plain_console
from template_control.view.stability_figures import speed_family_figure
from template_control.view.style import save_figure

Array = NDArray[np.float64]
Chains = tuple[list[Member], ...]

_TABLE_STEP = 0.1  # [m/s]


def make_family(folder: Path | None, as_json: bool, effort: SearchEffort) -> int:
    """Search the family, write ``walking.json`` and its figure, print a table.

    Args:
        folder: for the files; None: none is written.
        as_json: print the family instead of the table.
        effort: how to search.

    Returns:
        The exit status.
    """
    weights, files = FamilyCost(), Files()
    chains = search_family(weights, effort, lambda text: print(text, file=sys.stderr))
    data = family_data(chains, weights)
    paths: list[Path] = []
    if folder is not None:
        text = json.dumps(data, indent=1) + "\n"
        figure = speed_family_figure(*_curves(chains))
        for written in (
            files.write(lambda: storage.write_text(folder / "walking.json", text)),
            files.write(lambda: save_figure(figure, folder / "by_speed.png")),
        ):
            paths += [] if written is None else [written]
    if as_json:
        print(json.dumps(data))
    else:
        _print(chains, paths)
    files.tell()
    return 0


def _curves(chains: Chains) -> tuple[dict[str, list[Array]], dict[str, dict[str, list[Array]]]]:
    gaits = [[member.gait for member in chain] for chain in chains]
    figures = [[member.figures for member in chain] for chain in chains]
    quantities = {
        "mean speed [m/s]": [np.array([g.mean_speed for g in chain]) for chain in gaits],
        "leg stiffness [kN/m]": [
            np.array([1e-3 * g.parameters.leg_stiffness for g in chain]) for chain in gaits
        ],
        "touchdown angle [deg]": [
            np.degrees([g.controls[Slot.TOUCHDOWN_ANGLE] for g in chain]) for chain in gaits
        ],
        "height at VLO [m]": [np.array([g.vlo[1] for g in chain]) for chain in gaits],
        "step length [m]": [np.array([g.step_length for g in chain]) for chain in gaits],
        "step duration [s]": [np.array([g.step_duration for g in chain]) for chain in gaits],
        "least singular value of B": [np.array([f.authority for f in chain]) for chain in figures],
        "share of double stance": [np.array([f.double_stance for f in chain]) for chain in figures],
    }
    pairs = {
        "largest |eigenvalue|": {
            "passive": [np.array([f.passive for f in chain]) for chain in figures],
            "three controls": [np.array([f.without for f in chain]) for chain in figures],
            "with push-off": [np.array([f.closed for f in chain]) for chain in figures],
        },
    }
    return quantities, pairs


def _print(chains: Chains, paths: list[Path]) -> None:
    table = Table(
        title="walking gaits by speed, for 80 kg and l0 = 1 m; largest eigenvalues", box=SIMPLE_HEAD
    )
    heads = ("m/s", "k kN/m", "alpha", "y m", "step m", "step s")
    for head in (*heads, "passive", "3 u", "4 u"):
        table.add_column(head, justify="right")
    wanted = 0.0
    for gait, f in (member for chain in chains for member in chain):
        if gait.mean_speed < wanted:
            continue
        wanted = _TABLE_STEP * (np.floor(gait.mean_speed / _TABLE_STEP) + 1.0)
        cells = (
            f"{gait.mean_speed:.3f}",
            f"{1e-3 * gait.parameters.leg_stiffness:.2f}",
            f"{np.degrees(gait.controls[Slot.TOUCHDOWN_ANGLE]):.2f}",
            f"{gait.vlo[1]:.4f}",
            f"{gait.step_length:.3f}",
            f"{gait.step_duration:.3f}",
            *(f"{size:.2f}" for size in (f.passive, f.without, f.closed)),
        )
        table.add_row(*cells)
    console = plain_console()
    console.print(table)
    for path in paths:
        console.print(f"written: {path}", highlight=False)
