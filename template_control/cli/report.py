"""A command's run: done, kept and reported, whatever becomes of its files."""

from __future__ import annotations

import argparse
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from rich.table import Table

from template_control.cli.interrupts import stopped
from template_control.cli.notices import notice, printed
from template_control.cli.plots import TEMPLATE, draw
from template_control.errors import TemplateControlError
from template_control.plant.c_library import stdout_to_stderr
from template_control.run.experiment import STEPS, Experiment, PreparedExperiment
from template_control.run.live import QP_FAILURES
from template_control.run.record import Record, RunInterrupted, one_line, recorded
from template_control.run.simulation import simulate
from template_control.run.summary import rms
from template_control.slip.scenario.run import ScenarioRecord
from template_control.storage import Files, writing
from template_control.terminal import figures_table, progress_bar, table


@contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """Keep a folder for a run; says on stderr if a run in it will be replaced."""
    with writing(folder):
        if (folder / "run.npz").exists():
            notice(f"the run in {folder} will be replaced; --output keeps both")
        yield folder


def run_and_keep(
    options: argparse.Namespace,
    experiment: Experiment,
    prepared: PreparedExperiment,
    doing: str,
    template: ScenarioRecord | None,
    files: Files,
) -> tuple[Record, str | None]:
    """Do a run; write it, what repeats it, and its figures; the record, and the path of its file.

    ``experiment`` is as it is written, ``prepared`` the same as it is run, ``template`` the same
    scenario on the robot's template. If a part of the user's own fails, that goes up as a
    TemplateControlError; what was recorded until then is kept, and the traceback of any other error
    is printed.
    """
    ends = isinstance(prepared.planner, Mapping)  # of a route; a gait is kept for ever
    total = prepared.steps or (None if ends else STEPS)
    with output_folder(options.output) as folder, stdout_to_stderr():
        try:
            with progress_bar(doing, total) as advance, printed(QP_FAILURES):
                record = simulate(prepared, advance)
        except RunInterrupted as stop:
            record = stop.record
        except Exception as error:
            if stopped():  # what Ctrl-C ends may end with any error
                raise
            _give_up(error, experiment, folder)
        path = files.write(lambda: record.save(folder / "run.npz"))
        files.write(lambda: experiment.save(folder / "run.toml"))
        (folder / TEMPLATE).unlink(missing_ok=True)  # of the run that is replaced
        if template is not None and not record.interrupted:
            files.write(lambda: template.save(folder / TEMPLATE))
        if not (options.no_figures or record.interrupted):
            files.write(lambda: draw(options, record, folder, template))
    return record, None if path is None else str(path)


def _give_up(error: Exception, experiment: Experiment, folder: Path) -> NoReturn:
    """Keep what a run had recorded when an error ended it, and raise the error in one line."""
    record, files = recorded(error), Files()
    line = one_line(error) if record is None else record.error
    if record is not None:
        path = files.write(lambda: record.save(folder / "run.npz"))
        files.write(lambda: experiment.save(folder / "run.toml"))
        if path is not None:
            line += f"; the run up to here is in {path}"
    if isinstance(error, TemplateControlError):
        raise type(error)(line) from None
    traceback.print_exception(error)
    raise TemplateControlError(line) from None


_UNCONTROLLED = 0.1  # of the ticks without a solved QP; a stumble has a few
_MEAN = 50  # strides at most whose section states the summary averages


def tables(figures: dict[str, Any]) -> tuple[Table, Table]:
    """The summary, from :func:`~template_control.run.summary.summarise`, and what joints did."""
    title = f"{figures['robot']}, gait {figures['gait']}"
    return figures_table(title, _rows(figures)), joint_table(figures)


