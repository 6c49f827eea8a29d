"""``template-control gaits``: a branch of periodic gaits, or the walking gaits by speed."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from template_control import storage
from template_control.arrays import Array
from template_control.checks import option_types as values
from template_control.checks import typed
from template_control.checks.fitting import check
from template_control.checks.ranges import Degrees, Positive, Range
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import MapKind, Slot, StrideKind
from template_control.slip.control.controllers import (
    VARIED,
    ActiveRunning,
    ModifiedWalking,
    section_target,
    targeted,
)
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.branch import QUANTITIES, BranchPoint
from template_control.slip.gaits.family_search import (
    Figures,
    Member,
    family_data,
    search_family,
)
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.gaits.gait_branch import ControlledFamily, Family
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import APEX, VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.change_search import change_data, search_changes
from template_control.storage import Files, writing
from template_control.terminal import progress_bar, report, table
from template_control.view.stability_figures import UNITS, branch_figure, speed_family_figure
from template_control.view.style import save_figure


class _Defaults(NamedTuple):
    start: dict[str, float]
    fixed: dict[str, float]
    limits: tuple[float, float]
    held: dict[str, float]
    target: float


_DEFAULTS = {
    "walk": _Defaults(
        {"speed": 1.148, "height": 0.9818, "angle": 70.0, "stiffness": 16.5e3},
        {"height": 0.9818, "stiffness": 16.5e3},
        (815.0, 830.0),
        {"height": 0.9818},
        826.0,
    ),
    "run": _Defaults(
        {"speed": 4.9, "height": 0.947, "angle": 68.0, "stiffness": 20e3},
        {"angle": 68.0, "stiffness": 20e3},
        (1500.0, 2500.0),
        {"height": 0.98},
        1600.0,
    ),
}
_STRIDES = {"walk": StrideKind.WALK, "run": StrideKind.RUN}
_MAPS = {kind.name.lower(): kind for kind in (MapKind.EXACT, MapKind.IMPROVED, MapKind.PAPER)}
_TYPED = {**dict.fromkeys(QUANTITIES, Positive), "angle": Degrees}
_TABLE_ROWS = 14


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Follow a branch of passive periodic gaits of the template by pseudo-arclength, past"
        " its folds: two quantities are held fixed, the others vary. Quantities:"
        f" {', '.join(QUANTITIES)} (J, degrees, N/m, m, m/s at VLO or apex). Without options:"
        " the walking gaits of Section IV-D. With --controlled: where the paper's controller"
        " settles as its target is moved; one quantity of the target is held fixed, --over is"
        " moved, and the gait found near --start is followed."
    )
    parser.formatter_class = argparse.ArgumentDefaultsHelpFormatter
    parser.add_argument("--gait", choices=tuple(_STRIDES), default="walk")
    parser.add_argument(
        "--family",
        action="store_true",
        help="make the family of walking gaits by speed anew instead: its file, as the library"
        " ships it, a figure and a table; about a minute",
    )
    parser.add_argument(
        "--changes",
        action="store_true",
        help="search the changes of speed anew instead, walking steps from gait to gait: their"
        " file, as the library ships it, and a table; about 10 minutes",
    )
    parser.add_argument(
        "--fix",
        action="append",
        metavar="QUANTITY=VALUE",
        help="hold a quantity fixed; give two, with --controlled one",
    )
    parser.add_argument(
        "--controlled",
        choices=tuple(_MAPS),
        metavar="MAP",
        help="gaits of modified walking or active running, computed on this return map:"
        f" {', '.join(_MAPS)}",
    )
    parser.add_argument(
        "--start",
        action="append",
        metavar="QUANTITY=VALUE",
        help="where to look for the first gait, instead of the defaults",
    )
    parser.add_argument("--over", choices=QUANTITIES, default="energy", help="quantity to go over")
    parser.add_argument(
        "--limits",
        nargs=2,
        type=values.number(Range()),
        metavar=("LOW", "HIGH"),
        help="of --over",
    )
    parser.add_argument(
        "--step",
        type=values.number(Range(0.0, 0.5, above=True)),
        default=0.004,
        help="largest arclength step",
    )
    values.add_folder(parser, "runs/gaits", "folder for the figure")
    values.add_json(parser, "the branch as JSON")


Made = tuple[dict[str, Any], Table, dict[str, Callable[[Path], Path]]]
"""Result of a command: data as JSON, a table, and what writes its files, by name."""


def run(options: argparse.Namespace) -> int:
    """Follow the branch, or make a file anew, and report it."""
    _complete(options)
    make = make_family if options.family else make_changes if options.changes else _branch
    files, paths = Files(), []
    with nullcontext() if options.no_figures else writing(options.output) as folder:
        data, shown, writers = make(options)
        if folder is not None:
            tried = (files.write(partial(write, folder / n)) for n, write in writers.items())
            paths = [str(path) for path in tried if path is not None]
    if make is _branch:
        data["figures"] = paths
    word = "figure" if make is _branch else "written"
    report(options.json, data, shown, lines=(f"{word}: {path}" for path in paths))
    files.raise_pending()
    return 0


def _complete(options: argparse.Namespace) -> None:
    """Check options of a branch, and set those that are not given: quantities by their names."""
    searches = [name for name in ("family", "changes") if getattr(options, name)]
    if searches:
        others = [n for n in ("fix", "controlled", "start", "limits") if getattr(options, n)]
        if others := others + searches[1:]:
            raise ParameterError(f"--{others[0]} does not go with --{searches[0]}: leave one out")
        return
    defaults = _DEFAULTS[options.gait]
    given = _quantities("--fix", options.fix)
    if options.limits is None and options.over != "energy":
        raise ParameterError(f"--over {options.over} needs --limits: give its range")
    low, high = options.limits or defaults.limits
    for limit in (low, high):
        check("--limits", limit, _TYPED[options.over])
    if not low < high:
        raise ParameterError(f"--limits are {low:g} and {high:g}: give low, then high")
    start = _quantities("--start", options.start)
    if options.controlled and options.limits is None:
        start.setdefault(options.over, defaults.target)
    held = defaults.held if options.controlled else defaults.fixed
    options.fix, options.start, options.limits = given or held, start, (low, high)


def _branch(options: argparse.Namespace) -> Made:
    """Follow one branch."""
    over, controlled = options.over, bool(options.controlled)
    if controlled:
        points = _controlled(options, _MAPS[options.controlled])
        shown = [*options.fix, "angle"]
    else:
        points = _passive(options)
        shown = [q for q in QUANTITIES if q not in options.fix and q != over]

    def draw(path: Path) -> Path:
        return save_figure(branch_figure(points, over, shown, controlled), path)

    data: dict[str, Any] = {"points": [_data(p) for p in points]}
    return data, _branch_table(points, options.gait, over), {"branch.png": draw}


def _passive(options: argparse.Namespace) -> list[BranchPoint]:
    fixed = {name: _si(name, value) for name, value in options.fix.items()}
    family = Family(SlipParameters(), _STRIDES[options.gait], fixed)
    start = {**_DEFAULTS[options.gait].start, **options.fix, **options.start}
    guess = [start["speed"], start["height"], 0.0][: family.n]
    x = np.array([*guess, np.radians(start["angle"]), start["stiffness"]])
    low, high = (_si(options.over, v) for v in options.limits)
    return family.trace(x, options.over, (low, high), step=options.step)


def _controlled(options: argparse.Namespace, kind: MapKind) -> list[BranchPoint]:
    held, varied = options.fix, options.over
    if len(held) != 1 or not {*held, varied} <= set(VARIED) or varied in held:
        raise ParameterError(
            f"--controlled holds {', '.join(held)} and moves {varied}: --fix one of"
            f" {', '.join(VARIED)} and give another to --over"
        )
    p, walking = SlipParameters(), options.gait == "walk"
    section = VLO if walking else APEX
    controller = ModifiedWalking(p, kind) if walking else ActiveRunning(p, kind)
    start = {**_DEFAULTS[options.gait].start, **options.start}
    guess = controls(np.radians(start["angle"]), start["stiffness"], start["stiffness"])
    policy = targeted(controller, p, section, held, varied, guess)
    family = ControlledFamily(ReturnMap(p, _STRIDES[options.gait]), policy, varied)
    value = options.start.get(varied, 0.5 * sum(options.limits))
    x = np.append(section_target(p, section, {**held, varied: value}), value)
    return family.trace(x, "target", options.limits, step=options.step)


def _si(name: str, value: float) -> float:
    return math.radians(value) if name == "angle" else value


def _quantities(option: str, pairs: list[str] | None) -> dict[str, float]:
    """``QUANTITY=VALUE`` as numbers, the angle in degrees; a ParameterError names a bad one."""
    found = typed.entries(option, pairs or [], "QUANTITY=VALUE, such as height=0.98")
    numbers = {}
    for name, text in found.items():
        if name not in QUANTITIES:
            raise ParameterError(
                f"{option} {name} names no quantity: give one of {', '.join(QUANTITIES)}"
            )
        numbers[name] = typed.number(f"{option} {name}", text, _TYPED[name])
    return numbers


def _data(point: BranchPoint) -> dict[str, Any]:
    return {
        **{name: point.quantity(name) for name in QUANTITIES},
        "target": point.target,
        "state": point.state.tolist(),
        "eigenvalues": [[float(v.real), float(v.imag)] for v in point.eigenvalues],
        "kind": point.kind.value,
        "special": point.special.value if point.special else None,
    }


def _branch_table(points: list[BranchPoint], gait: str, over: str) -> Table:
    controlled = points[0].target is not None
    columns = [f"target {UNITS[over][1]}"] if controlled else []
    columns += [UNITS[name][1] for name in QUANTITIES]
    columns += ["|eig.|" if controlled else "eigenvalues", "stability"]
    every, rows = max(1, len(points) // _TABLE_ROWS), []
    for i, point in enumerate(points):
        if i % every and point.special is None:
            continue
        target = [_number(over, point.quantity("target"))] if controlled else []
        values = [_number(name, point.quantity(name)) for name in QUANTITIES]
        text = point.special.name.lower() if point.special else point.kind.value
        rows.append([*target, *values, _eigenvalues(point), text])
    title = f"branch of {gait} gaits, {len(points)} points"
    found = table(title, columns, rows, left=0, box=SIMPLE_HEAD)
    found.columns[-1].justify = "left"
    return found


def _number(name: str, value: float) -> str:
    return f"{UNITS[name][2] * value:.{4 if name in ('height', 'speed') else 3}f}"


def _eigenvalues(point: BranchPoint) -> str:
    """A complex pair as a±bj, real ones side by side; with a controller the largest's size."""
    values = point.eigenvalues
    if point.target is not None:
        return f"{np.abs(values).max():.4f}"
    if abs(values[0].imag) > 1e-12:
        return f"{values[0].real:.3f}±{abs(values[0].imag):.3f}j"
    return "  ".join(f"{v.real:.3f}" for v in values)


