"""Options of the robot and of what it does, and the run that a command's options describe."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from template_control.checks import option_types as values
from template_control.checks import typed
from template_control.checks.option_types import number
from template_control.checks.ranges import Range
from template_control.cli.world_options import simulation_choice
from template_control.embedding.free.options import FREE_PLANNER
from template_control.embedding.planners.ahead import AheadOptions, AheadPlanner, check_feasibility
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.planners.modified import ModifiedOptions
from template_control.errors import ParameterError
from template_control.estimation.imu import ImuOptions
from template_control.robot.library import FLOATING_ROBOTS, ROBOTS
from template_control.run.config import PreparedRun, RunConfig
from template_control.run.sensing import SensorOptions
from template_control.run.simulation import perturbed_start
from template_control.run.specs import GaitSpec, OwnPlanner, PlannerSpec, RobotSpec
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.scenario.scenario import Scenario, load_scenario
from template_control.slip.similarity import Scale

_DEFAULT = RobotSpec().model
_TURN = Range(-6.3, 6.3)  # [rad] about once around: degrees are not taken for it


def add_robot_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--robot`` and what a URDF of one's own may need."""
    parser.add_argument(
        "--robot",
        metavar="NAME|URDF",
        help=f"a shipped robot ({', '.join(ROBOTS)}) or the path of a planar URDF; {_DEFAULT} if"
        " not given",
    )
    parser.add_argument(
        "--floating-base",
        "--free",
        dest="free",
        action="store_const",
        const=True,
        help=f"nothing holds the robot: it walks in space, as {', '.join(FLOATING_ROBOTS)} can, and"
        " 3D URDFs of two legs with hip ab- and adduction",
    )
    own = parser.add_argument_group("a URDF of your own")
    own.add_argument(
        "--feet",
        nargs=2,
        metavar=("LEFT", "RIGHT"),
        help="its foot links; left_foot and right_foot if not given",
    )
    own.add_argument(
        "--sagittal-joints",
        nargs=4,
        metavar="JOINT",
        help="of a 3D URDF: hips and knees; the other joints are locked, the base is held in"
        " the sagittal plane",
    )
    own.add_argument(
        "--locked",
        nargs="+",
        metavar="JOINT=RAD",
        help="of a 3D URDF: angles of locked joints; in its plane a robot's other joints are locked"
        " at 0",
    )
    own.add_argument(
        "--foot-radius",
        type=number(Range(0.0, 1.0, above=True)),
        metavar="M",
        help="of a 3D URDF: radius of the spheres put into its feet",
    )
    own.add_argument(
        "--foot-offset",
        type=number(Range(-1.0, 1.0)),
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="of these spheres' centres from the foot links' origins, in the links' axes [m]",
    )
    own.add_argument(
        "--lossless",
        action="store_const",
        const=True,
        help="leave out the damping and friction of the URDF's joints",
    )


def robot_choice(options: argparse.Namespace, base: RobotSpec) -> RobotSpec:
    """The robot that was asked for.

    Args:
        options: as parsed.
        base: what holds where an option was not given. It describes one robot: with another
            ``--robot`` nothing of it is kept.
    """
    given: dict[str, Any] = {}
    if options.robot is not None:
        base = RobotSpec()
        given["model"] = _model(options.robot)
    for name in ("feet", "sagittal_joints", "foot_offset"):
        if getattr(options, name) is not None:
            given[name] = tuple(getattr(options, name))
    if options.foot_radius is not None:
        given["foot_radius"] = options.foot_radius
    for name in ("free", "lossless"):
        if getattr(options, name) is not None:
            given[name] = True
    if options.locked is not None:
        texts = typed.entries("--locked", options.locked, "JOINT=ANGLE with the angle in rad")
        given["locked"] = {
            joint: typed.number(f"--locked {joint}", text, Annotated[float, _TURN])
            for joint, text in texts.items()
        }
    return replace(base, **given)


def _model(robot: str) -> str:
    """A path is made absolute, so that what is written down does not depend on the folder."""
    own = robot not in ROBOTS and ("/" in robot or robot.endswith(".urdf"))
    return str(Path(robot).absolute()) if own else robot


_PLANNERS = {options.kind: options for options in (LqrOptions, AheadOptions, ModifiedOptions)}
_MAPS = {kind.name.lower(): kind for kind in (MapKind.PAPER, MapKind.IMPROVED, MapKind.EXACT)}
_GIVEN = {
    "name": "gait",
    "speed": "speed",
    "touchdown_angle": "touchdown_angle",
    "apex_height": "apex",
}
"""By the field of a :class:`GaitSpec`, the option that sets it."""


