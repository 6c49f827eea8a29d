"""``template-control walk``, ``run`` and ``go``: an experiment is run, kept and reported."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from template_control.checks import option_types as values
from template_control.cli.experiment_options import add_flags, experiment_from
from template_control.cli.flags import ALL, SCENARIO
from template_control.cli.interrupts import INTERRUPTED
from template_control.cli.notices import notice
from template_control.cli.plots import add_figure_options
from template_control.cli.report import NO_STANDS, add_template, run_and_keep, tables
from template_control.errors import ParameterError
from template_control.run.experiment import Experiment
from template_control.run.specs import GaitSpec
from template_control.run.summary import summarise
from template_control.slip.gaits.gait import Gait
from template_control.slip.scenario.route import Route
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.storage import Files
from template_control.terminal import plain_console, report

_KEPT = (
    " Ends with a table, and a folder with the run (run.npz), what repeats it (run.toml) and"
    " figures. Exit status: 0, 1 after a fall, 2 for bad input or a file that cannot be written,"
    " 130 after Ctrl-C (what was done by then is saved, without figures)."
)


@dataclass(frozen=True)
class Motion:
    """A command that runs an experiment; ``default`` is of :func:`experiment_from`.

    ``doing`` is in front of the progress bar, ``about`` begins the description; ``template`` says
    whether a scenario, named without a flag, is simulated on the template too.
    """

    doing: str
    about: str
    default: Experiment | None = None
    template: bool = False

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's description and options."""
        parser.description = self.about + _KEPT
        flags = [flag for flag in ALL if not (self.template and flag is SCENARIO)]
        if self.template:
            parser.add_argument(
                "scenario",
                nargs="?",
                type=values.path,
                metavar="FILE",
                help="the scenario, such as examples/example_one.toml; not needed with --config",
            )
        add_flags(parser, flags)
        folder = f"runs/{parser.prog.split()[-1]}"
        about = (
            f"folder for run.npz, run.toml and figures, {folder} if not given; a run that is"
            " there is replaced, and the command says so"
        )
        values.add_folder(parser, folder, about)
        values.add_json(parser)
        add_figure_options(parser)

    def run(self, options: argparse.Namespace) -> int:
        """Do the run; returns 0, 1 after a fall, 130 after Ctrl-C."""
        experiment = experiment_from(options, self.default)
        prepared = experiment.prepare()
        template = _template_of(prepared.motion) if self.template else None
        files = Files()
        record, path = run_and_keep(options, experiment, prepared, self.doing, template, files)
        figures = summarise(record, path)
        if template is not None:
            add_template(figures, record, template)
        report(options.json, figures, *tables(figures))
        files.raise_pending()
        if record.interrupted:
            notice(f"interrupted: the run up to here is in {path}")
            return INTERRUPTED
        return 1 if record.fell else 0


def _template_of(motion: Gait | Route) -> ScenarioRecord:
    """The scenario of a run on the robot's template; a ParameterError if there is none."""
    if not isinstance(motion, ScenarioRoute):
        raise ParameterError("no scenario is given: name a file, such as examples/example_one.toml")
    if motion.scenario.stands:
        plain_console(stderr=True).print(NO_STANDS)
    with plain_console(stderr=True).status("the template"):
        return simulate_scenario(motion.scenario)


WALK = Motion(
    "walking",
    "Walk a robot in a physics engine or on an ideal plant: a planner on the SLIP template chooses"
    " each step, a whole-body QP makes the robot follow it.",
)
RUN = Motion(
    "running",
    "Run a robot in a physics engine or on an ideal plant: a planner on the SLIP template chooses"
    " each stride from apex to apex, a whole-body QP makes the robot follow it.",
    Experiment(motion=GaitSpec("run")),
)
GO = Motion(
    "going",
    "Take a robot through a scenario (TOML): a speed profile with gait switches. The same scenario"
    " is simulated on the robot's template (template.npz), and shown next to it.",
    template=True,
)
