"""``template-control robustness``: how much a robot's walk or run takes until it breaks."""

from __future__ import annotations

import argparse
from typing import Any

from template_control.cli.experiment_options import add_flags, experiment_from
from template_control.cli.flags import SUBJECT
from template_control.cli.trial_options import Report, add_trial_options, folder_of, report_trials
from template_control.robustness.disturbances import AFTER, ALL
from template_control.robustness.findings import Finding, Robustness
from template_control.robustness.severity_sweep import SETTLED, measure
from template_control.slip.gaits.running_gait import RunningGait
from template_control.storage import writing
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
        " a push or a step, its mean speed, a run's at its apexes, and height over the last 5 are"
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
    about = (
        "folder for the trials and the figure; by default runs/robustness/ROBOT, with -free"
        " of a floating base, the gait's name if it is no walk, and the engine's if it is another"
    )
    add_trial_options(parser, about)


def run(options: argparse.Namespace) -> int:
    """Measure as the options say; returns 0, or 130 after Ctrl-C."""
    experiment = experiment_from(options)
    where = experiment.prepare()  # before a folder is made for it
    with writing(folder_of(options, experiment, "runs/robustness", where.robot.name)) as folder:
        return report_trials(
            options,
            folder,
            lambda pool: measure(experiment, options.disturbance, folder, pool, options.quick),
            lambda found, _: report(found),
        )


def report(found: Robustness) -> Report:
    """Report of the findings."""
    title = (
        f"{found.robot} at {found.gait.mean_speed:.3f} m/s in {found.plant}; undisturbed it is"
        f" {100 * found.speed_error:+.2f} % in speed and {100 * found.height_error:+.2f} % in"
        " height from its gait"
    )
    return Report(
        title,
        _COLUMNS,
        [_row(finding) for finding in found.findings],
        data=data(found),
        figure=lambda: robustness_figure(found),
        name="robustness.png",
    )


def data(found: Robustness) -> dict[str, Any]:
    """The findings as plain data; levels and breaking points in SI units."""
    height = "apex_height" if isinstance(found.gait, RunningGait) else "vlo_height"
    return {
        "robot": found.robot,
        "plant": found.plant,
        "gait": {"mean_speed": found.gait.mean_speed, height: float(found.gait.state[1])},
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


def _row(finding: Finding) -> list[str]:
    d, levels, limit = finding.disturbance, finding.levels, finding.template
    all_good = finding.breaking_point

    def up_to(level: float | None) -> str:
        return f"not {d.shown(levels[0].level)}" if level is None else d.shown(level)

    def point(level: float | None) -> str:
        return up_to(level) + (" or more" if level == levels[-1].level else "")

    # The share of trials that would succeed where all did.
    sure = next((level.interval for level in levels if level.level == all_good), None)
    beyond, after = "", next((level for level in levels if level.rate < 1.0), None)
    if after is not None:
        counts = ((after.fell, "fell"), (after.off_gait, "off its gait"))
        failed = ", ".join(f"{n} {what}" for n, what in counts if n)
        beyond = f"{d.shown(after.level)}: {failed}"
    return [
        d.title,
        str(d.trials),
        point(all_good),
        "" if sure is None else f"{100 * sure[0]:.0f} to {100 * sure[1]:.0f} %",
        point(finding.half_point),
        point(finding.standing_point),
        "" if limit is None else up_to(limit or None),
        beyond,
    ]
