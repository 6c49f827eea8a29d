"""A terrain as what a physics engine puts together: a plane, and boxes that stand out of it."""

from __future__ import annotations

from itertools import pairwise
from math import atan2, cos, hypot, sin
from typing import NamedTuple

from template_control.plant.terrain.terrain import Terrain

_END = 2000.0  # length of the level parts at both ends [m]
_DEPTH = 1.0  # of the boxes below the lowest ground [m]
_HALF_WIDTH = 1.0  # across the way [m]
# Thickness of a slope's plate [m]. Where a slope ends at a wall, its lower edge stands out of that
# by this times the slope's sine.
_PLATE = 0.02


class Piece(NamedTuple):
    """A box of ground.

    Attributes:
        centre: x, y across the way, and height [m].
        half_sides: along its own axes [m].
        pitch: its turn about +y, forward down positive [rad].
        friction: its coefficient; None: that of the plant's options.
    """

    centre: tuple[float, float, float]
    half_sides: tuple[float, float, float]
    pitch: float
    friction: float | None


def pieces(terrain: Terrain) -> tuple[float, list[Piece]]:
    """Height of a plane, and the boxes of ground that stand out of it.

    Args:
        terrain: whose ground.

    Returns:
        The height, which is the ground's lowest where its friction is everywhere the same; and
        the boxes in the order of x: one for a level line, for a slope a plate and one below it.
    """
    lowest = min(y for _, y in terrain.points)
    base = lowest - _DEPTH
    plane = base if terrain.friction else lowest
    found = []
    for (a, low), (b, high), friction in _lines(terrain):
        if max(low, high) <= plane:
            continue
        top = low
        if low != high:
            found.append(_plate((a, low), (b, high), friction))
            top = min(low, high) - _PLATE
        centre = (0.5 * (a + b), 0.0, 0.5 * (top + base))
        half_sides = (0.5 * (b - a), _HALF_WIDTH, 0.5 * (top - base))
        found.append(Piece(centre, half_sides, 0.0, friction))
    return plane, found


_Point = tuple[float, float]


def _plate(begin: _Point, end: _Point, friction: float | None) -> Piece:
    """A thin box whose upper side is the line between two points."""
    along, up = end[0] - begin[0], end[1] - begin[1]
    angle = atan2(up, along)
    x = 0.5 * (begin[0] + end[0]) + 0.5 * _PLATE * sin(angle)
    z = 0.5 * (begin[1] + end[1]) - 0.5 * _PLATE * cos(angle)
    half_sides = (0.5 * hypot(along, up), _HALF_WIDTH, 0.5 * _PLATE)
    return Piece((x, 0.0, z), half_sides, -angle, friction)


def _lines(terrain: Terrain) -> list[tuple[_Point, _Point, float | None]]:
    """The lines of the ground that are no walls, cut where friction changes."""
    (first, begin), (last, end) = terrain.points[0], terrain.points[-1]
    ground = ((first - _END, begin), *terrain.points, (last + _END, end))
    cuts = [x for x, _ in terrain.friction]
    found = []
    for (a, low), (b, high) in pairwise(ground):
        if a == b:
            continue  # a wall: the side of its neighbour
        places = [a, *(x for x in cuts if a < x < b), b]
        heights = [low + (high - low) * (x - a) / (b - a) for x in places]
        ends = list(zip(places, heights, strict=True))
        found += [(p, q, _friction(terrain, p[0])) for p, q in pairwise(ends)]
    return found


def _friction(terrain: Terrain, x: float) -> float | None:
    """Of the ground from ``x`` on."""
    before = [friction for place, friction in terrain.friction if place <= x]
    return before[-1] if before else None
