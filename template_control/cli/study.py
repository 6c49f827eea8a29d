"""``template-control study``: figures of an experiment where some of its keys change."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from template_control import settings
from template_control.checks import option_types as values
from template_control.cli.trial_options import Report, add_trial_options, report_trials
from template_control.storage import writing
from template_control.sweep.study import Study, run_study
from template_control.sweep.sweep import SweepResult
from template_control.view.trial_figures import study_figure


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Run a study: an experiment over a grid or a sample of some of its keys (TOML). Ends with a"
        " table and a figure, a heat map of a grid of two keys. A stopped study goes on where it"
        " was. Exit status: 0, 2 for bad input, 130 after Ctrl-C."
    )
    parser.add_argument("study", type=values.path, metavar="FILE", help="the study")
    add_trial_options(parser, "folder for trials and figure, runs/study/NAME if not given")


def run(options: argparse.Namespace) -> int:
    """Run the trials that are missing, and print all; returns 0, or 130 after Ctrl-C."""
    study = Study.load(options.study)
    with writing(options.output or Path("runs/study") / options.study.stem) as folder:
        return report_trials(
            options,
            folder,
            lambda pool: run_study(study, folder / "trials.jsonl", pool),
            lambda result, _: _report(study, result, options.study.stem),
        )


def _report(study: Study, result: SweepResult, name: str) -> Report:
    rows, data, failed = [], [], any(result.errors)
    for item, found, error in zip(result.items, result.results, result.errors, strict=True):
        keys = item["item"]
        figures = [_text(found[figure]) if found else "" for figure in study.figures]
        rows.append([*map(_text, keys.values()), *figures, *[error or ""] * failed])
        data.append({"keys": keys, "figures": found, "error": error})
    return Report(
        title=study.about or name,
        columns=[*study.axes, *study.figures, *["why not"] * failed],
        rows=rows,
        data={"about": study.about, "trials": data},
        figure=lambda: study_figure(study, result),
        name="figure.png",
    )


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return settings.literal(value) if isinstance(value, dict | list | tuple) else str(value)
