"""Where a walk can break into a run: nodes of another stride in which the same legs stand."""

from __future__ import annotations

from collections.abc import Mapping

_ALONE = ("SS_av^wr", "SS_sc^wr", "SS_sd^wr")
_BOTH = ("DS_sc^wr", "DS_sd^wr")

RUN_ON: Mapping[str, tuple[str, ...]] = {
    "SS_av^w": _ALONE,
    "DS_sc^w": _BOTH,
    "DS_sd^w": _BOTH[1:],
    "SS_bv^w": _ALONE,
    "SS_av^wr": _ALONE,
    "DS_sc^wr": _BOTH,
    "DS_sd^wr": _BOTH[1:],
    "SS_sc^wr": _ALONE,
    "SS_sd^wr": _ALONE,
}
"""By node: where the walk-to-run stride can go on from there.

The leg of a single stance may push off, before its bottom or after it; or the other one lands
first, as the stride always begins.
"""
