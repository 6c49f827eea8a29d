"""``--config``, and the run that a command's options describe."""

from __future__ import annotations

import argparse
from dataclasses import replace

from template_control.checks import option_types as values
from template_control.cli.options.gait import gait_choice, planner_choice, scenario_choice
from template_control.cli.options.robot import robot_choice
from template_control.cli.options.world import simulation_choice
from template_control.embedding.planners.ahead import AheadPlanner, rehearse
from template_control.errors import ParameterError
from template_control.estimation.imu import ImuOptions
from template_control.run.config import PreparedRun, RunConfig
from template_control.run.sensing import SensorOptions
from template_control.run.simulation import perturbed_start
from template_control.slip.similarity import Scale


def add_config(parser: argparse.ArgumentParser) -> None:
    """Add ``--config``."""
    parser.add_argument(
        "--config",
        type=values.path,
        metavar="TOML",
        help="a run's options, such as the run.toml that lies beside every run.npz; options on the"
        " command line come before those of the file",
    )


def config_from(options: argparse.Namespace, default: RunConfig) -> RunConfig:
    """The run that was asked for, but for what needs its gait: see :func:`prepared`.

    Args:
        options: as parsed, of all groups of this folder.
        default: what holds where neither an option nor a file says otherwise.

    Raises:
        TemplateControlError: naming the option or the key that is wrong.
    """
    base = default if options.config is None else RunConfig.load(options.config)
    scenario = scenario_choice(options, base.scenario)
    robot = robot_choice(options, base.robot)
    return RunConfig(
        robot=robot,
        gait=gait_choice(options, base.gait),
        planner=planner_choice(options, base.planner, robot.free),
        simulation=simulation_choice(options, base.simulation, scenario is not None),
        scenario=scenario,
    )


def prepared(
    options: argparse.Namespace, default: RunConfig | None = None
) -> tuple[RunConfig, PreparedRun]:
    """The run that was asked for, and what it is made of.

    Args:
        options: as parsed, of all groups of this folder.
        default: what holds where neither an option nor a file says otherwise; None: the walk.

    Raises:
        TemplateControlError: naming the option or the key that is wrong.
    """
    config = config_from(options, default or RunConfig())
    before, after = getattr(options, "from_stand", False), getattr(options, "to_stand", False)
    if before or after:
        config = config.with_stands(before, after)
    if options.seed is not None and config.scenario is not None:
        raise ParameterError("--seed does not go with a scenario: leave one out")
    ready = config.prepare()
    if getattr(options, "strict", False):
        _check_strictly(ready)
    simulation = config.simulation
    if options.seed is not None:
        simulation = replace(simulation, start=perturbed_start(ready.gait, options.seed))
    estimate = getattr(options, "estimate", False)
    if estimate and options.noise is not None:
        raise ParameterError(
            "--noise does not go with --estimate, which has its own: leave one out"
        )
    sensors = simulation.sensors
    errors = sensors.contact_errors if options.contact_errors is None else options.contact_errors
    if estimate:
        sensors = ImuOptions(seed=options.seed or 0)
    if options.noise is not None:
        scale = Scale.of(ready.gait.parameters)
        sensors = SensorOptions.of_size(options.noise, scale, sensors.seed)
    simulation = replace(simulation, sensors=replace(sensors, contact_errors=errors))
    return replace(config, simulation=simulation), ready


def _check_strictly(ready: PreparedRun) -> None:
    """Refuse a walk that cannot be had as it is wanted.

    Raises:
        ScenarioError: if it cannot.
        ParameterError: if that is known only of walks of any speed.
    """
    planner = next(iter(ready.planners.values()))
    if ready.route is None or not isinstance(planner, AheadPlanner):
        raise ParameterError(
            "--strict goes with a scenario that only walks, and with planner ahead: leave it out"
        )
    rehearse(ready.route, planner)
