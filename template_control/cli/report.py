"""A command's run: done, kept and reported, whatever becomes of its files."""

from __future__ import annotations

import argparse
import logging
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from template_control.checks import option_types as values
from template_control.cli.interrupts import stopped
from template_control.cli.plots import TEMPLATE, add_figure_options, draw
from template_control.errors import TemplateControlError
from template_control.plant.c_library import stdout_to_stderr
from template_control.run import failures
from template_control.run.experiment import STEPS, Experiment, PreparedExperiment
from template_control.run.record import Record, RunInterrupted, one_line, recorded
from template_control.run.simulation import simulate
from template_control.slip.scenario.run import ScenarioRecord
from template_control.storage import Files, writing
from template_control.terminal import Table, plain_console, progress_bar


def add_output_options(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add ``--output`` (by default ``folder``), ``--json``, and which figures are drawn."""
    parser.add_argument(
        "--output",
        type=values.path,
        default=Path(folder),
        help=f"folder for run.npz, run.toml and figures, {folder} if not given; a run that is"
        " there is replaced, and the command says so",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the table as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")
    add_figure_options(parser)


@contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """Keep a folder for a run, see :func:`~template_control.storage.writing`.

    Says on stderr if a run in it will be replaced.
    """
    with writing(folder):
        if (folder / "run.npz").exists():
            print(
                f"template-control: the run in {folder} will be replaced; --output keeps both",
                file=sys.stderr,
            )
        yield folder


@dataclass(frozen=True)
class Kept:
    """A run, its files, and the path of its own file; None if that could not be written."""

    record: Record
    path: str | None
    files: Files

    def interrupted(self) -> bool:
        """True if Ctrl-C ended the run; reports on the files, once the table is printed.

        A TemplateControlError if a file could not be written, a KeyboardInterrupt if Ctrl-C came
        while files were written.
        """
        self.files.raise_pending()
        if not self.record.interrupted:
            return False
        print(
            f"template-control: interrupted: the run up to here is in {self.path}", file=sys.stderr
        )
        return True


def run_and_keep(
    options: argparse.Namespace,
    experiment: Experiment,
    prepared: PreparedExperiment,
    doing: str,
    template: ScenarioRecord | None = None,
) -> Kept:
    """Do a run; write it, what repeats it, and its figures.

    ``experiment`` is as it is written, ``prepared`` the same as it is run; ``doing`` is shown by
    the progress bar. ``template`` is the same scenario on the robot's template, kept and drawn with
    the run. If a part of the user's own fails, or answers with nonsense, that goes up as a
    TemplateControlError; what was recorded until then is kept, and the traceback of any other error
    is printed.
    """
    files = Files()
    ends = isinstance(prepared.planner, Mapping)  # of a route; a gait is kept for ever
    total = prepared.steps or (None if ends else STEPS)
    with output_folder(options.output) as folder, stdout_to_stderr():
        try:
            with (
                progress_bar(doing, total) as advance,
                _failures_told(),
            ):
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
    return Kept(record, None if path is None else str(path), files)


class _Lines(logging.Handler):
    """Prints each message on a line of standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"template-control: {record.getMessage()}", file=sys.stderr)


@contextmanager
def _failures_told() -> Iterator[None]:
    """Report on the terminal, at once, that a run's QP fails."""
    lines = _Lines(logging.WARNING)
    failures.LOG.addHandler(lines)
    try:
        yield
    finally:
        failures.LOG.removeHandler(lines)


def _give_up(error: Exception, experiment: Experiment, folder: Path) -> NoReturn:
    """Keep what a run had recorded when an error ended it, and raise the error.

    Of an error that is not this library's the traceback is printed: it leads into the user's own
    code.
    """
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


def print_table(figures: dict[str, Any]) -> None:
    """The summary, from :func:`~template_control.run.summary.summarise`, as a table on stdout."""
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
        floating_rows(figures, row)
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


def floating_rows(figures: dict[str, Any], row: Callable[[str, str], None]) -> None:
    """The rows of a robot that nothing holds; ``row`` adds one."""
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
    """Peak speed of a joint and its limit (of a summary), marked where it was exceeded."""
    peak, limit = speed["peak"], speed["limit"]
    return f"{peak:.3g} of {limit:g} rad/s" + past_limit(peak > limit)


def past_limit(past: bool) -> str:
    """The mark of a figure that is past its limit."""
    return ", past its limit" if past else ""


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
