"""Where one stride can break into another: the same legs stand in the nodes of both."""

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

_BOTH_STAND = ("DS_sc^w", "DS_sd^w", "DS_sc^wp", "DS_sd^wp")
_BEFORE_VLO = ("SS_bv^w", "SS_bv^wp")

BREAKS: Mapping[str, Mapping[str, str]] = {
    "wr": RUN_ON,
    "ww": dict.fromkeys(_BOTH_STAND, "DS_bl^ww"),
    "ws": dict.fromkeys(_BOTH_STAND, "DS_br^ws"),
    "sb": dict.fromkeys(_BEFORE_VLO, "SS_bt^sb"),
}
"""By the kind of a stride that a walk can break into: from which nodes, and where it goes on.

The last three are of a slow walk, whose springs would throw it back. A curve in time carries the
CoM while both feet stand, on or to rest; the foot that is up is set down behind again.
"""

STEP_OUT: Mapping[str, tuple[str, ...]] = {
    "DS_ar^s": ("sf", "sb"),
    "DS_br^ws": ("sf", "sb"),
    "DS_br^sf": ("sf", "sb"),
}
"""By a node in which both feet stand: strides with a step, where the CoM cannot come to rest."""
