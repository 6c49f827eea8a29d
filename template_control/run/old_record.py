"""Records of earlier versions.

Format 2 knew one section, VLO, and one stride, the walking step; format 3 knew no push-off; with
format 4 planners took every target as it was.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.scenario.record import padded_controls

RENAMED = {
    "vlo_time": "section_time",
    "vlo_state": "section_state",
    "vlo_predicted": "section_predicted",
    "vlo_controls": "section_controls",
    "vlo_offset": "section_offset",
    "vlo_reached": "section_nominal",
    "vlo_feasible": "section_feasible",
    "vlo_load": "section_load",
    "vlo_trim": "section_trim",
}
"""Fields of format 2, as they are called now."""


def from_taken(fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a record as they are now, from those of format 4.

    Args:
        fields: arrays and the metadata by their names.

    Raises:
        KeyError: if one of them is missing.
    """
    return {**fields, "section_accepted": np.array(fields["section_target"])[:, 0].copy()}


def from_five_slots(fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a record as they are now, from those of format 3.

    Args:
        fields: arrays and the metadata by their names.

    Raises:
        KeyError: if one of them is missing.
    """
    now = {**fields, "section_controls": padded_controls(fields["section_controls"])}
    return from_taken(now)


def from_walk(fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a record as they are now, from those of format 2.

    Args:
        fields: arrays and the metadata by the names of format 2.

    Raises:
        KeyError: if one of them is missing.
    """
    now = {RENAMED.get(name, name): value for name, value in fields.items()}
    metadata = dict(now["metadata"])
    count = len(now["section_time"])
    target = np.array(metadata["gait_vlo"])
    metadata["gait_state"] = metadata.pop("gait_vlo")
    metadata["sections"], metadata["strides"] = ["VLO"], ["w"]
    nodes = [AUTOMATON.node(name) for name in metadata["nodes"]]
    metadata["phases"] = [node.phase.name for node in nodes]
    metadata["stiffness_slots"] = [[node.rear, node.front] for node in nodes]
    both = np.full((len(now["time"]), 2, 2), np.nan)
    both[np.arange(len(both)), 1 - now["rear"]] = now["swing_reference"]
    now["swing_reference"] = both
    now["metadata"] = metadata
    now["section"] = now["stride"] = np.zeros(count, dtype=np.int64)
    now["section_target"] = np.tile(target, (count, 1))
    return from_five_slots(now)
