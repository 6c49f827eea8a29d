"""Figure of the hybrid automaton (Fig. 2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Patch
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from template_control.slip.automaton.hybrid import Automaton, Edge
from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset, StrideKind

Array = NDArray[np.float64]

PAD = 1.2
"""Space about the centres of a gait's nodes, in drawing units."""

_PITCH, _ROW = 2.85, 3.5  # of nodes, and of rows


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


def layout(automaton: Automaton) -> dict[str, Array]:
    """Centre of every node, shape (2,), drawing units.

    A gait that returns to itself is a circle, at the left and the right in turn, its start
    facing the middle. The others are rows between: above if they lead to the right, else
    below, from the side they start on; below too if they begin or end at a lower circle.
    """
    members = gaits(automaton)
    ends = [
        (automaton.node(a).gait, automaton.node(b).gait)
        for a, b, edge in successions(automaton)
        if edge.section
    ]
    cycles = [gait for gait in members if (gait, gait) in ends]
    rows = [gait for gait in members if gait not in cycles]
    half = 0.5 * _PITCH * (max((len(members[g]) for g in rows), default=1) - 1)
    centre: dict[str, Array] = {}
    depth = [0.0, 0.0]
    for i, gait in enumerate(cycles):
        count = len(members[gait])
        radius = max(2.0, _PITCH * count / (2 * np.pi))
        side = -1 if i % 2 == 0 else 1
        middle = np.array([side * (half + 2 * PAD + 0.9 + radius), depth[i % 2]])
        depth[i % 2] -= 2 * (radius + PAD) + 1.0
        for j, name in enumerate(members[gait]):
            angle = 2 * np.pi * j / count + (0.0 if side < 0 else np.pi)
            centre[name] = middle + radius * np.array([np.cos(angle), np.sin(angle)])
    came_from = {b: a for a, b in choices(automaton)}
    level = {1: 0, -1: 0}
    for gait in rows:
        names = members[gait]
        source = centre.get(came_from.get(names[0], ""))
        way = 1 if source is None or source[0] < 0 else -1
        last = automaton.node(names[-1])
        goal = next((centre[str(e.target)] for e in last.edges if e.target in centre), None)
        across = goal is None or goal[0] * way > 0.0
        through = len(names) > 1 and any(e.section for e in last.edges) and across
        pitch = 2 * half / (len(names) - 1) if through else _PITCH
        low = any(end is not None and end[1] < -_ROW for end in (source, goal))
        side = -1 if low else way
        height = side * _ROW * (0.5 + level[side])
        level[side] += 1
        for j, name in enumerate(names):
            centre[name] = np.array([way * (j * pitch - half), height])
    return centre


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
_INK, _SECTION, _CHOICE, _PANEL = "#3a3f45", "#b3202a", "#8a9099", "#f9f9f7"
# Lengths in drawing units; _INCH inches each.
_INCH, _NODE = 0.58, 0.66
_TITLE, _GAP = 0.35, 0.12
_AROUND = 0.95  # height of an arrow that goes around nodes
_FONT = 11.0
_SAMPLES = np.linspace(0.0, 1.0, 41)


def mathtext(name: str) -> str:
    """A node's or guard's name as in the paper: ``"SS_sc^w"`` is ``"$SS_{sc}^{w}$"``."""
    stem, _, gait = name.partition("^")
    base, _, sub = stem.partition("_")
    text = base + (f"_{{{sub}}}" if sub else "") + (f"^{{{gait}}}" if gait else "")
    return f"${text}$"


def edge_label(edge: Edge) -> str:
    """Guard and, on lines of their own, the section it is and the reset it brings."""
    lines = [mathtext(edge.guard) if edge.guard else words(edge.event)]
    if edge.section:
        lines.append(words(edge.event))
    if edge.reset is not Reset.NONE:
        lines.append(words(edge.reset))
    return "\n".join(lines)


def words(name: Event | Reset) -> str:
    """An event or a reset in words: ``"rear liftoff"``, ``"place front"``, ``"VLO"``."""
    return name.name if name is Event.VLO else name.name.lower().replace("_", " ")


