"""Ground unknown to the controller: its height along x, and the boxes that engines make of it.

It is made by methods, or from a line of text or a file.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import atan2, cos, hypot, radians, sin, tan
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from template_control import settings
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Count, Index, NotNegative, Positive, Range, Rising, Share
from template_control.checks.typed import entries, number
from template_control.errors import ParameterError
from template_control.slip.gaits.gait import WalkingGait

_HIGHEST = 1000.0  # [m]
_FARTHEST = 1000.0  # [m]
_STEEPEST = float(np.radians(45.0))
_LEVEL = 1e-9  # [m] the ground is at height 0 where a run begins
_MOST_POINTS = 100_000
_END = 2000.0  # length of the level parts at both ends [m]
_DEPTH = 1.0  # of the boxes below the lowest ground [m]
_HALF_WIDTH = 1.0  # across the way [m]
# Thickness of a slope's plate [m]. Where a slope ends at a wall, its lower edge stands out of that
# by this times the slope's sine.
_PLATE = 0.02

Height = Annotated[float, Range(-_HIGHEST, _HIGHEST)]
Place = Annotated[float, Range(-_FARTHEST, _FARTHEST)]
Start = Annotated[float, Range(0.0, _FARTHEST, above=True)]
Points = tuple[tuple[Place, Height], ...]


class Closest(NamedTuple):
    """The ground's surface seen from a point."""

    distance: float  # [m], negative inside the ground
    normal: tuple[float, float]  # x and y of unit length, from its closest point, out of the ground


