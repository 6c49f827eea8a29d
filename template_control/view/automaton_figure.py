"""Figure of the hybrid automaton (Fig. 2): a panel a gait."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Patch

from template_control.arrays import Array
from template_control.slip.automaton.hybrid import Automaton, Edge
from template_control.slip.automaton.vocabulary import Outcome, Phase, Reset, StrideKind
from template_control.view.style import in_words

GAIT_NAMES: dict[str, str] = {
    StrideKind.WALK: "walking",
    StrideKind.RUN: "running",
    StrideKind.WALK_TO_RUN: "walk-to-run",
    StrideKind.RUN_TO_WALK: "run-to-walk",
    StrideKind.WALK_TO_RUN_SIMPLIFIED: "walk-to-run, simplified",
    StrideKind.STAND: "standing",
    StrideKind.STAND_TO_WALK: "start",
    StrideKind.WALK_TO_STAND: "stop",
    StrideKind.CHANGE_SPEED: "to another speed",
    StrideKind.WALK_PUSH_OFF: "walking with push-off",
    StrideKind.STEP_FORWARD: "step from a stand",
    StrideKind.STEP_BACK: "step back from a stand",
    StrideKind.HOP: "hopping",
}
"""Gaits by the superscripts of Table I, and of standing."""

_PHASES = {
    Phase.F: ("#eef2f6", "flight"),
    Phase.SS: ("#cfe1f2", "single stance"),
    Phase.DS: ("#f7dcc0", "double stance"),
}
_INK, _SECTION, _CHOICE, _PANEL = "#3a3f45", "#b3202a", "#6b7078", "#f9f9f7"
# Lengths in drawing units; _INCH inches each.
_INCH, _WIDTH, _GAP = 0.5, 32.0, 0.4
_NODE, _PITCH, _LEAST = 0.66, 3.2, 1.7  # of nodes; from one to the next; least radius of a circle
_AROUND, _TITLE = 2.6, 0.3  # of a panel, about the circle and above that
_BEND, _BEYOND, _STUB = 0.22, 0.8, 0.9  # of arrows; labels beyond them; arrows that leave a gait
_FONT = 10.0


def successions(automaton: Automaton) -> Iterator[tuple[str, str, Edge]]:
    """Every edge that is no failure, with the names of its ends."""
    for node in automaton.nodes:
        for edge in node.edges:
            if not isinstance(edge.target, Outcome):
                yield node.name, edge.target, edge


def gaits(automaton: Automaton) -> dict[str, tuple[str, ...]]:
    """Node names by gait, each gait's in order of first arrival from its stride's start."""
    ordered = {}
    for gait in dict.fromkeys(node.gait for node in automaton.nodes):
        members = [n.name for n in automaton.nodes if n.gait == gait]
        start = automaton.starts.get(gait, members[0])
        reached = [n.name for n in automaton.stride(start) if n.name in members]
        ordered[gait] = (*reached, *(name for name in members if name not in reached))
    return ordered


def choices(automaton: Automaton) -> list[tuple[str, str]]:
    """Pairs of stride starts at the same section; no edge leads to the second of them.

    Where a stride ends at the first, the next one may begin at the second instead.
    """
    reached = {target for _, target, _ in successions(automaton)}
    ends = {target for _, target, edge in successions(automaton) if edge.section}
    starts = [names[0] for names in gaits(automaton).values()]
    section = {
        name: automaton.sections(name)[0]
        for name in starts
        if any(e.section for n in automaton.stride(name) for e in n.edges)
    }
    return [
        (a, b)
        for b in section
        if b not in reached
        for a in section
        if a in ends and section[a] == section[b]
    ]


def mathtext(name: str) -> str:
    """A node's or guard's name as in the paper: ``"SS_sc^w"`` is ``"$SS_{sc}^{w}$"``."""
    stem, _, gait = name.partition("^")
    base, _, sub = stem.partition("_")
    text = base + (f"_{{{sub}}}" if sub else "") + (f"^{{{gait}}}" if gait else "")
    return f"${text}$"


def edge_label(edge: Edge) -> str:
    """Guard and, on lines of their own, the section it is and the reset it brings."""
    lines = [mathtext(edge.guard) if edge.guard else in_words(edge.event.name)]
    if edge.section:
        lines.append(in_words(edge.event.name))
    if edge.reset is not Reset.NONE:
        lines.append(in_words(edge.reset.name))
    return "\n".join(lines)


def automaton_figure(automaton: Automaton) -> Figure:
    """Fig. 2 of the paper from ``automaton``, a panel a gait; failures are left out.

    Circles are nodes, coloured by phase; arrows are edges with guard, section and reset, and where
    they leave the gait the name of the node that they lead to. Below a gait that may be chosen at a
    section stand the nodes that its stride starts instead of.
    """
    figure = Figure()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    x = y = low = 0.0
    for gait, names in gaits(automaton).items():
        side = 2.0 * (_radius(len(names)) + _AROUND)
        if x + side > _WIDTH:
            x, y = 0.0, low - _GAP
        _draw_gait(axes, automaton, gait, np.array([x + 0.5 * side, y - _TITLE - 0.5 * side]))
        x, low = x + side + _GAP, min(low, y - _TITLE - side)
    width, height = _WIDTH + 2.0 * _GAP, 3.0 * _GAP - low + 1.0
    axes.set(xlim=(-_GAP, _WIDTH + _GAP), ylim=(_GAP - height, _GAP), aspect="equal")
    axes.set_axis_off()
    figure.set_size_inches(_INCH * width, _INCH * height)
    _draw_legend(axes, automaton)
    return figure


def _radius(count: int) -> float:
    """Radius of the circle that a gait's nodes are on."""
    return max(_LEAST, _PITCH * count / (2.0 * np.pi)) if count > 1 else 0.0


