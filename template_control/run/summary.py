"""Summary figures of a run, as a table or ``--json`` shows them."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.run.record import FloatingRecord, Record
from template_control.slip.automaton.vocabulary import Event, Phase, StrideKind
from template_control.slip.maps.section import section_of

STRIDES: dict[str, str] = {
    StrideKind.WALK: "walking",
    StrideKind.WALK_TO_RUN: "walk to run",
    StrideKind.RUN: "running",
    StrideKind.RUN_TO_WALK: "run to walk",
}
"""The kinds of stride in words."""

STANDING: dict[str, str] = {
    StrideKind.STAND: "standing",
    StrideKind.STAND_TO_WALK: "stand to walk",
    StrideKind.WALK_TO_STAND: "walk to stand",
    StrideKind.CHANGE_SPEED: "to another speed",
    StrideKind.STEP_FORWARD: "step from a stand",
    StrideKind.STEP_BACK: "step back from a stand",
}
"""The kinds of stride of a scenario that stands."""

_STATE = ("speed", "height", "vertical_speed")
_LAST = 50  # strides that a gait is judged by
_TAKEN = 1e-3  # [m/s]: a speed so near the wanted one is the wanted one
_NEAR = 0.02  # of sqrt(g l0): a plan that ends so near the wanted speed aims at it


def _sections(record: Record) -> dict[str, Any]:
    """Target of the last section's kind, and the mean of the last strides that ended there."""
    names = record.sections
    last = record.section[-1]
    kind = section_of(Event[names[last]])
    here = record.section_state[1:][record.section[1:] == last][-_LAST:]
    # The stride that begins at the last section has not ended.
    targets = record.section_target[:-1][record.section[1:] == last]
    target = targets[-1] if len(targets) else record.section_target[-1]

    def state(z: Array) -> dict[str, float]:
        return dict(zip(_STATE, z[: kind.dimension].tolist(), strict=False))

    return {
        f"{names[last].lower()}_target": state(target),
        f"{names[last].lower()}_mean_last_{_LAST}": state(here.mean(axis=0)) if len(here) else None,
    }


def completed_strides(record: Record) -> dict[str, int]:
    """Number of completed strides of each kind, the kinds in words."""
    kinds = Counter(record.kinds_of_stride[:-1])
    others = {StrideKind.WALK_PUSH_OFF: "walking with push-off", StrideKind.HOP: "hopping"}
    names = STRIDES | STANDING | others
    return {names.get(kind, kind): count for kind, count in kinds.items()}


def rms(error: Array) -> float | None:
    """Root mean square; None of nothing."""
    return float(np.sqrt(np.mean(error**2))) if error.size else None


def _accepted(record: Record) -> dict[str, Any]:
    """Strides whose planner took another speed for the wanted one, and errors from that speed."""
    accepted = record.section_accepted[:-1]
    off = np.abs(accepted - record.section_target[:-1, 0])
    return {
        "strides": int(np.sum(off > _TAKEN)),
        "most": float(off.max(initial=0.0)),
        "error_rms": rms(record.section_state[1:, 0] - accepted),
    }


def _nearest(record: Record) -> dict[str, float]:
    """Strides whose wanted speed was further away than they can lead, and the largest error."""
    short = np.abs(record.section_target[:-1, 0] - record.section_predicted[:-1, 0])
    near = _NEAR * record.template.speed_unit
    return {"strides": int(np.sum(short > near)), "most": float(short.max(initial=0.0))}


def _quantiles(seconds: Array) -> dict[str, float]:
    median, p99 = np.percentile(seconds, [50, 99]) if len(seconds) else (0.0, 0.0)
    return {"median": float(median), "p99": float(p99)}


