"""``template-control robustness``: how much a robot's walk or run takes until it breaks."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from template_control.checks import option_types as values
from template_control.cli.experiment_options import add_flags, experiment_from
from template_control.cli.flags import SUBJECT
from template_control.cli.trial_options import (
    add_printed,
    add_workers,
    draw,
    folder_of,
    kept,
)
from template_control.plant.c_library import stdout_to_stderr
from template_control.robustness.disturbances import AFTER, ALL
from template_control.robustness.findings import Finding, Robustness
from template_control.robustness.severity_sweep import SETTLED, measure
from template_control.run.experiment import Experiment
from template_control.slip.gaits.gait import Gait
from template_control.slip.gaits.running_gait import RunningGait
from template_control.storage import Files, writing
from template_control.sweep.executor import workers
from template_control.terminal import Table, plain_console
from template_control.view.trial_figures import robustness_figure

_NAMES = tuple(d.name for d in ALL)
_COLUMNS = (
    "disturbance",
    "trials",
    "all succeed up to",
    "with 95 %",
    "half succeed up to",
    "none falls up to",
    "template, at its section",
    "first failures",
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Raise pushes, unseen steps of the ground, friction, mass and torque errors, sensor"
        " noise and delay level by level, with several trials each, until walk or run breaks."
        f" A trial succeeds if the robot does not fall within {AFTER} more steps and, after"
        " a push or a step, its mean speed and height at VLO or apex over the last 5 are"
        f" within {100 * SETTLED:g} % of its gait's. Ends with a table and a figure. Ctrl-C"
        " and the same command again go on where it was. Exit status: 0, 2 for bad input"
        " or a robot that falls undisturbed, 130 after Ctrl-C."
    )
    add_flags(parser, SUBJECT)
    parser.add_argument(
        "--disturbance",
        action="append",
        choices=_NAMES,
        metavar="NAME",
        help=f"only this one; may be given several times. One of {', '.join(_NAMES)}",
    )
    parser.add_argument(
        "--quick", action="store_true", help="two levels of two trials each, to see that it works"
    )
    add_workers(parser)
    parser.add_argument(
        "--output",
        type=values.path,
        help="folder for the trials and the figure; by default runs/robustness/ROBOT, with -free"
        " of a floating base, the gait's name if it is no walk, and the engine's if it is another",
    )
    add_printed(parser)


def run(options: argparse.Namespace) -> int:
    """Measure as the options say; returns 0, or 130 after Ctrl-C."""
    experiment = experiment_from(options, Experiment())
    where = experiment.prepare()  # before a folder is made for it
    with writing(folder_of(options, experiment, "runs/robustness", where.robot.name)) as folder:
        return _measure(options, experiment, folder)


def _measure(options: argparse.Namespace, experiment: Experiment, folder: Path) -> int:
    """Measure, with trials and figure in ``folder``."""
    try:
        with workers(options.workers) as pool, stdout_to_stderr():
            found = measure(experiment, options.disturbance, folder, pool, options.quick)
    except KeyboardInterrupt:
        return kept(folder)
    files = Files()
    figure = files.write(lambda: draw(lambda: robustness_figure(found), folder / "robustness.png"))
    if options.json:
        print(json.dumps({**data(found), "figure": None if figure is None else str(figure)}))
    elif options.markdown:
        print(markdown(found))
    else:
        _print_table(found, figure)
    files.raise_pending()
    return 0


def data(found: Robustness) -> dict[str, Any]:
    """The findings as plain data; levels and breaking points in SI units.

    robot, plant, gait (mean_speed, and vlo_height or, of a run, apex_height), undisturbed
    (speed_error, height_error), disturbances: by name trials, breaking_point, half_point,
    standing_point (null where the mildest level is beyond it), template (its own limit; null
    without one) and levels (level, success_rate, interval with 95 %, fell, astray).
    """
    height = "apex_height" if isinstance(found.gait, RunningGait) else "vlo_height"
    return {
        "robot": found.robot,
        "plant": found.plant,
        "gait": {"mean_speed": _speed(found.gait), height: float(found.gait.state[1])},
        "undisturbed": {"speed_error": found.speed_error, "height_error": found.height_error},
        "disturbances": {
            f.disturbance.name: {
                "trials": f.disturbance.trials,
                "breaking_point": f.breaking_point,
                "half_point": f.half_point,
                "standing_point": f.standing_point,
                "template": f.template,
                "levels": [
                    {
                        "level": level.level,
                        "success_rate": level.rate,
                        "interval": level.interval,
                        "fell": level.fell,
                        "astray": level.off_gait,
                    }
                    for level in f.levels
                ],
            }
            for f in found.findings
        },
    }


def _speed(gait: Gait) -> float:
    return gait.step_length / gait.step_duration


def _row(finding: Finding) -> tuple[str, ...]:
    d, last = finding.disturbance, finding.levels[-1]

    def point(level: float | None) -> str:
        return _up_to(finding, level) + (" or more" if level == last.level else "")

    after = next((x for x in finding.levels if x.rate < 1.0), None)
    beyond = "" if after is None else f"{d.shown(after.level)}: {_told(after.fell, after.off_gait)}"
    all_good, half, standing = map(
        point, (finding.breaking_point, finding.half_point, finding.standing_point)
    )
    return d.title, str(d.trials), all_good, _sure(finding), half, standing, _limit(finding), beyond


def _sure(finding: Finding) -> str:
    """Share of trials that would succeed at the breaking point's level, with 95 % confidence."""
    for level in finding.levels:
        if level.level == finding.breaking_point:
            return f"{100 * level.interval[0]:.0f} to {100 * level.interval[1]:.0f} %"
    return ""


def _limit(finding: Finding) -> str:
    """The template's own limit."""
    most = finding.template
    return "" if most is None else _up_to(finding, most or None)


def _up_to(finding: Finding, level: float | None) -> str:
    """A level of the finding; without one, that it is not even the mildest."""
    shown = finding.disturbance.shown
    return f"not {shown(finding.levels[0].level)}" if level is None else shown(level)


def _told(fell: int, off_gait: int) -> str:
    parts = [f"{n} {what}" for n, what in ((fell, "fell"), (off_gait, "off its gait")) if n]
    return ", ".join(parts)


def _title(found: Robustness) -> str:
    return (
        f"{found.robot} at {_speed(found.gait):.3f} m/s in {found.plant}; undisturbed it is"
        f" {100 * found.speed_error:+.2f} % in speed and {100 * found.height_error:+.2f} % in"
        " height from its gait"
    )


def markdown(found: Robustness) -> str:
    """The table as Markdown."""
    rows = [_COLUMNS, tuple("---" for _ in _COLUMNS), *map(_row, found.findings)]
    return "\n".join([_title(found) + ":", "", *("| " + " | ".join(r) + " |" for r in rows)])


def _print_table(found: Robustness, figure: Path | None) -> None:
    table = Table(title=_title(found))
    for column in _COLUMNS:
        table.add_column(column)
    for finding in found.findings:
        table.add_row(*_row(finding))
    console = plain_console()
    console.print(table)
    if figure is not None:
        console.print(f"figure: {figure}", highlight=False)
