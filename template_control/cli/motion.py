"""``template-control walk``, ``run`` and ``go``: an experiment is run, kept and reported."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, field

from template_control.checks import option_types as values
from template_control.cli.experiment_options import add_flags, experiment_from
from template_control.cli.flags import ALL, SCENARIO
from template_control.cli.interrupts import INTERRUPTED
from template_control.cli.report import (
    NO_STANDS,
    Kept,
    add_output_options,
    print_route_table,
    print_table,
    run_and_keep,
    summarise_route,
)
from template_control.errors import ParameterError
from template_control.run.experiment import Experiment, PreparedExperiment
from template_control.run.specs import GaitSpec
from template_control.run.summary import summarise
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.terminal import plain_console

_KEPT = (
    " Ends with a table, and a folder with the run (run.npz), what repeats it (run.toml) and"
    " figures. Exit status: 0, 1 after a fall, 2 for bad input or a file that cannot be written,"
    " 130 after Ctrl-C (what was done by then is saved, without figures)."
)


@dataclass(frozen=True)
class Motion:
    """A command that runs an experiment.

    Attributes:
        doing: in front of the progress bar.
        about: first sentences of the description.
        report: does the run, and returns what is kept of it.
        default: experiment where no option says otherwise.
        file: whether the scenario's file is named without a flag.
    """

    doing: str
    about: str
    report: Callable[[argparse.Namespace, Experiment, PreparedExperiment, str], Kept]
    default: Experiment = field(default_factory=Experiment)
    file: bool = False

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's description and options."""
        parser.description = self.about + _KEPT
        flags = [flag for flag in ALL if not (self.file and flag is SCENARIO)]
        if self.file:
            parser.add_argument(
                "scenario",
                nargs="?",
                type=values.path,
                metavar="FILE",
                help="the scenario, such as examples/example_one.toml; not needed with --config",
            )
        add_flags(parser, flags)
        add_output_options(parser, f"runs/{parser.prog.split()[-1]}")

    def run(self, options: argparse.Namespace) -> int:
        """Do the run; returns 0, 1 after a fall, 130 after Ctrl-C."""
        experiment = experiment_from(options, self.default)
        kept = self.report(options, experiment, experiment.prepare(), self.doing)
        if kept.interrupted():
            return INTERRUPTED
        return 1 if kept.record.fell else 0


def _alone(
    options: argparse.Namespace, experiment: Experiment, prepared: PreparedExperiment, doing: str
) -> Kept:
    """The robot's run alone."""
    kept = run_and_keep(options, experiment, prepared, doing)
    figures = summarise(kept.record, kept.path)
    if options.json:
        print(json.dumps(figures))
    else:
        print_table(figures)
    return kept


def _with_template(
    options: argparse.Namespace, experiment: Experiment, prepared: PreparedExperiment, doing: str
) -> Kept:
    """The robot's run through a scenario next to its template's."""
    route = prepared.motion
    if not isinstance(route, ScenarioRoute):
        raise ParameterError("no scenario is given: name a file, such as examples/example_one.toml")
    if route.scenario.stands:
        plain_console(stderr=True).print(NO_STANDS)
    with plain_console(stderr=True).status("the template"):
        template = simulate_scenario(route.scenario)
    kept = run_and_keep(options, experiment, prepared, doing, template)
    figures = summarise_route(kept.record, template, kept.path)
    if options.json:
        print(json.dumps(figures))
    else:
        print_route_table(figures)
    return kept


WALK = Motion(
    "walking",
    "Walk a robot in a physics engine or on an ideal plant: a planner on the SLIP template chooses"
    " each step, a whole-body QP makes the robot follow it.",
    _alone,
)
RUN = Motion(
    "running",
    "Run a robot in a physics engine or on an ideal plant: a planner on the SLIP template chooses"
    " each stride from apex to apex, a whole-body QP makes the robot follow it.",
    _alone,
    Experiment(motion=GaitSpec("run")),
)
GO = Motion(
    "going",
    "Take a robot through a scenario (TOML): a speed profile with gait switches. The same scenario"
    " is simulated on the robot's template (template.npz), and shown next to it.",
    _with_template,
    file=True,
)
