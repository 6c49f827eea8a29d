"""The paper's tables and figures, ours beside the paper's."""

from __future__ import annotations

from collections.abc import Callable

from template_control.paper.example_one import fig10
from template_control.paper.example_two import fig12, fig13
from template_control.paper.map_errors import fig5, table3
from template_control.paper.reproduction import Reproduction
from template_control.paper.stability import fig8, fig9
from template_control.paper.transitions import fig6, fig7, table4

REPRODUCTIONS: dict[str, Callable[[], Reproduction]] = {
    "table3": table3,
    "fig5": fig5,
    "table4": table4,
    "fig6": fig6,
    "fig7": fig7,
    "fig8": fig8,
    "fig9": fig9,
    "fig10": fig10,
    "fig12": fig12,
    "fig13": fig13,
}
"""By the name ``template-control reproduce`` knows them by."""
