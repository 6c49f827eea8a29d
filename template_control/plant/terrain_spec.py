"""Terrain from a line of text or a file."""

from __future__ import annotations

from collections.abc import Callable
from math import radians
from pathlib import Path
from typing import Annotated, Any

from template_control import settings
from template_control.checks.checked import checked
from template_control.checks.ranges import Count, Index, NotNegative, Positive, Range
from template_control.checks.typed import entries, number
from template_control.errors import ParameterError
from template_control.plant.terrain import Height, Start, Terrain

KINDS: dict[str, dict[str, Any]] = {
    "flat": {},
    "step": {"height": Height, "x": Start},
    "stairs": {"rise": Height, "run": Positive, "count": Count, "start": Start},
    "slope": {"angle": Annotated[float, Range(-45.0, 45.0)], "start": Start, "length": Positive},
    "random": {
        "height": NotNegative, "shortest": Positive, "longest": Positive, "seed": Index,
        "start": Start, "end": Start,
    },
}  # fmt: skip
"""Numbers of each kind of terrain on the command line; angles are in degrees."""

_MAKERS: dict[str, Callable[..., Terrain]] = {
    "flat": Terrain.flat,
    "step": Terrain.step,
    "stairs": Terrain.stairs,
    "slope": Terrain.slope,
    "random": Terrain.random_steps,
}
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
    known = ", ".join(KINDS[kind]) or "no number"
    given: dict[str, Any] = {}
    for key, value in entries(where, filter(None, rest.split(",")), "NAME=NUMBER").items():
        if key not in KINDS[kind]:
            raise ParameterError(f"{where}: {kind} takes {known}, and not {key!r}")
        given[key] = number(f"{where}: {key}", value, KINDS[kind][key])
    return _made(where, kind, given)


def _made(where: str, kind: str, given: dict[str, Any]) -> Terrain:
    if "angle" in given:
        given["angle"] = radians(given["angle"])
    if "shortest" in given or "longest" in given:
        given["length"] = (given.pop("shortest", _SHORTEST), given.pop("longest", _LONGEST))
    try:
        return _MAKERS[kind](**given)
    except TypeError:
        known = ", ".join(KINDS[kind])
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
    except OSError as error:
        raise ParameterError(f"cannot read {path}: {error.strerror}; give a terrain") from None
    except UnicodeDecodeError:
        raise ParameterError(f"{path} is no text: give x and height in two columns") from None
    try:
        rows = [tuple(map(float, line.replace(",", " ").split())) for line in _lines(text)]
    except ValueError as error:
        raise ParameterError(f"{path}: {error}: give x and height in two columns") from None
    if any(len(row) != 2 for row in rows):
        raise ParameterError(f"{path} has other than two columns: give x and height in each line")
    try:
        return Terrain(tuple((row[0], row[1]) for row in rows))
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def _lines(text: str) -> list[str]:
    """Those that hold something, without remarks behind a #."""
    bare = (line.partition("#")[0].strip() for line in text.splitlines())
    return [line for line in bare if line]
