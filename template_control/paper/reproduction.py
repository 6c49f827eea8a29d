"""Result of a reproduction of a table or figure, and the list of reproductions."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

from template_control.slip.automaton.vocabulary import MapKind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAPS = (MapKind.PAPER, MapKind.IMPROVED, MapKind.EXACT)  # whose errors are compared


@dataclass(frozen=True)
class Reproduction:
    """A table with the paper's numbers and ours, and figures.

    Attributes:
        title: what is reproduced.
        columns: of the table.
        rows: of the table.
        data: the numbers, for ``--json``; SI units.
        notes: a sentence for each difference worth one.
        figures: by file name without suffix.
    """

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]
    data: dict[str, Any]
    notes: tuple[str, ...] = ()
    figures: dict[str, Figure] = field(default_factory=dict)


def _reproduce(module: str, name: str, **less: Any) -> Reproduction:
    """Call function ``name`` of ``module``, imported only now: the list itself costs nothing."""
    function = getattr(importlib.import_module(f"{__package__}.{module}"), name)
    found: Reproduction = function(**less)
    return found


_MODULES = {
    "map_errors": ("table3", "fig5"),
    "transitions": ("table4", "fig6", "fig7"),
    "stability": ("fig8", "fig9"),
    "example_one": ("fig10",),
    "example_two": ("fig12", "fig13"),
}

REPRODUCTIONS: dict[str, Callable[..., Reproduction]] = {
    name: partial(_reproduce, module, name) for module, names in _MODULES.items() for name in names
}
"""By the name ``template-control reproduce`` knows them by."""

LONG = {"fig8": 20, "fig9": 30, "fig12": 40, "fig13": 20}
"""Seconds on two cores of those that need more than ten, in tens."""