def _route(start: Array, end: Array, bend: float, outward: Array) -> Array:
    """Control points, shape (3, 2), of the quadratic Bezier arrow from circle to circle.

    It is bent to the left by ``bend`` of their distance; from a circle to itself it is a loop
    on the ``outward`` side.
    """
    span = end - start
    distance = float(np.linalg.norm(span))
    if distance == 0.0:
        side = np.array([-outward[1], outward[0]])
        rims = [start + _NODE * (0.8 * outward + s * 0.6 * side) for s in (-1.0, 1.0)]
        return np.array([rims[0], start + 2.6 * _NODE * outward, rims[1]])
    control = 0.5 * (start + end) + bend * np.array([-span[1], span[0]])
    aims = [(control - point) / np.linalg.norm(control - point) for point in (start, end)]
    rim = _NODE + 0.04
    return np.array([start + rim * aims[0], control, end + rim * aims[1]])


def _hides(a: str, b: str, centre: dict[str, Array]) -> bool:
    """True if the straight line from ``a`` to ``b`` passes through another node."""
    span = centre[b] - centre[a]
    others = np.array([point - centre[a] for name, point in centre.items() if name not in (a, b)])
    if a == b or not others.size:
        return False
    share = np.clip(others @ span / (span @ span), 0.0, 1.0)
    return bool(np.any(np.linalg.norm(others - share[:, None] * span, axis=1) < _NODE))