@checked
def summarise(record: Record, path: str | None) -> dict[str, Any]:
    """Summary of a run in SI units.

    Args:
        record: the run.
        path: where it was saved; None where it was not.

    Returns:
        robot, gait, steps, strides (count by kind), fell, fall_reason, duration, mean_speed,
        vlo_target and vlo_mean_last_50 (speed, height, vertical_speed), or where the run ends at
        an apex apex_target and apex_mean_last_50 (speed, height), speed_error_rms (of dx/dt where
        strides end, against their targets), accepted_speed (strides whose planner took another
        speed for the wanted one, the most that one was off, and error_rms of dx/dt against the
        speeds taken [m/s]), nearest_speed_taken (strides planned to end at another
        speed than the wanted one, the nearest within their reach, and the most that one was off
        [m/s]), com_error_rms and com_error_max (x, y, while a foot is
        to stand), com_error_flight_rms (x, y; None without flight), joint_torque (per joint peak,
        rms, limit), joint_speed (per joint peak, limit), saturated_share, qp_failures,
        qp_failed_share (of the ticks), cost_of_transport (work of the joints, all counted positive,
        over m g and distance), flight_share (robot, template: of the gait), duty_factor (share of
        the time that a foot is on the ground), control_tick_seconds (median, p99), qp_solve_seconds
        (the same over the ticks in which a limit acts, so that ProxQP works, and their share),
        plan_seconds (median, p99), real_time_factor, steps_not_nominal (plans that left the
        planner's own law),
        joint_angle (per joint least and most, and the range's lower and upper [rad]), record; of a
        floating-base run also the entries of :func:`~floating_summary`.
    """
    duration = record.duration
    counted: dict[str, Any] = asdict(record.summary)
    del counted["joint_work"]
    walked = float(record.com[-1, 0] - record.com[0, 0])
    touching, solving = record.contact_force[:, :, 1] > 0.0, record.solve_seconds > 0.0
    return {
        "robot": record.robot_name,
        "gait": record.gait_name,
        "steps": record.steps,
        "strides": completed_strides(record),
        "fell": record.fell,
        "fall_reason": record.fall_reason or None,
        "duration": duration,
        "mean_speed": walked / max(float(record.time[-1]), 1e-9),
        **_sections(record),
        "speed_error_rms": rms(record.section_state[1:, 0] - record.section_target[:-1, 0]),
        "accepted_speed": _accepted(record),
        "nearest_speed_taken": _nearest(record),
        **counted,
        "qp_failed_share": record.summary.qp_failures / max(len(record.tick_seconds), 1),
        "cost_of_transport": record.summary.joint_work / (record.weight * walked)
        if walked > 0.0
        else None,
        "flight_share": {
            "robot": float(np.mean(~touching.any(axis=1))),
            "template": record.gait_flight_share,
        },
        "duty_factor": float(np.mean(touching)),
        "control_tick_seconds": _quantiles(record.tick_seconds),
        "qp_solve_seconds": {
            **_quantiles(record.solve_seconds[solving]),
            "share": float(solving.mean()),
        },
        "plan_seconds": _quantiles(record.plan_seconds),
        "real_time_factor": duration / record.wall_seconds,
        "steps_not_nominal": int(np.sum(~record.section_nominal)),
        **(floating_summary(record) if isinstance(record, FloatingRecord) else {}),
        "record": path,
    }


_ANGLES = ("roll", "pitch", "yaw")


def floating_summary(record: FloatingRecord) -> dict[str, Any]:
    """Summary figures of a floating-base run.

    attitude_rms and attitude_max (roll, pitch, yaw in the heading frame [rad]), turned (of the
    heading [rad]), mean_yaw_drift (of the trunk's mean yaw, from the first to the last quarter of
    the run, over 100 steps [rad]), step_width (mean, standard deviation, least [m]; None without a
    double stance).
    """
    angles = record.attitude
    size, most = np.sqrt(np.mean(angles**2, axis=0)), np.abs(angles).max(axis=0)
    quarter = max(len(angles) // 4, 1)
    drift = float(np.mean(angles[-quarter:, 2]) - np.mean(angles[:quarter, 2]))
    hundreds = 0.75 * max(record.steps, 1) / 100.0
    widths = step_widths(record)
    of: dict[str, Any] = {"mean": np.mean, "deviation": np.std, "least": np.min}
    return {
        "attitude_rms": dict(zip(_ANGLES, size.tolist(), strict=True)),
        "attitude_max": dict(zip(_ANGLES, most.tolist(), strict=True)),
        "turned": float(record.heading[-1] - record.heading[0]),
        "mean_yaw_drift": drift / hundreds,
        "step_width": {k: float(f(widths)) for k, f in of.items()} if len(widths) else None,
    }


def step_widths(record: FloatingRecord) -> Array:
    """(n,) lateral distance of the template legs' feet in each double stance, left first [m]."""
    begun = np.flatnonzero(np.diff(record.in_phase(Phase.DS).astype(np.int8)) == 1) + 1
    left, right = record.of_legs(record.space_foot)[begun, :, :2].swapaxes(0, 1)
    apart = left - right
    angle = record.heading[begun] - record.facing[begun]
    return np.asarray(np.cos(angle) * apart[:, 1] - np.sin(angle) * apart[:, 0])
