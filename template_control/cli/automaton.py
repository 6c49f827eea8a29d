"""``template-control automaton``: the hybrid automaton as a table, as JSON and as Fig. 2."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.table import Table

from template_control.checks import option_types as values
from template_control.errors import ParameterError, RecordError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Outcome, Reset
from template_control.storage import Files
from template_control.terminal import report, table
from template_control.view.automaton_figure import GAIT_NAMES, automaton_figure, gaits
from template_control.view.style import in_words, save_figure

_SUFFIXES = (".png", ".svg", ".pdf")
_COLUMNS = ("node", "phase", "rear leg", "front leg", "guard -> successor (reset)", "fails")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Print the nodes of the hybrid automaton by gait, with leg stiffnesses, guards,"
        " successors, resets and ways to fail, and draw it (the paper's Fig. 2). Exit status:"
        " 0, 2 for bad input."
    )
    parser.formatter_class = argparse.ArgumentDefaultsHelpFormatter
    parser.add_argument(
        "--output",
        type=values.path,
        default=Path("runs/automaton.png"),
        metavar="FILE",
        help=f"file of the figure ({', '.join(_SUFFIXES)}); its folder is made if need be",
    )
    values.add_json(parser, "the automaton as one JSON object")
    parser.add_argument("--no-figure", action="store_true", help="do not draw the figure")


def run(options: argparse.Namespace) -> int:
    """Draw and print as the options say; returns 0."""
    files, figure, path = Files(), None, options.output
    if not options.no_figure:
        _check(path)
        figure = files.write(lambda: save_figure(automaton_figure(AUTOMATON), path, dpi=100))
    lines = () if figure is None else (f"figure: {figure}",)
    report(options.json, describe(AUTOMATON), *tables(AUTOMATON), lines=lines)
    files.raise_pending()
    return 0


def _check(path: Path) -> None:
    """Refuse a file that cannot be written; folders on the way to it are made."""
    if path.suffix.lower() not in _SUFFIXES:
        raise ParameterError(f"--output is {path}: give a file ending in {', '.join(_SUFFIXES)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        reason = "it is a folder" if path.is_dir() else None
    except OSError as error:
        reason = error.strerror
    if reason is not None:
        raise RecordError(f"cannot write {path}: {reason}; give another --output")


def describe(automaton: Automaton) -> dict[str, Any]:
    """The whole automaton in JSON's types: the first node of each kind of stride, and all nodes."""
    return {
        "starts": dict(automaton.starts),
        "nodes": [_describe_node(node) for node in automaton.nodes],
    }


def _describe_node(node: Node) -> dict[str, Any]:
    rear, front = (None if slot is None else slot.name for slot in (node.rear, node.front))
    head = {"name": node.name, "gait": node.gait, "phase": node.phase.name}
    edges = [_describe_edge(edge) for edge in node.edges]
    return {**head, "rear": rear, "front": front, "edges": edges}


def _describe_edge(edge: Edge) -> dict[str, Any]:
    end: dict[str, Any] = {"target": edge.target}
    if isinstance(edge.target, Outcome):
        end = {"failure": edge.target.name, "reason": edge.target.reason}
    guard = {"event": edge.event.name, "guard": edge.guard}
    return {**guard, **end, "reset": edge.reset.name, "section": edge.section}


def tables(automaton: Automaton) -> list[Table]:
    """One table a gait, its nodes in order of first arrival."""
    found = []
    for gait, names in gaits(automaton).items():
        title, rows = GAIT_NAMES.get(gait, f"gait {gait}"), map(_row, map(automaton.node, names))
        look: dict[str, Any] = {"show_lines": True, "title_justify": "left"}
        found.append(table(title, _COLUMNS, rows, left=len(_COLUMNS), **look))
    return found


def _row(node: Node) -> list[str]:
    ways, failures = (
        [_way(edge) for edge in node.edges if isinstance(edge.target, Outcome) is fails]
        for fails in (False, True)
    )
    legs = ["-" if slot is None else slot.name.lower() for slot in (node.rear, node.front)]
    return [node.name, node.phase.name, *legs, "\n".join(ways), "\n".join(failures)]


def _way(edge: Edge) -> str:
    """An edge, such as ``"G_t^w touchdown -> DS_sc^w (place front)"``; a failure says why."""
    event = in_words(edge.event.name)
    if isinstance(edge.target, Outcome):
        return f"{event}: {edge.target.reason}"
    notes = [in_words(edge.reset.name)] if edge.reset is not Reset.NONE else []
    notes += ["ends the stride"] if edge.section else []
    tail = f" ({', '.join(notes)})" if notes else ""
    return f"{edge.guard} {event} -> {edge.target}{tail}".lstrip()