def _draw_gait(axes: Axes, automaton: Automaton, gait: str, middle: Array) -> None:
    """A titled box, dashed for what only a controller sees, with the gait's nodes on a circle."""
    names = gaits(automaton)[gait]
    radius, line = _radius(len(names)), "--" if gait.endswith("*") else "-"
    half = radius + _AROUND
    left, low = (middle - half).tolist()
    box = FancyBboxPatch((left, low), 2.0 * half, 2.0 * half + _TITLE, zorder=0)
    box.set_boxstyle("round,pad=0,rounding_size=0.3")
    box.set(facecolor=_PANEL, edgecolor="0.75", linestyle=line)
    axes.add_patch(box)
    top = low + 2.0 * half + _TITLE - 0.25
    title = axes.text(left + 0.3, top, GAIT_NAMES.get(gait, f"gait {gait}"), va="top")
    title.set(fontsize=_FONT + 1, fontweight="bold", color=_INK)
    instead = [mathtext(a) for a, b in choices(automaton) if b == names[0]]
    if instead:
        text = f"starts instead of {' or '.join(instead)}"
        axes.text(left + 0.3, top - 0.8, text, fontsize=_FONT, va="top", color=_CHOICE)
    turns = 2.0 * np.pi * np.arange(len(names)) / len(names)
    outward = np.stack((np.cos(turns), np.sin(turns)), axis=1)
    centre = dict(zip(names, middle + radius * outward, strict=True))
    for name, (x, y) in centre.items():
        circle = Circle((x, y), _NODE, facecolor=_PHASES[automaton.node(name).phase][0])
        circle.set(edgecolor=_INK, linestyle=line, zorder=3)
        axes.add_patch(circle)
        axes.text(x, y, mathtext(name), fontsize=_FONT + 1, ha="center", va="center", zorder=4)
    edges = [(a, b, edge) for a, b, edge in successions(automaton) if a in centre]
    for i, (a, b, edge) in enumerate(edges):
        if b in centre and b != a:
            follows = names.index(b) == (names.index(a) + 1) % len(names)
            same = sum(other[:2] == (a, b) for other in edges[:i])
            _draw_edge(axes, edge, centre[a], centre[b], _BEND * (follows + 3 * same))
    for name, away in zip(names, turns, strict=True):
        leaving = [(b, edge) for a, b, edge in edges if a == name and (b == a or b not in centre)]
        for i, (target, edge) in enumerate(leaving):
            turn = away + 1.1 * (i - 0.5 * (len(leaving) - 1))
            way = np.array([np.cos(turn), np.sin(turn)])
            _draw_leaving(axes, edge, centre[name], way, target)


