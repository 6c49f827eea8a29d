"""Where the nodes of an automaton are drawn, and in which groups."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.hybrid import Automaton, Edge
from template_control.slip.automaton.vocabulary import Outcome

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
