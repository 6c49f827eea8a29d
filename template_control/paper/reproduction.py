"""What a reproduction of a table or figure yields."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from matplotlib.figure import Figure


@dataclass(frozen=True)
class Reproduction:
    """A table with the paper's numbers beside ours, and figures.

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
