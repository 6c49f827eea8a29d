"""Where a walk can break into a run: nodes of another stride in which the same legs stand."""

from __future__ import annotations

from collections.abc import Mapping

RUN_ON: Mapping[str, tuple[str, ...]] = {
    "SS_av^w": ("SS_av^wr",),
    "DS_sc^w": ("DS_sc^wr",),
    "DS_sd^w": ("DS_sd^wr",),
    "SS_bv^w": ("SS_av^wr",),
    **{name:(name,) for name in ("SS_av^wr","F_aa^wr","DS_sc^wr","DS_sd^wr","SS_sc^wr","SS_sd^wr")}
}
