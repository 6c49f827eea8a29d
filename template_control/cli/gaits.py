"""``template-control gaits``: a branch of periodic gaits, its stability and special points."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from template_control.cli.output import writable
from template_control.errors import ParameterError
from template_control.slip.gait_branch import QUANTITIES, BranchPoint, Family
from template_control.slip.parameters import SlipParameters
from template_control.view.stability_figures import UNITS, branch_figure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Defaults:
    start: dict[str, float]
    fixed: dict[str, float]
    limits: tuple[float, float]


_DEFAULTS = {
    "walk": _Defaults(
        {"speed": 1.148, "height": 0.9818, "angle": 70.0, "stiffness": 16.5e3},
        {"height": 0.9818, "stiffness": 16.5e3},
        (815.0, 830.0),
    ),
    "run": _Defaults(
        {"speed": 4.9, "height": 0.947, "angle": 68.0, "stiffness": 20e3},
        {"angle": 68.0, "stiffness": 20e3},
        (1500.0, 2500.0),
    ),
}
_COLUMNS = {
    "energy": "E [J]",
    "angle": "alpha [deg]",
    "stiffness": "k [kN/m]",
    "height": "y [m]",
    "speed": "dx/dt [m/s]",
}
_STRIDES = {"walk": "w", "run": "r"}
_TABLE_ROWS = 14


def add_parser(commands: Any) -> None:
    """Add the command's options."""
    parser = commands.add_parser(
        "gaits",
        help="follow a branch of periodic gaits and tell its stability",
        description=(
            "Follow a branch of passive periodic gaits of the template by pseudo-arclength, past"
            " its folds: two quantities are held fixed, the others vary. Quantities:"
            f" {', '.join(QUANTITIES)} (J, degrees, N/m, m, m/s at VLO or apex). Without options:"
            " the walking gaits of Section IV-D."
        ),
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--gait", choices=tuple(_STRIDES), default="walk")
    parser.add_argument(
        "--fix",
        action="append",
        metavar="QUANTITY=VALUE",
        help="hold a quantity fixed; give two",
    )
    parser.add_argument(
        "--start",
        action="append",
        metavar="QUANTITY=VALUE",
        help="where to look for the first gait, instead of the defaults",
    )
    parser.add_argument("--over", choices=QUANTITIES, default="energy", help="quantity to go over")
    parser.add_argument("--limits", nargs=2, type=float, metavar=("LOW", "HIGH"), help="of --over")
    parser.add_argument("--step", type=float, default=0.004, help="largest arclength step")
    parser.add_argument(
        "--output", type=Path, default=Path("runs/gaits"), help="folder for the figure"
    )
    parser.add_argument(
        "--json", action="store_true", help="print the branch as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw the figure")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Follow the branch and report it."""
    defaults = _DEFAULTS[options.gait]
    fixed = _quantities("--fix", options.fix) or defaults.fixed
    start = {**defaults.start, **fixed, **_quantities("--start", options.start)}
    limits = (options.limits[0], options.limits[1]) if options.limits else defaults.limits
    if options.limits is None and options.over != "energy":
        raise ParameterError(f"--over {options.over} needs --limits: give its range")
    if not limits[0] < limits[1]:
        raise ParameterError(f"--limits are {limits[0]:g} and {limits[1]:g}: give low, then high")
    if not (math.isfinite(options.step) and 0.0 < options.step <= 0.5):
        raise ParameterError(f"--step is {options.step:g}: give a number from 0 to 0.5")
    folder = None if options.no_figures else writable(options.output)
    family = Family(
        SlipParameters(), _STRIDES[options.gait], {k: _si(k, v) for k, v in fixed.items()}
    )
    guess = [start["speed"], start["height"], 0.0][: family.n]
    x = np.array([*guess, np.radians(start["angle"]), start["stiffness"]])
    low, high = (_si(options.over, v) for v in limits)
    points = family.trace(x, options.over, (low, high), step=options.step)
    free = [q for q in QUANTITIES if q not in fixed and q != options.over]
    paths = []
    if folder is not None:
        paths = [folder / "branch.png"]
        with mpl.rc_context({"savefig.dpi": 110}):
            branch_figure(points, options.over, free).savefig(paths[0])
    if options.json:
        print(json.dumps({"points": [_data(p) for p in points], "figures": list(map(str, paths))}))
    else:
        _print(points, options.gait, paths)
    return 0


def _si(name: str, value: float) -> float:
    return math.radians(value) if name == "angle" else value


def _quantities(option: str, pairs: list[str] | None) -> dict[str, float]:
    """``QUANTITY=VALUE`` strings as numbers, the angle in degrees.

    Raises:
        ParameterError: naming what is no quantity or no number.
    """
    found = {}
    for pair in pairs or []:
        name, _, text = pair.partition("=")
        if name not in QUANTITIES:
            raise ParameterError(
                f"{option} {pair!r} names no quantity: give one of {', '.join(QUANTITIES)}, as in"
                " height=0.98"
            )
        try:
            found[name] = float(text)
        except ValueError:
            raise ParameterError(f"{option} {pair!r} has no number after the equals sign") from None
    return found


def _data(point: BranchPoint) -> dict[str, Any]:
    return {
        **{name: point.quantity(name) for name in QUANTITIES},
        "state": point.state.tolist(),
        "eigenvalues": [[float(v.real), float(v.imag)] for v in point.eigenvalues],
        "kind": point.kind.value,
        "special": point.special.value if point.special else None,
    }


def _print(points: list[BranchPoint], gait: str, paths: list[Path]) -> None:
    table = Table(title=f"branch of {gait} gaits, {len(points)} points")
    for name in QUANTITIES:
        table.add_column(_COLUMNS[name], justify="right")
    table.add_column("eigenvalues", justify="right")
    table.add_column("stability")
    every = max(1, len(points) // _TABLE_ROWS)
    for i, point in enumerate(points):
        if i % every and point.special is None:
            continue
        values = (f"{UNITS[name][1] * point.quantity(name):.4f}" for name in QUANTITIES)
        text = point.special.name.lower() if point.special else point.kind.value
        table.add_row(*values, _eigenvalues(point), text)
    console = Console()
    console.print(table)
    for path in paths:
        console.print(f"figure: {path}", highlight=False)


def _eigenvalues(point: BranchPoint) -> str:
    """A complex pair as a+-bj, real ones side by side."""
    first = point.eigenvalues[0]
    if abs(first.imag) > 1e-12:
        return f"{first.real:.3f}+-{abs(first.imag):.3f}j"
    return "  ".join(f"{v.real:.3f}" for v in point.eigenvalues)
