"""``template-control campaign``: robustness of a gait with everything disturbed at once."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from template_control import settings
from template_control.checks import option_types as values
from template_control.checks.ranges import Range
from template_control.cli.experiment_options import add_flags, experiment_from
from template_control.cli.flags import SUBJECT
from template_control.cli.trial_options import Report, add_trial_options, folder_of, report_trials
from template_control.plant.plant import plant_name
from template_control.robustness.campaign import (
    FLOATING_MIX,
    OFF_GAIT,
    Campaign,
    CampaignConfig,
    DisturbanceDistribution,
    Trial,
    run_campaign,
    save_falls,
)
from template_control.run.specs import GaitSpec
from template_control.storage import Files, write_text, writing
from template_control.view.trial_figures import campaign_figure

_LISTED = 20  # trials that went wrong, at most, in the printed table
_COLUMNS = ("of the trials", "count", "share", "with 95 % confidence")
_DETAILS = ("trial", "first", "how it ended", "repeat it with")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Walk or run a robot many times, each time with start, friction, mass, push, ground step,"
        " noise and delay drawn at once from a mix, which the controller does not know. Tells"
        f" the share of falls and of trials that end more than {100 * OFF_GAIT:g} % off the"
        " gait's speed, with Wilson's 95 % intervals; lists what went wrong first in each fall,"
        " and writes a file that repeats it. Ctrl-C and the same command again go on where it was."
        " Exit status: 0, 2 for bad input, 130 after Ctrl-C."
    )
    add_flags(parser, SUBJECT)
    parser.add_argument(
        "--trials",
        type=values.whole(values.MANY),
        default=100,
        metavar="N",
        help="how many, 100 if not given",
    )
    parser.add_argument(
        "--mix",
        type=values.path,
        metavar="TOML",
        help="ranges that the trials are drawn from; a mix.toml of an earlier campaign is one to"
        " begin with",
    )
    parser.add_argument(
        "--severity",
        type=values.number(Range(0.0, 100.0)),
        default=1.0,
        metavar="FACTOR",
        help="all ranges so many times as wide about where nothing disturbs",
    )
    parser.add_argument(
        "--seed", dest="draws", type=values.whole(values.SEED), default=0, help="of all draws"
    )
    about = (
        "folder for results, figure and falls; by default runs/campaign/ROBOT, with free"
        " if nothing holds it, the gait's name if it is a run, and the engine's if it is not"
        " PyBullet"
    )
    add_trial_options(parser, about)


def run(options: argparse.Namespace) -> int:
    """Run the trials as the options say; returns 0, or 130 after Ctrl-C."""
    experiment = experiment_from(options)
    default = FLOATING_MIX if experiment.free else DisturbanceDistribution()
    mix = default if options.mix is None else settings.read(DisturbanceDistribution, options.mix)
    conditions = CampaignConfig(experiment, mix.times(options.severity), options.draws)
    robot = conditions.trial(0)[1].robot  # before a folder is made for it
    with writing(folder_of(options, experiment, "runs/campaign", robot.name)) as folder:
        return report_trials(
            options,
            folder,
            lambda pool: run_campaign(conditions, options.trials, folder, pool),
            lambda found, files: report(found, files, folder),
        )


def report(found: Campaign, files: Files, folder: Path) -> Report:
    """Report of a campaign, whose mix and falls are written into the folder."""
    head = "# template-control campaign --mix FILE draws from these ranges.\n"
    mix = head + settings.text(settings.to_table(found.conditions.mix))
    files.write(lambda: write_text(folder / "mix.toml", mix))
    falls = files.write(lambda: save_falls(found, folder)) or {}
    e = found.conditions.experiment
    gait = e.motion if isinstance(e.motion, GaitSpec) else GaitSpec()
    speed = "" if gait.speed is None else f" at {gait.speed:g} m/s"
    rows = []
    for name, of in (("fell", found.fell), ("off its gait", found.off_gait)):
        share = _share(found, of)
        interval = f"{share['low']:.2%} to {share['high']:.2%}"
        rows.append((name, str(len(of)), f"{share['share']:.2%}", interval))
    causes = ", ".join(f"{name} {count}" for name, count in found.reasons.items())
    wrong = (*found.fell, *found.off_gait)
    details = [
        (
            str(t.number),
            t.first,
            t.reason or f"{t.speed_error or 0.0:+.1%} in speed",
            f"walk --config {falls[t.number]}" if t.number in falls else "",
        )
        for t in wrong[:_LISTED]
    ]
    more = len(wrong) - _LISTED
    title = f"{e.robot_name}, {gait.name}{speed}, in {plant_name(e.world)}"
    return Report(
        f"{title}: {len(found.trials)} trials",
        _COLUMNS,
        rows,
        data=data(found, falls),
        figure=lambda: campaign_figure(found),
        name="campaign.png",
        lines=("", f"The falls began with: {causes}.") if causes else (),
        details=("what went wrong", _DETAILS, details) if details else None,
        note=f"and {more} more, each with its file in the same folder" if more > 0 else "",
    )


def data(found: Campaign, falls: dict[int, Path]) -> dict[str, Any]:
    """The campaign as plain data; ``falls`` are the files of what went wrong, by number."""
    conditions = found.conditions
    table = settings.to_table(conditions.experiment.resolved())
    columns = ("number", "fell", "reason", "first", "speed_error", "severity")
    return {
        "robot": conditions.experiment.robot_name,
        "gait": table["motion"],
        "plant": table["world"]["kind"],
        "trials": len(found.trials),
        "mix": settings.to_table(conditions.mix),
        "fell": _share(found, found.fell),
        "astray": _share(found, found.off_gait),
        "reasons": found.reasons,
        "wrong": [
            {name: getattr(t, name) for name in columns}
            | {"config": str(falls[t.number]) if t.number in falls else None}
            for t in (*found.fell, *found.off_gait)
        ],
    }


def _share(found: Campaign, of: tuple[Trial, ...]) -> dict[str, float]:
    low, high = found.interval(of)
    return {"count": len(of), "share": len(of) / len(found.trials), "low": low, "high": high}