def _arrow(axes: Axes, edge: Edge, begin: Array, end: Array, bend: float) -> None:
    """An arrow from one place to another, bent to its right by a share of its length."""
    ends = (begin[0], begin[1]), (end[0], end[1])
    arrow = FancyArrowPatch(*ends, arrowstyle="-|>", shrinkA=0.0, shrinkB=0.0, zorder=2)
    color, width = (_SECTION, 2.2) if edge.section else (_INK, 1.2)
    arrow.set(connectionstyle=f"arc3,rad={bend}", mutation_scale=12, color=color, linewidth=width)
    axes.add_patch(arrow)


def _draw_edge(axes: Axes, edge: Edge, begin: Array, end: Array, bend: float) -> None:
    """An arrow from rim to rim of two nodes, with its label beyond its bend, or on it."""
    span = end - begin
    right = np.array([span[1], -span[0]])
    distance = np.linalg.norm(span)
    # Where the curve crosses the rims, as if it was straight there.
    along, across = span + 2.0 * bend * right, -span + 2.0 * bend * right
    rims = [_NODE * way / np.linalg.norm(way) for way in (along, across)]
    _arrow(axes, edge, begin + rims[0], end + rims[1], bend)
    if bend:
        place = 0.5 * (begin + end) + (0.5 * bend + _BEYOND / distance) * right
    else:
        place = begin + 0.45 * span
    _label(axes, edge, place, edge_label(edge), ("center", "center"))


def _draw_leaving(axes: Axes, edge: Edge, begin: Array, way: Array, target: str) -> None:
    """An arrow that leaves a gait, or leads back to its node: the target stands at its end."""
    _arrow(axes, edge, begin + _NODE * way, begin + (_NODE + _STUB) * way, 0.0)
    sides = {-1: ("right", "top"), 0: ("center", "center"), 1: ("left", "bottom")}
    (across, _), (_, up) = (sides[int(np.sign(np.round(part, 1)))] for part in way)
    text = f"{edge_label(edge)}\nto {mathtext(target)}"
    _label(axes, edge, begin + (_NODE + _STUB + 0.1) * way, text, (across, up))


def _label(axes: Axes, edge: Edge, place: Array, text: str, side: tuple[str, str]) -> None:
    color = _SECTION if edge.section else _INK
    shown = axes.text(place[0], place[1], text, fontsize=_FONT - 1, color=color, zorder=5)
    shown.set(ha=side[0], va=side[1], bbox={"facecolor": _PANEL, "edgecolor": "none", "pad": 0.5})


def _draw_legend(axes: Axes, automaton: Automaton) -> None:
    phases = dict.fromkeys(node.phase for node in automaton.nodes)
    sections = dict.fromkeys(e.event for _, _, e in successions(automaton) if e.section)
    names = " or ".join(in_words(event.name) for event in sections)
    handles = [
        *(Patch(facecolor=_PHASES[p][0], edgecolor=_INK, label=_PHASES[p][1]) for p in phases),
        Line2D([], [], color=_INK, linewidth=1.2, label="guard (reset of the toes)"),
        Line2D([], [], color=_SECTION, linewidth=2.2, label=f"section: {names} ends the stride"),
    ]
    axes.legend(handles=handles, loc="lower center", ncols=5, frameon=False, fontsize=_FONT)