def _along(arrow: Array, t: Array) -> tuple[Array, Array]:
    """Points of ``arrow`` and unit vectors to its left, each (n, 2), at ``t`` in [0, 1]."""
    a, b, c = arrow
    t = t[:, None]
    d = (1 - t) * (b - a) + t * (c - b)
    left = np.stack((-d[:, 1], d[:, 0]), axis=1) / np.linalg.norm(d, axis=1)[:, None]
    return (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c, left


def automaton_figure(automaton: Automaton) -> Figure:
    """Fig. 2 of the paper from ``automaton``; failures are left out.

    Circles are nodes, grouped by gait and coloured by phase; arrows are edges with guard,
    section and reset. Grey dotted lines lead to starts that may be chosen at a section.
    """
    centre = layout(automaton)
    points = np.array(list(centre.values()))
    low, high = points.min(axis=0) - PAD - 0.3, points.max(axis=0) + PAD + _TITLE + 0.3
    low[1] -= 0.9  # the legend
    width, height = _INCH * (high - low)
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_axis_off()
    FigureCanvasAgg(figure)  # its renderer measures the texts
    legend = _draw_legend(axes, automaton)
    figure.draw_without_rendering()  # puts the legend in its place
    texts = [*_draw_panels(axes, automaton, centre), *_draw_nodes(axes, automaton, centre)]
    _draw_edges(axes, automaton, centre, [_room(artist) for artist in (legend, *texts)])
    return figure


def _draw_panels(axes: Axes, automaton: Automaton, centre: dict[str, Array]) -> Iterator[Text]:
    """A titled box around each gait, dashed for the one only a controller sees."""
    for gait, names in gaits(automaton).items():
        points = np.array([centre[name] for name in names])
        low, high = points.min(axis=0) - PAD, points.max(axis=0) + PAD
        high[1] += _TITLE
        width, height = high - low
        box = FancyBboxPatch((low[0], low[1]), width, height, zorder=0)
        box.set_boxstyle("round,pad=0,rounding_size=0.3")
        box.set(facecolor=_PANEL, edgecolor="0.75", linestyle=_line(gait))
        axes.add_patch(box)
        title = GAIT_NAMES.get(gait, f"gait {gait}")
        text = axes.text(low[0] + 0.25, high[1] - 0.18, title, fontsize=_FONT + 1, va="top")
        text.set(fontweight="bold", color=_INK)
        yield text


def _line(gait: str) -> str:
    return "--" if gait.endswith("*") else "-"


def _draw_nodes(axes: Axes, automaton: Automaton, centre: dict[str, Array]) -> Iterator[Text]:
    for node in automaton.nodes:
        x, y = centre[node.name]
        circle = Circle((x, y), _NODE, facecolor=_PHASES[node.phase][0], zorder=3)
        circle.set(edgecolor=_INK, linestyle=_line(node.gait))
        axes.add_patch(circle)
        text = axes.text(x, y, mathtext(node.name), fontsize=_FONT + 1, zorder=4)
        text.set(ha="center", va="center")
        yield text


def _draw_edges(
    axes: Axes, automaton: Automaton, centre: dict[str, Array], taken: list[Bbox]
) -> None:
    """Arrows first, then each label where it hides least."""
    edges = list(successions(automaton))
    pairs = [(a, b) for a, b, _ in edges]
    arrows, around = [], 0
    for i, (a, b, edge) in enumerate(edges):
        same = pairs[:i].count((a, b))
        bend = 0.18 * (same + (a != b and (b, a) in pairs))
        if _hides(a, b, centre):
            around += 1
            bend += (-1) ** around * 2.0 * _AROUND / np.linalg.norm(centre[b] - centre[a])
        gait = [centre[n] for n in gaits(automaton)[automaton.node(a).gait]]
        # A gait of one node has its own loop face the middle, where there is room.
        away = centre[a] - np.mean(gait, axis=0) - 1e-9 * centre[a]
        arrow = _route(centre[a], centre[b], bend, away / np.linalg.norm(away))
        arrows.append(arrow)
        color = _SECTION if edge.section else _INK
        _draw_arrow(axes, arrow, color, 2.2 if edge.section else 1.2, "-")
    others = [_route(centre[a], centre[b], 0.14, np.zeros(2)) for a, b in choices(automaton)]
    for other in others:
        _draw_arrow(axes, other, _CHOICE, 1.2, ":")
    curves = [_along(arrow, _SAMPLES)[0] for arrow in (*arrows, *others)]
    outlines = [
        patch.get_transform().transform_path(patch.get_path()).to_polygons()[0]
        for patch in axes.patches
        if not isinstance(patch, FancyArrowPatch)
    ]
    finer = [Path(outline).interpolated(40).vertices for outline in outlines]
    ink = np.concatenate((axes.transData.transform(np.concatenate(curves)), *finer))
    for arrow, (_, _, edge) in zip(arrows, edges, strict=True):
        text = axes.text(0.0, 0.0, edge_label(edge), fontsize=_FONT - 1, linespacing=1.25)
        color = _SECTION if edge.section else _INK
        text.set(color=color, ha="center", va="center", zorder=5)
        _place(axes, text, arrow, ink, taken)
        taken.append(_room(text))


def _room(artist: Artist) -> Bbox:
    """The box that ``artist`` takes on the page, and a little around it."""
    return artist.get_window_extent().padded(6.0)


def _draw_arrow(axes: Axes, arrow: Array, color: str, width: float, line: str) -> None:
    path = Path(arrow, [Path.MOVETO, Path.CURVE3, Path.CURVE3])
    patch = FancyArrowPatch(path=path, arrowstyle="-|>", mutation_scale=11 + width)
    patch.set(linewidth=width, linestyle=line, color=color, zorder=2)
    axes.add_patch(patch)


def _place(axes: Axes, text: Text, arrow: Array, ink: Array, taken: list[Bbox]) -> None:
    """Put ``text`` next to ``arrow`` where it covers the least ink and nothing ``taken``."""
    data, page = axes.transData, axes.bbox
    corner = data.inverted().transform(text.get_window_extent().get_points())
    half = 0.5 * (corner[1] - corner[0])
    shares = np.array([0.5, 0.4, 0.6, 0.3, 0.7])
    points, left = _along(arrow, shares)
    normals = np.concatenate((left, -left))
    spots = np.tile(points, (2, 1)) + normals * (_GAP + np.abs(normals) @ half)[:, None]
    costs = []
    for spot, share in zip(spots, np.tile(shares, 2), strict=True):
        box = Bbox(data.transform([spot - half - 0.04, spot + half + 0.04]))
        covered = np.all((ink > box.min) & (ink < box.max), axis=1).sum()
        outside = not (page.contains(*box.min) and page.contains(*box.max))
        clashes = box.count_overlaps(taken) + outside
        costs.append(covered + 1e4 * clashes + abs(share - 0.5))
    text.set_position(tuple(spots[int(np.argmin(costs))]))


def _draw_legend(axes: Axes, automaton: Automaton) -> Legend:
    phases = dict.fromkeys(node.phase for node in automaton.nodes)
    sections = dict.fromkeys(e.event for _, _, e in successions(automaton) if e.section)
    names = " or ".join(words(event) for event in sections)
    handles = [
        *(Patch(facecolor=_PHASES[p][0], edgecolor=_INK, label=_PHASES[p][1]) for p in phases),
        Line2D([], [], color=_INK, linewidth=1.2, label="guard (reset of the toes)"),
        Line2D([], [], color=_SECTION, linewidth=2.2, label=f"section: {names} ends the stride"),
    ]
    if choices(automaton):
        label = "a stride may start here instead"
        handles.append(Line2D([], [], color=_CHOICE, linewidth=1.2, linestyle=":", label=label))
    return axes.legend(handles=handles, loc="lower center", ncols=3, frameon=False, fontsize=_FONT)
