"""How long the command line and the library take to start, as processes of their own.

    python benchmarks/start_up.py [--repeats 10] [--against CHECKOUT] [--json]

Times ``template-control --help``, ``template-control walk --help`` and ``import
template_control``, and beside them Python that does nothing and ``import numpy``. The lines take
turns, so that a busy machine slows all of them alike; every line runs once before the clock
starts, so that files are read and byte code is there. Prints the shortest and the median wall
time and the ratio of the shortest to that of Python that does nothing. ``--against`` times another
checkout of this library in the same run, with the same Python, and adds its times over this one's.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[1]
_COMMAND = ("-m", "template_control.cli.main")
NOTHING = "python -c pass"
PYTHON = {NOTHING: ("-c", "pass"), "import numpy": ("-c", "import numpy")}
_HEADINGS = ("line", "checkout", "min [s]", "median [s]", "/ nothing", "/ this")
LIBRARY = {
    "import template_control": ("-c", "import template_control"),
    "template-control --help": (*_COMMAND, "--help"),
    "template-control walk --help": (*_COMMAND, "walk", "--help"),
}


def seconds(arguments: tuple[str, ...], checkout: Path) -> float:
    """Wall time [s] of Python with ``arguments``, importing from ``checkout``.

    Args:
        arguments: after ``python``.
        checkout: folder that has the folder ``template_control``.
    """
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    begun = time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments],
        cwd=checkout,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    return time.perf_counter() - begun


def measure(repeats: int, against: Path | None) -> list[dict[str, object]]:
    """One row a line and checkout.

    Args:
        repeats: of each line.
        against: another checkout; None for this one only.

    Returns:
        Rows of line, checkout, min_seconds, median_seconds, over_nothing (its minimum over that
        of Python that does nothing), over_this (the other checkout's minimum over this one's).
    """
    lines = {(name, ROOT): words for name, words in {**PYTHON, **LIBRARY}.items()}
    if against is not None:
        lines |= {(name, against): words for name, words in LIBRARY.items()}
    taken: dict[tuple[str, Path], list[float]] = {key: [] for key in lines}
    for turn in range(repeats + 1):
        for (name, checkout), words in lines.items():
            wall = seconds(words, checkout)
            if turn > 0:
                taken[name, checkout].append(wall)
    nothing = min(taken[NOTHING, ROOT])
    return [
        {
            "line": name,
            "checkout": "this" if checkout == ROOT else str(checkout),
            "min_seconds": min(walls),
            "median_seconds": median(walls),
            "over_nothing": min(walls) / nothing,
            "over_this": None if checkout == ROOT else min(walls) / min(taken[name, ROOT]),
        }
        for (name, checkout), walls in taken.items()
    ]


def main() -> None:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(description="Time how long the command line takes to start.")
    parser.add_argument("--repeats", type=int, default=10, help="runs of each line")
    parser.add_argument(
        "--against", type=Path, metavar="CHECKOUT", help="another checkout to time in turns"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error(f"--repeats is {options.repeats}: give a number from 1 on")
    against = options.against
    if against is not None:
        against = against.resolve()
        if not (against / "template_control").is_dir() or against == ROOT:
            parser.error(f"--against {against} is no other checkout: give the folder of a clone")
    rows = measure(options.repeats, against)
    about = {"cores": os.cpu_count(), "load": os.getloadavg()[0]}
    if options.json:
        print(json.dumps({**about, "rows": rows}))
        return
    table = Table(title=f"start-up, {about['cores']} cores, load {about['load']:.1f}")
    for i, heading in enumerate(_HEADINGS):
        table.add_column(heading, justify="left" if i < 2 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v or "") for v in row.values()))
    Console().print(table)


if __name__ == "__main__":
    main()