def _rows(figures: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The rows of a summary's table."""
    yield "steps", f"{figures['steps']}"
    if len(figures["strides"]) > 1:
        for name, count in figures["strides"].items():
            yield f"steps, {name}", f"{count}"
    yield "falls", "0" if not figures["fell"] else f"1: {figures['fall_reason']}"
    if "template" in figures:
        yield from _template_rows(figures)
    yield "duration", f"{figures['duration']:.2f} s"
    yield "mean speed", f"{figures['mean_speed']:.3f} m/s"
    last = f"last {min(figures['steps'], _MEAN)} steps"
    for section in ("VLO", "apex"):
        for name, key in (("target", "target"), (last, "mean_last_50")):
            z = figures.get(f"{section.lower()}_{key}")
            if z is not None:
                yield f"{section}, {name}", _state(z)
    if figures["speed_error_rms"] is not None:
        yield "speed at the sections less the target, RMS", f"{figures['speed_error_rms']:.4f} m/s"
    accepted = figures["accepted_speed"]
    if accepted["strides"]:
        yield "change of speed reduced", nearest_text(accepted)
        yield "speed at the sections less the accepted, RMS", f"{accepted['error_rms']:.4f} m/s"
    nearest = figures["nearest_speed_taken"]
    if nearest["strides"]:
        yield "nearest speed taken for the wanted one", nearest_text(nearest)
    rms, worst = figures["com_error_rms"], figures["com_error_max"]
    for axis in ("x", "y"):
        errors = f"{1e3 * rms[axis]:.2f} / {1e3 * worst[axis]:.2f} mm"
        yield f"CoM error in {axis}, RMS / max", errors
    if "attitude_rms" in figures:
        yield from floating_rows(figures)
    share = figures["flight_share"]
    flight = figures["com_error_flight_rms"]
    if flight is not None:
        errors = f"{1e3 * flight['x']:.2f} / {1e3 * flight['y']:.2f} mm"
        yield "CoM error in flight, RMS x / y", errors
    if share["template"]:
        shares = f"{share['robot']:.3f} / {share['template']:.3f} of the time"
        yield "flight, robot / template", shares
    yield "duty factor", f"{figures['duty_factor']:.3f}"
    if figures["cost_of_transport"] is not None:
        yield "cost of transport", f"{figures['cost_of_transport']:.3f}"
    yield "ticks with a torque at its limit", f"{100 * figures['saturated_share']:.2f} %"
    yield "QP failures", failures_text(figures)
    yield "steps off the planner's own law", f"{figures['steps_not_nominal']}"
    for name, key in (
        ("control tick", "control_tick_seconds"),
        ("ProxQP, where a limit acts", "qp_solve_seconds"),
        ("plan", "plan_seconds"),
    ):
        t = figures[key]
        yield f"{name}, median / p99", f"{1e6 * t['median']:.0f} / {1e6 * t['p99']:.0f} us"
    yield "ticks in which a limit acts", f"{100 * figures['qp_solve_seconds']['share']:.1f} %"
    yield "real-time factor", f"{figures['real_time_factor']:.1f}"
    yield "record", figures["record"] or "not saved"


def floating_rows(figures: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The rows that only a floating-base robot's table has."""
    rms, most = figures["attitude_rms"], figures["attitude_max"]
    for angle in rms:
        yield f"{angle}, RMS / max", f"{rms[angle]:.4f} / {most[angle]:.4f} rad"
    yield "heading turned by", f"{figures['turned']:.3f} rad"
    yield "drift of the mean yaw in 100 steps", f"{figures['mean_yaw_drift']:+.4f} rad"
    width = figures["step_width"]
    if width is not None:
        widths = f"{width['mean']:.3f} / {width['deviation']:.3f} / {width['least']:.3f} m"
        yield "step width, mean / deviation / least", widths


def joint_table(figures: dict[str, Any]) -> Table:
    """What each joint did of what it may, marked where that was more."""
    title = "joints: torque, peak / RMS of limit; speed, peak of limit; angle of range"
    rows, past = [], ", past its limit"
    for joint, torque in figures["joint_torque"].items():
        speed, angle = figures["joint_speed"][joint], figures["joint_angle"][joint]
        fast = past if speed["peak"] > speed["limit"] else ""
        far = past if angle["least"] < angle["lower"] or angle["most"] > angle["upper"] else ""
        went = f"{angle['least']:.2f}..{angle['most']:.2f}"
        rows.append(
            (
                joint,
                f"{torque['peak']:.3g} / {torque['rms']:.3g} of {torque['limit']:g}",
                f"{speed['peak']:.3g} of {speed['limit']:g}{fast}",
                f"{went} of {angle['lower']:.2f}..{angle['upper']:.2f}{far}",
            )
        )
    return table(title, ("", "torque [N m]", "speed [rad/s]", "angle [rad]"), rows)


def failures_text(figures: dict[str, Any]) -> str:
    """Number and share of ticks without a solution of the QP, and what many of them mean."""
    count, share = figures["qp_failures"], figures["qp_failed_share"]
    if not count:
        return "0"
    text = f"{count}, {100 * share:.2g} % of the ticks"
    return f"{text}: no controlled motion" if share > _UNCONTROLLED else text


def nearest_text(nearest: dict[str, float]) -> str:
    """Number of strides whose wanted speed was out of reach, and the largest difference."""
    return f"{nearest['strides']} times, {nearest['most']:.2f} m/s off"


def _state(z: dict[str, float]) -> str:
    text = f"{z['speed']:.4f} m/s  {z['height']:.4f} m"
    return text + (f"  {z['vertical_speed']:+.4f} m/s" if "vertical_speed" in z else "")


NO_STANDS = "the template cannot stand: it leaves out the stands, and begins in a walk"


def add_template(figures: dict[str, Any], record: Record, template: ScenarioRecord) -> None:
    """Add to a run's figures how it ended and its top speed, and the same of its template."""
    figures["completed"] = bool(record.arrived)
    figures["top_speed"] = float(record.section_state[:, 0].max())
    figures["template"] = {
        "completed": template.completed,
        "top_speed": float(template.section_state[:, 0].max()),
        "speed_error_rms": rms(template.section_state[1:, 0] - template.wanted_speed),
    }


def _template_rows(figures: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The rows of a run through a scenario."""
    both = figures, figures["template"]
    ended = ("as planned" if one["completed"] else "no" for one in both)
    yield "completed, robot / template", " / ".join(ended)
    for name, key in (
        ("top speed at a section", "top_speed"),
        ("speed less the wanted, RMS", "speed_error_rms"),
    ):
        speeds = ("none" if one[key] is None else f"{one[key]:.3f}" for one in both)
        yield f"{name}, robot / template", " / ".join(speeds) + " m/s"