Chains = tuple[list[Member], ...]

_TABLE_STEP = 0.1  # [m/s]
Column = tuple[str, str, str, Callable[[WalkingGait, Figures], float]]
# Label in the figure; header in the table, if it is there, and format; value.
_SHOWN: tuple[Column, ...] = (
    ("mean speed [m/s]", "m/s", ".3f", lambda g, _: g.mean_speed),
    ("leg stiffness [kN/m]", "k kN/m", ".2f", lambda g, _: 1e-3 * g.parameters.leg_stiffness),
    (
        "touchdown angle [deg]",
        "alpha",
        ".2f",
        lambda g, _: math.degrees(g.controls[Slot.TOUCHDOWN_ANGLE]),
    ),
    ("height at VLO [m]", "y m", ".4f", lambda g, _: g.vlo[1]),
    ("step length [m]", "step m", ".3f", lambda g, _: g.step_length),
    ("step duration [s]", "step s", ".3f", lambda g, _: g.step_duration),
    ("least singular value of B", "", "", lambda _, f: f.authority),
    ("share of double stance", "", "", lambda _, f: f.double_stance),
)
_EIGENVALUES: tuple[Column, ...] = (
    ("passive", "passive", ".2f", lambda _, f: f.passive),
    ("three controls", "3 u", ".2f", lambda _, f: f.without),
    ("with push-off", "4 u", ".2f", lambda _, f: f.closed),
)


