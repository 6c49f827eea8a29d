"""The table of a robot's run, as the commands that make one print it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich.table import Table

from template_control.terminal import plain_console

_UNCONTROLLED = 0.1  # of the ticks without a solved QP; a stumble has a few
_MEAN = 50  # strides at most whose section states the summary averages


def print_table(figures: dict[str, Any]) -> None:
    """The summary as a table on standard output.

    Args:
        figures: of the run, from :func:`~template_control.run.summary.summarise`.
    """
    table = Table(title=f"{figures['robot']}, gait {figures['gait']}", show_header=False)
    table.add_column()
    table.add_column(justify="right")

    def row(name: str, text: str) -> None:
        table.add_row(name, text)

    row("steps", f"{figures['steps']}")
    if len(figures["strides"]) > 1:
        for name, count in figures["strides"].items():
            row(f"steps, {name}", f"{count}")
    row("falls", "0" if not figures["fell"] else f"1: {figures['fall_reason']}")
    row("duration", f"{figures['duration']:.2f} s")
    row("mean speed", f"{figures['mean_speed']:.3f} m/s")
    for section in ("VLO", "apex"):
        for name, key in (
            ("target", "target"),
            (f"last {min(figures['steps'], _MEAN)} steps", "mean_last_50"),
        ):
            z = figures.get(f"{section.lower()}_{key}")
            if z is not None:
                row(f"{section}, {name}", _state(z))
    if figures["speed_error_rms"] is not None:
        row("speed at the sections less the target, RMS", f"{figures['speed_error_rms']:.4f} m/s")
    accepted = figures["accepted_speed"]
    if accepted["strides"]:
        row("change of speed reduced", nearest_text(accepted))
        row("speed at the sections less the accepted, RMS", f"{accepted['error_rms']:.4f} m/s")
    nearest = figures["nearest_speed_taken"]
    if nearest["strides"]:
        row("nearest speed taken for the wanted one", nearest_text(nearest))
    rms, worst = figures["com_error_rms"], figures["com_error_max"]
    for axis in ("x", "y"):
        row(
            f"CoM error in {axis}, RMS / max",
            f"{1e3 * rms[axis]:.2f} / {1e3 * worst[axis]:.2f} mm",
        )
    if "attitude_rms" in figures:
        in_space(figures, row)
    for joint, torque in figures["joint_torque"].items():
        row(
            f"{joint} torque, peak / RMS of limit",
            f"{torque['peak']:.3g} / {torque['rms']:.3g} of {torque['limit']:g} N m",
        )
    for joint, speed in figures["joint_speed"].items():
        row(f"{joint} speed, peak", speed_text(speed))
    share = figures["flight_share"]
    if share["template"]:
        flight = figures["com_error_flight_rms"]
        row(
            "CoM error in flight, RMS x / y",
            f"{1e3 * flight['x']:.2f} / {1e3 * flight['y']:.2f} mm",
        )
        row(
            "flight, robot / template",
            f"{share['robot']:.3f} / {share['template']:.3f} of the time",
        )
    row("duty factor", f"{figures['duty_factor']:.3f}")
    if figures["cost_of_transport"] is not None:
        row("cost of transport", f"{figures['cost_of_transport']:.3f}")
    row("ticks with a torque at its limit", f"{100 * figures['saturated_share']:.2f} %")
    row("QP failures", failures_text(figures))
    row("steps off the planner's own law", f"{figures['steps_not_nominal']}")
    for name, key in (
        ("control tick", "control_tick_seconds"),
        ("ProxQP, where a limit acts", "qp_solve_seconds"),
        ("plan", "plan_seconds"),
    ):
        t = figures[key]
        row(f"{name}, median / p99", f"{1e6 * t['median']:.0f} / {1e6 * t['p99']:.0f} us")
    row("ticks in which a limit acts", f"{100 * figures['qp_solve_seconds']['share']:.1f} %")
    row("real-time factor", f"{figures['real_time_factor']:.1f}")
    row("record", figures["record"] or "not saved")
    plain_console().print(table)


def in_space(figures: dict[str, Any], row: Callable[[str, str], None]) -> None:
    """The rows of a robot that nothing holds.

    Args:
        figures: of the run.
        row: adds one.
    """
    rms, most = figures["attitude_rms"], figures["attitude_max"]
    for angle in rms:
        row(f"{angle}, RMS / max", f"{rms[angle]:.4f} / {most[angle]:.4f} rad")
    row("heading turned by", f"{figures['turned']:.3f} rad")
    row("drift of the mean yaw in 100 steps", f"{figures['mean_yaw_drift']:+.4f} rad")
    width = figures["step_width"]
    if width is not None:
        row(
            "step width, mean / deviation / least",
            f"{width['mean']:.3f} / {width['deviation']:.3f} / {width['least']:.3f} m",
        )
    for joint, angle in figures.get("joint_angle", {}).items():  # earlier versions did not keep it
        past = angle["least"] < angle["lower"] or angle["most"] > angle["upper"]
        row(
            f"{joint} angle",
            f"{angle['least']:+.2f} to {angle['most']:+.2f} of {angle['lower']:g} to"
            f" {angle['upper']:g} rad" + past_limit(past),
        )


def speed_text(speed: dict[str, float]) -> str:
    """Peak speed of a joint and its limit, marked where it was exceeded.

    Args:
        speed: an entry of ``joint_speed`` of a summary.
    """
    peak, limit = speed["peak"], speed["limit"]
    return f"{peak:.3g} of {limit:g} rad/s" + past_limit(peak > limit)


def past_limit(past: bool) -> str:
    """The mark of a figure that is past its limit.

    Args:
        past: whether it is.
    """
    return ", past its limit" if past else ""


def failures_text(figures: dict[str, Any]) -> str:
    """In how many ticks the QP had no solution, and what many of them mean.

    Args:
        figures: of the run.
    """
    count, share = figures["qp_failures"], figures["qp_failed_share"]
    if not count:
        return "0"
    text = f"{count}, {100 * share:.2g} % of the ticks"
    return f"{text}: no controlled motion" if share > _UNCONTROLLED else text


def nearest_text(nearest: dict[str, float]) -> str:
    """Where the wanted speed was out of a stride's reach.

    Args:
        nearest: ``nearest_speed_taken`` of a summary.
    """
    return f"{nearest['strides']} times, {nearest['most']:.2f} m/s off"


def _state(z: dict[str, float]) -> str:
    text = f"{z['speed']:.4f} m/s  {z['height']:.4f} m"
    return text + (f"  {z['vertical_speed']:+.4f} m/s" if "vertical_speed" in z else "")
