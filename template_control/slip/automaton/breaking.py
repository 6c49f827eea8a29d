"""Where a walk can break into a run: nodes of another stride in which the same legs stand."""

from __future__ import annotations

from collections.abc import Mapping

RUN_ON: Mapping[str, str] = {
    "SS_av^w": "SS_av^wr",
    "DS_sc^w": "DS_sc^wr",
    "DS_sd^w": "DS_sd^wr",
    "SS_bv^w": "SS_av^wr",
    "SS_av^wp": "SS_av^wr",
    "DS_sc^wp": "DS_sc^wr",
    "DS_sd^wp": "DS_sd^wr",
    "SS_bv^wp": "SS_av^wr",
}
"""By a walking node: where the walk-to-run stride goes on from there.

In single stance the other foot lands next, whether VLO is past or not.
"""
