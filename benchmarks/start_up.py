"""Time that the command line and the library take to start, as processes of their own.

    python benchmarks/start_up.py [--repeats 10] [--against CHECKOUT] [--json]
    python benchmarks/start_up.py --first-walk --repeats 2 [--against CHECKOUT] [--json]

Times ``template-control --help``, ``template-control walk --help`` and ``import
template_control``, and for comparison Python that does nothing and ``import numpy``. The lines take
turns, so that a busy machine slows all of them alike; every line runs once before the clock
starts, so that files are read and byte code is there. Prints the shortest and the median wall
time and the ratio of the shortest to that of Python that does nothing. ``--against`` times another
checkout of this library in the same run, with the same Python, and adds its times over this one's.

``--first-walk`` times a walk of one step with nothing compiled, and takes the processor time of all
its processes too. It does so a minute or two a run, so give it a few runs only.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[1]
_COMMAND = ("-m", "template_control.cli.main")
NOTHING = "python -c pass"
PYTHON = {NOTHING: ("-c", "pass"), "import numpy": ("-c", "import numpy")}
FIRST_WALK = "template-control walk --steps 1 --no-figures, nothing compiled"
_HEADINGS = ("line", "checkout", "min [s]", "median [s]", "CPU [s]", "/ nothing", "/ this")
LIBRARY = {
    "import template_control": ("-c", "import template_control"),
    "template-control --help": (*_COMMAND, "--help"),
    "template-control walk --help": (*_COMMAND, "walk", "--help"),
}


class Taken(NamedTuple):
    """Time that a line took.

    Attributes:
        wall: [s].
        processor: of the process and of those that it started [s].
    """

    wall: float
    processor: float


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def seconds(arguments: tuple[str, ...], checkout: Path, **more: str) -> Taken:
    """Time of Python with ``arguments``, importing from ``checkout``.

    Args:
        arguments: after ``python``.
        checkout: folder that has the folder ``template_control``.
        more: of the environment.
    """
    environment = {**os.environ, "PYTHONPATH": str(checkout), **more}
    begun, before = time.perf_counter(), _processor()
    subprocess.run(
        [sys.executable, *arguments],
        cwd=checkout,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    return Taken(time.perf_counter() - begun, _processor() - before)


def first_walk(checkout: Path) -> Taken:
    """Time of a walk of one step with an empty cache of compiled code."""
    with tempfile.TemporaryDirectory() as folder:
        walk = ("walk", "--steps", "1", "--no-figures", "--output", folder)
        return seconds((*_COMMAND, *walk), checkout, NUMBA_CACHE_DIR=str(Path(folder, "cache")))


def measure_first_walk(repeats: int, against: Path | None) -> list[dict[str, object]]:
    """As :func:`measure`, of a walk with nothing compiled."""
    checkouts = [ROOT] if against is None else [ROOT, against]
    taken: dict[tuple[str, Path], list[Taken]] = {(FIRST_WALK, c): [] for c in checkouts}
    for _ in range(repeats):
        for (_, checkout), times in taken.items():
            times.append(first_walk(checkout))
    return _rows(taken, None)


def measure(repeats: int, against: Path | None) -> list[dict[str, object]]:
    """One row a line and checkout.

    Args:
        repeats: of each line.
        against: another checkout; None for this one only.

    Returns:
        Rows of line, checkout, min_seconds, median_seconds, processor_seconds (the least),
        over_nothing (its minimum over that of Python that does nothing), over_this (the other
        checkout's minimum over this one's).
    """
    lines = {(name, ROOT): words for name, words in {**PYTHON, **LIBRARY}.items()}
    if against is not None:
        lines |= {(name, against): words for name, words in LIBRARY.items()}
    taken: dict[tuple[str, Path], list[Taken]] = {key: [] for key in lines}
    for turn in range(repeats + 1):
        for (name, checkout), words in lines.items():
            times = seconds(words, checkout)
            if turn > 0:
                taken[name, checkout].append(times)
    return _rows(taken, min(taken[NOTHING, ROOT]).wall)


def _rows(
    taken: dict[tuple[str, Path], list[Taken]], nothing: float | None
) -> list[dict[str, object]]:
    return [
        {
            "line": name,
            "checkout": "this" if checkout == ROOT else str(checkout),
            "min_seconds": min(times).wall,
            "median_seconds": median(t.wall for t in times),
            "processor_seconds": min(t.processor for t in times),
            "over_nothing": nothing and min(times).wall / nothing,
            "over_this": (
                None if checkout == ROOT else min(times).wall / min(taken[name, ROOT]).wall
            ),
        }
        for (name, checkout), times in taken.items()
    ]


def main() -> None:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(description="Time how long the command line takes to start.")
    parser.add_argument("--repeats", type=int, default=10, help="runs of each line")
    parser.add_argument(
        "--against", type=Path, metavar="CHECKOUT", help="another checkout to time in turns"
    )
    parser.add_argument(
        "--first-walk", action="store_true", help="time a walk with nothing compiled instead"
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
    rows = (measure_first_walk if options.first_walk else measure)(options.repeats, against)
    about = {"cores": os.cpu_count(), "load": os.getloadavg()[0]}
    if options.json:
        print(json.dumps({**about, "rows": rows}))
        return
    table = Table(title=f"start-up, {about['cores']} cores, load {about['load']:.1f}")
    for i, heading in enumerate(_HEADINGS):
        table.add_column(heading, justify="left" if i < 2 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v or "") for v in row.values()))
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
