"""Study: what the figures of an experiment are where some of its keys change."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from template_control import settings
from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Count, Index
from template_control.errors import ParameterError, SweepError
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.run.summary import summarise
from template_control.sweep.sweep import Item, SweepOptions, SweepResult, grid, sample, sweep

_OPTIONS = SweepOptions(label="study")


@dataclass(frozen=True)
class Study(Checked):
    """A question to an experiment: its figures where some of its keys change.

    Attributes:
        about: the question.
        experiment: what all trials have, a table as of an experiment's TOML file.
        grid: values by keys; all combinations are tried. Keys with a space between them get the
            same value, as in ``"world.friction controller.qp.friction"``.
        sample: least and largest value by keys, drawn ``draws`` times with ``seed``.
        draws: number of trials of a sample.
        seed: of its draws.
        figures: that are asked for, of the summary of a run
            (:func:`~template_control.run.summarise`), with dots into its entries, as in
            ``"com_error_rms.x"``; the first one is that of the heat map.

    Raises:
        ParameterError: if there is neither a grid nor a sample, or both, or a figure is missing.
    """

    about: str = ""
    experiment: Mapping[str, Any] = field(default_factory=dict)
    grid: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    sample: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    draws: Count = 20
    seed: Index = 0
    figures: tuple[str, ...] = ("steps", "fell", "mean_speed")

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.grid) == bool(self.sample):
            raise ParameterError("a study has a grid or a sample: give one of them")
        if not self.figures:
            raise ParameterError("a study asks for no figure: give figures, such as steps")

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Study:
        """Read a study from TOML.

        Raises:
            ParameterError: naming the file and the key, if it cannot be read or has an unknown one.
        """
        return settings.read(Study, path)

    @property
    def axes(self) -> tuple[str, ...]:
        """The keys that change."""
        return tuple(self.grid or self.sample)

    def items(self) -> list[Item]:
        """Values of the keys that change, one dictionary a trial."""
        if self.grid:
            return grid(**self.grid)
        return sample(self.draws, self.seed, **self.sample)

    def trial(self, item: Item) -> Experiment:
        """Experiment of a trial; ``item`` are values of the keys that change.

        Raises:
            ParameterError: naming the key that is unknown, or whose value does not fit.
        """
        return _experiment(self.experiment, item)


def _experiment(table: Mapping[str, Any], item: Item) -> Experiment:
    changed = {key: value for names, value in item.items() for key in names.split()}
    return settings.from_table(Experiment, dict(table), "experiment").with_(changed)


def run_trial(experiment: dict[str, Any], item: Item, figures: list[str]) -> dict[str, Any]:
    """Figures of a trial, by name."""
    summary = summarise(simulate(_experiment(experiment, item)), None)
    return {name: _entry(summary, name) for name in figures}


def _entry(summary: dict[str, Any], name: str) -> Any:
    """A figure of a summary, by its dotted name."""
    found: Any = summary
    for part in name.split("."):
        if not isinstance(found, dict) or part not in found:
            raise SweepError(f"a run has no figure {name!r}: template-control walk --json has all")
        found = found[part]
    return found


@checked
def run_study(
    study: Study | str | Path,
    path: str | Path | None = None,
    executor: Executor | None = None,
    options: SweepOptions = _OPTIONS,
) -> SweepResult:
    """Run a study; each trial is on disk as soon as it is done, and a stopped study goes on.

    Arguments as for :func:`~.sweep.sweep`; the study is the question, or its TOML file.

    Returns:
        Trials and their figures, in order; a trial that cannot be run has its reason in ``errors``.

    Raises:
        ParameterError: if the study cannot be read, or the first trial is no experiment.
        SweepError: as :func:`~.sweep.sweep` raises it.
    """
    asked = study if isinstance(study, Study) else Study.load(study)
    rows = asked.items()
    asked.trial(rows[0])  # a wrong key is no failed trial
    common = {"experiment": dict(asked.experiment), "figures": list(asked.figures)}
    items = [{**common, "item": row} for row in rows]
    return sweep(run_trial, items, path, executor, options=options)


def heat_map(study: Study, result: SweepResult) -> Array | None:
    """The first figure over a grid of two axes.

    Args:
        study: the question.
        result: its trials.

    Returns:
        (n, m) by the values of the first and of the second axis, NaN where a trial failed; None
        where the study has no such grid.
    """
    if len(study.grid) != 2:
        return None
    shape = tuple(len(values) for values in study.grid.values())
    return result.column(study.figures[0]).reshape(shape)