def make_family(options: argparse.Namespace) -> Made:
    """Search the family: its file, its figure and a table."""
    chains = search_family()
    data = family_data(chains)

    def draw(path: Path) -> Path:
        pairs = {"largest |eigenvalue|": _curves(chains, _EIGENVALUES)}
        return save_figure(speed_family_figure(_curves(chains, _SHOWN), pairs), path)

    text = json.dumps(data, indent=1) + "\n"
    write = partial(storage.write_text, text=text)
    return data, _family_table(chains), {"walking.json": write, "by_speed.png": draw}


def make_changes(options: argparse.Namespace) -> Made:
    """Search the changes of speed: their file and a table."""
    with progress_bar("changes of speed", 1.0) as done:
        found = search_changes(done=done)
    data = change_data(found)
    speeds = sorted({speed for ends in found for speed in ends})
    steps = {ends: str(len(change.controls)) for ends, (_, change) in found.items()}
    rows = [[f"{a:g}", *(steps.get((a, b), "") for b in speeds)] for a in speeds]
    title = "steps from one speed at VLO [m/s] to another one, for 80 kg and l0 = 1 m"
    shown = table(title, ["", *map("{:g}".format, speeds)], rows)
    write = partial(storage.write_text, text=json.dumps(data) + "\n")
    return data, shown, {"speed_changes.json": write}


def _curves(chains: Chains, columns: tuple[Column, ...]) -> dict[str, list[Array]]:
    return {
        label: [np.array([value(*member) for member in chain]) for chain in chains]
        for label, _, _, value in columns
    }


def _family_table(chains: Chains) -> Table:
    columns = [column[1:] for column in (*_SHOWN, *_EIGENVALUES) if column[1]]
    rows, wanted = [], 0.0
    for member in (member for chain in chains for member in chain):
        speed = member[0].mean_speed
        if speed >= wanted:
            wanted = _TABLE_STEP * (np.floor(speed / _TABLE_STEP) + 1.0)
            rows.append([format(of(*member), form) for _, form, of in columns])
    title = "walking gaits by speed, for 80 kg and l0 = 1 m; largest eigenvalues"
    return table(title, [column[0] for column in columns], rows, left=0, box=SIMPLE_HEAD)
