"""Scenarios in TOML files."""

from __future__ import annotations

import tomllib
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from template_control.checks.checked import checked
from template_control.errors import ScenarioError, TemplateControlError
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.scenario import Scenario, Segment


@checked
def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario from a TOML file with the attributes' names as keys.

    ``[parameters]`` holds the template, each ``[[segment]]`` a :class:`Segment`; ``map`` is
    the map's name in lower case.

    Raises:
        ScenarioError: naming the file and what is wrong in it.
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ScenarioError(f"cannot read {path}: {error.strerror}; give a TOML file") from None
    except (ValueError, RecursionError) as error:  # of the parser, of UTF-8, of dates, of numbers
        raise ScenarioError(f"{path} is no TOML: {error}") from None
    try:
        return _scenario(data)
    except TemplateControlError as error:
        text = str(error).replace("Scenario.", "").replace("SlipParameters.", "parameters.")
        raise ScenarioError(f"{path}: {text}") from None


def _scenario(data: dict[str, Any]) -> Scenario:
    known = {f.name for f in fields(Scenario)} - {"segments", "map_kind"} | {"segment", "map"}
    _known_keys("the scenario", data, known)
    arguments: dict[str, Any] = {k: v for k, v in data.items() if k not in ("segment", "map")}
    if "map" in data:
        names = {kind.name.lower(): kind for kind in MapKind}
        if data["map"] not in tuple(names):  # an array cannot be looked up
            raise ScenarioError(f"map is {data['map']!r}: give one of {', '.join(names)}")
        arguments["map_kind"] = names[data["map"]]
    if "parameters" in data:
        _known_keys("[parameters]", data["parameters"], {f.name for f in fields(SlipParameters)})
        arguments["parameters"] = SlipParameters(**data["parameters"])
    segments = data.get("segment", [])
    if not isinstance(segments, list):
        raise ScenarioError("segment is a single table: write [[segment]] with two brackets")
    for i, segment in enumerate(segments, 1):
        _known_keys(f"segment {i}", segment, {f.name for f in fields(Segment)})
        for f in fields(Segment):
            if f.default is MISSING and f.name not in segment:
                raise ScenarioError(f"segment {i} has no {f.name}: give one")
    return Scenario(
        segments=tuple(_segment(i, table) for i, table in enumerate(segments, 1)), **arguments
    )


def _segment(number: int, table: dict[str, Any]) -> Segment:
    try:
        return Segment(**table)
    except ScenarioError as error:
        raise ScenarioError(str(error).replace("Segment.", f"segment {number} ")) from None


def _known_keys(where: str, table: Any, known: set[str]) -> None:
    if not isinstance(table, dict):
        raise ScenarioError(f"{where} is {table!r}: give a table")
    for key in table:
        if key not in known:
            raise ScenarioError(
                f"{where} has an unknown key {key!r}: known are {', '.join(sorted(known))}"
            )
