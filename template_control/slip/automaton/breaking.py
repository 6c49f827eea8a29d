"""Where a walk can break into a run: nodes of another stride in which the same legs stand."""

from __future__ import annotations

from collections.abc import Mapping

RUN_ON: Mapping[str, tuple[str, ...]] = {
    "SS_av^w": ("SS_av^wr", "SS_sd^wr"),
    "DS_sc^w": ("DS_sc^wr", "DS_sd^wr"),
    "DS_sd^w": ("DS_sd^wr",),
    "SS_bv^w": ("SS_sc^wr", "SS_sd^wr"),
}
"""By a walking node: where the walk-to-run stride can go on from there.

The single stance of a walk is as well that of the leg which the run pushes off with: before its
bottom or after it. Before touchdown the walk-to-run stride may also begin as it always does.
"""