def add_gait_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--scenario``, ``--gait``, ``--speed`` and ``--touchdown-angle``."""
    parser.add_argument(
        "--scenario",
        type=values.path,
        metavar="TOML",
        help="a speed profile to walk, as template-control slip takes it, instead of one gait; it"
        " ends with the profile, or after --steps",
    )
    parser.add_argument(
        "--gait",
        choices=("walk", "paper"),
        help="walk (if not given): the robot's own, for most touchdown angle 66 deg and 1.1 m/s at"
        " VLO; paper: the equilibrium of Section IV-D, 0.9818 m and 826 J; both are given for"
        " l0 = 1 m and 80 kg and scaled to the robot",
    )
    parser.add_argument(
        "--speed",
        type=values.number(values.SPEED),
        metavar="M/S",
        help="mean forward speed of the gait instead of the walk gait's own",
    )
    parser.add_argument(
        "--touchdown-angle",
        type=values.number(Range(1.0, 89.0)),
        metavar="DEG",
        help="of the gait instead of the walk gait's own, from the ground to the leg",
    )


def add_strict(parser: argparse.ArgumentParser) -> None:
    """Add ``--strict``."""
    parser.add_argument(
        "--strict",
        action="store_true",
        help="refuse a scenario whose walk wants a speed or a change of speed that cannot be had;"
        " without this the nearest is taken, and the table says so",
    )


def add_stand_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--from-stand`` and ``--to-stand``."""
    parser.add_argument(
        "--from-stand", action="store_true", help="stand for 2 s, and start to walk from there"
    )
    parser.add_argument(
        "--to-stand",
        action="store_true",
        help="stop after the steps, and stand for 2 s; steps of start and stop come on top",
    )


def add_running_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--speed`` and ``--apex`` of a run."""
    parser.add_argument(
        "--speed",
        type=values.number(values.SPEED),
        metavar="M/S",
        help="at apex; 3 m/s for l0 = 1 m if not given",
    )
    parser.add_argument(
        "--apex",
        type=values.number(Range(0.01, 10.0)),
        metavar="M",
        help="height of the apex; one that suits the speed if not given",
    )


def add_planner_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--planner`` and ``--map``."""
    parser.add_argument(
        "--planner",
        metavar="NAME|MODULE:CLASS",
        help="lqr: LQR on the VLO state with an offset estimate; ahead: plans several steps at"
        " once, towards any speed; modified: the paper's modified walking controller, equation"
        " (38); or a class of your own, called with the gait. If not given: ahead where a scenario"
        " walks only, else lqr",
    )
    parser.add_argument(
        "--map",
        choices=tuple(_MAPS),
        help="return map that the modified planner tries its steps on; exact if not given",
    )


def gait_choice(options: argparse.Namespace, base: GaitSpec) -> GaitSpec:
    """The gait that was asked for.

    Args:
        options: as parsed.
        base: what holds where an option was not given.

    Raises:
        ParameterError: if the options do not go together.
    """
    given = {field: getattr(options, name, None) for field, name in _GIVEN.items()}
    return replace(base, **{name: value for name, value in given.items() if value is not None})


def scenario_choice(options: argparse.Namespace, base: Scenario | None) -> Scenario | None:
    """The scenario that was asked for.

    Args:
        options: as parsed.
        base: what holds where the option was not given.

    Raises:
        ScenarioError: if it cannot be read.
    """
    path = getattr(options, "scenario", None)
    return base if path is None else load_scenario(path)


def planner_choice(
    options: argparse.Namespace, base: PlannerSpec | None, free: bool
) -> PlannerSpec | None:
    """The planner that was asked for.

    Args:
        options: as parsed.
        base: what holds where an option was not given.
        free: whether nothing holds the robot; its lqr has a tuning of its own.

    Returns:
        None where neither says one: the run's own default.

    Raises:
        ParameterError: if there is no such planner, or it takes no map.
    """
    chosen = base
    if not hasattr(options, "planner"):
        return chosen
    if options.planner in _PLANNERS and (base is None or options.planner != base.kind):
        kind = _PLANNERS[options.planner]
        chosen = FREE_PLANNER if free and kind is LqrOptions else kind()
    elif options.planner is not None and options.planner not in _PLANNERS:
        if ":" not in options.planner:
            raise ParameterError(
                f"--planner is {options.planner!r}: give {', '.join(_PLANNERS)} or module:Class"
            )
        chosen = OwnPlanner(options.planner)
    if options.map is None:
        return chosen
    if not isinstance(chosen, ModifiedOptions):
        raise ParameterError(
            f"--map does not go with planner {chosen.kind if chosen else 'lqr'}: leave it out, or"
            " give --planner modified"
        )
    return replace(chosen, map_kind=_MAPS[options.map])


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
    check_feasibility(ready.route, planner)