@dataclass(frozen=True)
class Terrain(Checked):
    """Ground that goes in straight lines from point to point.

    Before the first point and beyond the last one it is level. Two points at the same x are a
    wall. The constructor takes the points; :meth:`flat`, :meth:`step`, :meth:`at_step`,
    :meth:`stairs`, :meth:`slope`, :meth:`random_steps` and :meth:`of_function` make the usual ones.

    Attributes:
        points: x and height of each, x never falling [m]. A run begins with the stance foot at
            x = 0, where the ground must be at height 0.
        friction: (x, coefficient): from x on the ground has that coefficient, up to the next x;
            before the first x that of the plant's options holds [m]. The ideal plant has none.

    Raises:
        ParameterError: if there is no point, x falls, three points have one x, or the ground at
            x = 0 is not at height 0.
    """

    points: Points = ((0.0, 0.0),)
    friction: tuple[tuple[Place, Positive], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.points:
            raise ParameterError("Terrain.points is empty: give at least one")
        _check_count(len(self.points))
        xs = self._xs
        for i, x in enumerate(xs[1:], 1):
            if x < xs[i - 1]:
                raise ParameterError(
                    f"Terrain.points: x falls from {xs[i - 1]:g} to {x:g} m: put them in order"
                )
            if i > 1 and x == xs[i - 2]:
                raise ParameterError(
                    f"Terrain.points: three are at x = {x:g} m: give the wall's two ends alone"
                )
        places = [x for x, _ in self.friction]
        if any(b <= a for a, b in pairwise(places)):
            raise ParameterError("Terrain.friction: x does not rise: put its entries in order")
        start = self.height_at(0.0)
        if abs(start) > _LEVEL:
            raise ParameterError(
                f"Terrain: the ground at x = 0 is at height {start:g} m: take {start:g} from all"
                " heights"
            )

    @cached_property
    def _xs(self) -> list[float]:
        return [x for x, _ in self.points]

    def height_at(self, x: float) -> float:
        """Height of the ground at ``x`` [m]; at a wall that beyond it."""
        xs, points = self._xs, self.points
        after = bisect_right(xs, x)
        if after == 0:
            return points[0][1]
        if after == len(points):
            return points[-1][1]
        (a, low), (b, high) = points[after - 1 : after + 1]
        return low + (high - low) * (x - a) / (b - a)

    def closest(self, x: float, y: float) -> Closest:
        """The surface seen from a point.

        Args:
            x, y: of the point [m].
        """
        above = y - self.height_at(x)
        best, foot, xs = abs(above), (x, y - above), self._xs
        near = slice(max(bisect_left(xs, x - best) - 1, 0), bisect_right(xs, x + best) + 1)
        for (ax, ay), (bx, by) in pairwise(self.points[near]):
            length = (bx - ax) ** 2 + (by - ay) ** 2
            share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length
            share = min(max(share, 0.0), 1.0)
            place = (ax + share * (bx - ax), ay + share * (by - ay))
            distance = hypot(x - place[0], y - place[1])
            if distance < best:
                best, foot = distance, place
        side = 1.0 if above >= 0.0 else -1.0
        if best <= _LEVEL:
            return Closest(side * best, self._normal(x))
        return Closest(side * best, (side * (x - foot[0]) / best, side * (y - foot[1]) / best))

    def line(self, low: float, high: float) -> list[tuple[float, float]]:
        """The ground from one place to another, as points with straight lines between them.

        Args:
            low, high: x of the places [m].
        """
        between = [point for point in self.points if low < point[0] < high]
        return [(low, self.height_at(low)), *between, (high, self.height_at(high))]

    def _normal(self, x: float) -> tuple[float, float]:
        """Of the ground at ``x``, out of it."""
        after = bisect_right(self._xs, x)
        if after in (0, len(self.points)):
            return 0.0, 1.0
        (a, low), (b, high) = self.points[after - 1 : after + 1]
        length = hypot(b - a, high - low)
        return (low - high) / length, (b - a) / length

    @classmethod
    def flat(cls) -> Terrain:
        """Level ground at height 0."""
        return cls()

    @classmethod
    @checked
    def step(cls, height: Height, x: Start) -> Terrain:
        """One step.

        Args:
            height: up positive [m].
            x: of its wall [m].
        """
        return cls(((x, 0.0), (x, height)))

    @classmethod
    @checked
    def at_step(cls, gait: WalkingGait, height: Height, step: Count, share: Share = 0.5) -> Terrain:
        """One step, on which the robot treads with its ``step``-th foothold.

        Args:
            gait: its footholds are at multiples of the step length, the first stance foot
                (number 0) at x = 0.
            height: up positive [m].
            step: number of the first foothold beyond the wall, at least 1.
            share: of the way from the foothold before to that one, where the wall is.
        """
        return cls.step(height, (step - 1 + share) * gait.step_length)

    @classmethod
    @checked
    def stairs(cls, rise: Height, run: Positive, count: Count, start: Start = 1.0) -> Terrain:
        """Steps of one size.

        Args:
            rise: of each, up positive [m].
            run: from one wall to the next [m].
            count: of the walls.
            start: x of the first wall [m].
        """
        _check_count(2 * count)
        walls = [(start + i * run, i * rise) for i in range(count)]
        return cls(tuple(point for x, y in walls for point in ((x, y), (x, y + rise))))

    @classmethod
    @checked
    def slope(
        cls,
        angle: Annotated[float, Range(-_STEEPEST, _STEEPEST)],
        start: Start = 1.0,
        length: Positive = 500.0,
    ) -> Terrain:
        """A slope between two level parts.

        Args:
            angle: up positive [rad].
            start: x where it begins [m].
            length: along x [m].
        """
        return cls(((start, 0.0), (start + length, length * tan(angle))))

    @classmethod
    @checked
    def random_steps(
        cls,
        height: NotNegative,
        length: Annotated[tuple[Positive, Positive], Rising()] = (0.3, 0.6),
        seed: Index = 0,
        start: Start = 0.3,
        end: Start = 200.0,
    ) -> Terrain:
        """Treads whose heights and lengths are drawn evenly, each for itself.

        Args:
            height: treads are between this below 0 and this above it [m].
            length: of the shortest and the longest tread [m].
            seed: of the draws.
            start: x of the first wall [m].
            end: x beyond which no tread begins [m]; the ground there is at height 0.
        """
        if end <= start:
            raise ParameterError(f"end is {end:g} m: give more than the start, {start:g} m")
        _check_count(4.0 * (end - start) / (length[0] + length[1]))
        draw = np.random.default_rng(seed)
        points, x, before = [], start, 0.0
        while x < end:
            tread = float(draw.uniform(-height, height))
            points += [(x, before), (x, tread)]
            before = tread
            x += float(draw.uniform(*length))
        return cls((*points, (x, before), (x, 0.0)))

    @classmethod
    @checked
    def of_function(
        cls, height: Callable[[float], float], end: Start, spacing: Positive = 0.02
    ) -> Terrain:
        """Ground of any shape, in straight lines between its heights at regular places.

        Args:
            height: height at x, both [m]; 0 at x = 0.
            end: the last place; the ground beyond it is level [m].
            spacing: from one place to the next [m].
        """
        _check_count(end / spacing)
        places = np.linspace(0.0, end, max(int(np.ceil(end / spacing)), 1) + 1)
        return cls(tuple((float(x), float(height(float(x)))) for x in places))


def _check_count(points: float) -> None:
    """Refuse ground of more points than an engine takes, before they are made."""
    if points > _MOST_POINTS:
        raise ParameterError(
            f"the ground has about {points:.3g} points: give fewer or longer pieces, of at most"
            f" {_MOST_POINTS} points"
        )


class Piece(NamedTuple):
    """A box of ground."""

    centre: tuple[float, float, float]  # x, y (across the way), and height [m]
    half_sides: tuple[float, float, float]  # along its own axes [m]
    pitch: float  # its turn about +y, forward down positive [rad]
    friction: float | None  # its coefficient; None: that of the plant's options


def pieces(terrain: Terrain) -> tuple[float, list[Piece]]:
    """Height of a plane, and the boxes of ground that stand out of it, in the order of x.

    The plane is at the ground's lowest where its friction is everywhere the same. A level line has
    one box, a slope a plate and a box below it.
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
    cuts = terrain.friction
    found = []
    for (a, low), (b, high) in pairwise(ground):
        if a == b:
            continue  # a wall: the side of its neighbour
        places = [a, *(x for x, _ in cuts if a < x < b), b]
        heights = [low + (high - low) * (x - a) / (b - a) for x in places]
        for begins, ends in pairwise(zip(places, heights, strict=True)):
            friction = next((own for x, own in reversed(cuts) if x <= begins[0]), None)
            found.append((begins, ends, friction))
    return found


_Degrees = Annotated[float, Range(-45.0, 45.0)]
KINDS: dict[str, tuple[Callable[..., Terrain], dict[str, Any]]] = {
    "flat": (Terrain.flat, {}),
    "step": (Terrain.step, {"height": Height, "x": Start}),
    "stairs": (Terrain.stairs, {"rise": Height, "run": Positive, "count": Count, "start": Start}),
    "slope": (Terrain.slope, {"angle": _Degrees, "start": Start, "length": Positive}),
    "random": (
        Terrain.random_steps,
        {"height": NotNegative, "shortest": Positive, "longest": Positive, "seed": Index,
         "start": Start, "end": Start},
    ),
}  # fmt: skip
"""Each kind of terrain on the command line, and its numbers; angles are in degrees."""

_SHORTEST, _LONGEST = 0.3, 0.6  # of random treads [m]


@checked
def terrain_from(text: str) -> Terrain:
    """The terrain that a text describes.

    Args:
        text: a kind of ground with its numbers, such as ``step:height=0.03,x=2.5``,
            ``stairs:rise=0.02,run=0.6,count=5``, ``slope:angle=4``, ``random:height=0.02,seed=3``
            or ``flat``; or the path of a file, see :func:`read_terrain`.

    Raises:
        ParameterError: if there is no such kind, number or file.
    """
    kind, _, rest = text.partition(":")
    if kind not in KINDS:
        if Path(text).suffix:
            return read_terrain(text)
        raise ParameterError(
            f"there is no terrain {text!r}: give {', '.join(KINDS)} with its numbers, such as"
            " step:height=0.03,x=2.5, or a file .toml, .csv or .txt"
        )
    where = f"terrain {text!r}"
    make, numbers = KINDS[kind]
    known = ", ".join(numbers) or "no number"
    given: dict[str, Any] = {}
    for key, value in entries(where, filter(None, rest.split(",")), "NAME=NUMBER").items():
        if key not in numbers:
            raise ParameterError(f"{where}: {kind} takes {known}, and not {key!r}")
        given[key] = number(f"{where}: {key}", value, numbers[key])
    if "angle" in given:
        given["angle"] = radians(given["angle"])
    if "shortest" in given or "longest" in given:
        given["length"] = (given.pop("shortest", _SHORTEST), given.pop("longest", _LONGEST))
    try:
        return make(**given)
    except TypeError:
        raise ParameterError(
            f"{where} lacks a number: {kind} takes {known}, such as step:height=0.03,x=2.5"
        ) from None
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None


@checked
def read_terrain(path: str | Path) -> Terrain:
    """The terrain in a file.

    Args:
        path: of a TOML with the keys ``points`` and ``friction`` of :class:`Terrain`; or of a text
            with x and height [m] in two columns, between them a comma or blanks.

    Raises:
        ParameterError: naming the file, if it cannot be read or holds no ground.
    """
    path = Path(path)
    if path.suffix == ".toml":
        return settings.read(Terrain, path)
    try:
        text = path.read_text(encoding="utf-8-sig")
        lines = (line.partition("#")[0].replace(",", " ").split() for line in text.splitlines())
        rows = [tuple(map(float, line)) for line in lines if line]
    except OSError as error:
        raise ParameterError(f"cannot read {path}: {error.strerror}; give a terrain") from None
    except UnicodeDecodeError:
        raise ParameterError(f"{path} is no text: give x and height in two columns") from None
    except ValueError as error:
        raise ParameterError(f"{path}: {error}: give x and height in two columns") from None
    if any(len(row) != 2 for row in rows):
        raise ParameterError(f"{path} has other than two columns: give x and height in each line")
    try:
        return Terrain(tuple((row[0], row[1]) for row in rows))
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
