"""The figures of a run that a table or ``--json`` shows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.checked import checked
from template_control.run.record import Record

Array = NDArray[np.float64]


def _state(z: Array) -> dict[str, float]:
    return {"speed": float(z[0]), "height": float(z[1]), "vertical_speed": float(z[2])}


def _speed_error(record: Record) -> float | None:
    """Root mean square of dx/dt at the sections less what the stride was to end in [m/s]."""
    error = record.section_state[1:, 0] - record.section_target[:-1, 0]
    return float(np.sqrt(np.mean(error**2))) if error.size else None


def _quantiles(seconds: Array) -> dict[str, float]:
    median, p99 = np.percentile(seconds, [50, 99])
    return {"median": float(median), "p99": float(p99)}


@checked
def summarise(record: Record, path: str) -> dict[str, Any]:
    """Summary of a run in SI units.

    Args:
        record: the run.
        path: where it was saved.

    Returns:
        robot, gait, steps, fell, fall_reason, duration, mean_speed, vlo_target and
        vlo_mean_last_50 (speed, height, vertical_speed), speed_error_rms (of dx/dt where
        strides end, against their targets), com_error_rms and com_error_max
        (x, y), joint_torque (per joint peak, rms, limit), saturated_share, qp_failures,
        control_tick_seconds and qp_solve_seconds (median, p99), plan_seconds (median, p99),
        real_time_factor, steps_not_nominal (plans that left the planner's own law), record.
    """
    m = record.metadata
    duration = m["duration"]
    walked = float(record.com[-1, 0] - record.com[0, 0])
    return {
        "robot": m["robot"],
        "gait": m["gait"],
        "steps": record.steps,
        "fell": record.fell,
        "fall_reason": m["fall_reason"] or None,
        "duration": duration,
        "mean_speed": walked / max(float(record.time[-1]), 1e-9),
        "vlo_target": _state(record.section_target[-1]),
        "vlo_mean_last_50": _state(record.section_state[1:][-50:].mean(axis=0))
        if record.steps
        else None,
        "speed_error_rms": _speed_error(record),
        **m["summary"],
        "control_tick_seconds": _quantiles(record.tick_seconds),
        "qp_solve_seconds": _quantiles(record.solve_seconds),
        "plan_seconds": _quantiles(record.plan_seconds),
        "real_time_factor": duration / m["wall_seconds"],
        "steps_not_nominal": int(np.sum(~record.section_nominal)),
        "record": path,
    }
