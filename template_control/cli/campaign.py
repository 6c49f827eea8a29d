"""``template-control campaign``: robustness of a gait with everything disturbed at once."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from template_control import settings
from template_control.checks import option_types as values
from template_control.checks.ranges import Range
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
from template_control.run.experiment import Experiment
from template_control.run.specs import GaitSpec
from template_control.storage import Files, write_text, writing
from template_control.sweep.executor import workers
from template_control.terminal import Table, plain_console
from template_control.view.trial_figures import campaign_figure

_LISTED = 20  # trials that went wrong, at most, in the printed table


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
    add_workers(parser)
    parser.add_argument(
        "--output",
        type=values.path,
        help="folder for results, figure and falls; by default runs/campaign/ROBOT, with free"
        " if nothing holds it, the gait's name if it is a run, and the engine's if it is not"
        " PyBullet",
    )
    add_printed(parser)


def run(options: argparse.Namespace) -> int:
    """Run the trials as the options say; returns 0, or 130 after Ctrl-C.

    Raises:
        TemplateControlError: naming the option that is wrong.
    """
    experiment = experiment_from(options, Experiment())
    default = FLOATING_MIX if experiment.free else DisturbanceDistribution()
    mix = default if options.mix is None else settings.read(DisturbanceDistribution, options.mix)
    conditions = CampaignConfig(experiment, mix.times(options.severity), options.draws)
    robot = conditions.trial(0)[1].robot  # before a folder is made for it
    with writing(folder_of(options, experiment, "runs/campaign", robot.name)) as folder:
        return _try(options, conditions, folder)


def _try(options: argparse.Namespace, conditions: CampaignConfig, folder: Path) -> int:
    """Run the trials, with all files in ``folder``."""
    try:
        with workers(options.workers) as pool, stdout_to_stderr():
            found = run_campaign(conditions, options.trials, folder, pool)
    except KeyboardInterrupt:
        return kept(folder)
    files = Files()
    files.write(lambda: _save_mix(conditions.mix, folder))
    falls = files.write(lambda: save_falls(found, folder)) or {}
    figure = files.write(lambda: draw(lambda: campaign_figure(found), folder / "campaign.png"))
    if options.json:
        print(json.dumps({**data(found, falls), "figure": None if figure is None else str(figure)}))
    elif options.markdown:
        print(markdown(found))
    else:
        _print_tables(found, falls, figure)
    files.raise_pending()
    return 0


def _save_mix(mix: DisturbanceDistribution, folder: Path) -> Path:
    head = "# template-control campaign --mix FILE draws from these ranges.\n"
    return write_text(folder / "mix.toml", head + settings.text(settings.to_table(mix)))


def data(found: Campaign, falls: dict[int, Path]) -> dict[str, Any]:
    """The campaign as plain data; ``falls`` are the files of the trials that went wrong, by number.

    robot, gait, plant, trials, mix; fell and astray (count, share, and low and high of its 95 %
    interval); reasons (count by what went wrong first); wrong: number, fell, reason, first,
    speed_error, severity, config.
    """
    conditions = found.conditions
    table = settings.to_table(conditions.experiment.resolved())
    return {
        "robot": found.conditions.experiment.robot_name,
        "gait": table["motion"],
        "plant": table["world"]["kind"],
        "trials": len(found.trials),
        "mix": settings.to_table(conditions.mix),
        "fell": _share(found, found.fell),
        "astray": _share(found, found.off_gait),
        "reasons": found.reasons,
        "wrong": [
            {
                "number": t.number,
                "fell": t.fell,
                "reason": t.reason,
                "first": t.first,
                "speed_error": t.speed_error,
                "severity": t.severity,
                "config": str(falls[t.number]) if t.number in falls else None,
            }
            for t in (*found.fell, *found.off_gait)
        ],
    }


def _share(found: Campaign, of: tuple[Trial, ...]) -> dict[str, float]:
    low, high = found.interval(of)
    return {"count": len(of), "share": len(of) / len(found.trials), "low": low, "high": high}


def _rows(found: Campaign) -> list[tuple[str, str, str, str]]:
    rows = []
    for name, of in (("fell", found.fell), ("off its gait", found.off_gait)):
        low, high = found.interval(of)
        share = len(of) / len(found.trials)
        rows.append((name, str(len(of)), f"{share:.2%}", f"{low:.2%} to {high:.2%}"))
    return rows


_COLUMNS = ("of the trials", "count", "share", "with 95 % confidence")


def _title(found: Campaign) -> str:
    e = found.conditions.experiment
    gait = e.motion if isinstance(e.motion, GaitSpec) else GaitSpec()
    speed = "" if gait.speed is None else f" at {gait.speed:g} m/s"
    return (
        f"{e.robot_name}, {gait.name}{speed}, in {plant_name(e.world)}: {len(found.trials)} trials"
    )


def markdown(found: Campaign) -> str:
    """The shares as a table of Markdown, and what the falls began with."""
    rows = [_COLUMNS, tuple("---" for _ in _COLUMNS), *_rows(found)]
    lines = [_title(found) + ":", "", *("| " + " | ".join(r) + " |" for r in rows)]
    if found.reasons:
        told = ", ".join(f"{name} {count}" for name, count in found.reasons.items())
        lines += ["", f"The falls began with: {told}."]
    return "\n".join(lines)


def _print_tables(found: Campaign, falls: dict[int, Path], figure: Path | None) -> None:
    console = plain_console()
    table = Table(title=_title(found))
    for column in _COLUMNS:
        table.add_column(column)
    for row in _rows(found):
        table.add_row(*row)
    console.print(table)
    wrong = (*found.fell, *found.off_gait)
    if wrong:
        listed = Table(title="what went wrong")
        for column in ("trial", "first", "how it ended", "repeat it with"):
            listed.add_column(column)
        for t in wrong[:_LISTED]:
            end = t.reason or f"{t.speed_error or 0.0:+.1%} in speed"
            file = falls.get(t.number)
            command = "" if file is None else f"walk --config {file}"
            listed.add_row(str(t.number), t.first, end, command)
        console.print(listed)
        if len(wrong) > _LISTED:
            console.print(f"and {len(wrong) - _LISTED} more, each with its file beside these")
    if figure is not None:
        console.print(f"figure: {figure}", highlight=False)
