"""What a run in space has to tell beside what any run has."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.run.kinds.free_record import FreeRecord
from template_control.slip.automaton.vocabulary import Phase

Array = NDArray[np.float64]

_ANGLES = ("roll", "pitch", "yaw")


def in_space(record: FreeRecord) -> dict[str, Any]:
    """How the trunk stood, where the walk went, and how wide its steps were.

    Args:
        record: the run.

    Returns:
        attitude_rms and attitude_max (roll, pitch, yaw in the heading frame [rad]), turned
        (of the heading [rad]), mean_yaw_drift (of the trunk's mean yaw in the heading frame, from
        the first to the last quarter of the run, over 100 steps [rad]), step_width (mean, standard
        deviation, least [m]; None without a double stance).
    """
    angles = record.attitude
    rms, most = np.sqrt(np.mean(angles**2, axis=0)), np.abs(angles).max(axis=0)
    quarter = max(len(angles) // 4, 1)
    drift = float(np.mean(angles[-quarter:, 2]) - np.mean(angles[:quarter, 2]))
    hundreds = 0.75 * max(record.steps, 1) / 100.0
    widths = step_widths(record)
    width = (
        {"mean": widths.mean(), "deviation": widths.std(), "least": widths.min()}
        if len(widths)
        else None
    )
    return {
        "attitude_rms": dict(zip(_ANGLES, rms.tolist(), strict=True)),
        "attitude_max": dict(zip(_ANGLES, most.tolist(), strict=True)),
        "turned": float(record.heading[-1] - record.heading[0]),
        "mean_yaw_drift": drift / hundreds,
        "step_width": None if width is None else {k: float(x) for k, x in width.items()},
    }


def step_widths(record: FreeRecord) -> Array:
    """(n,) distance aside between the feet in each double stance, left less right [m].

    Args:
        record: the run.
    """
    double = np.array([phase == Phase.DS.name for phase in record.metadata["phases"]])[record.node]
    begun = np.flatnonzero(np.diff(double.astype(np.int8)) == 1) + 1
    apart = record.space_foot[begun, 0, :2] - record.space_foot[begun, 1, :2]
    angle = record.heading[begun]
    return np.asarray(np.cos(angle) * apart[:, 1] - np.sin(angle) * apart[:, 0])
