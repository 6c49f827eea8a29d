"""The options that say what a robot does: gait, scenario and planner."""

from __future__ import annotations

import argparse
from dataclasses import replace

from template_control.checks import option_types as values
from template_control.checks.ranges import Range
from template_control.embedding.free.options import FREE_PLANNER
from template_control.embedding.planners.ahead import AheadOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.planners.modified import ModifiedOptions
from template_control.errors import ParameterError
from template_control.run.specs import GaitSpec, OwnPlanner, PlannerSpec
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.scenario.scenario import Scenario, load_scenario

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
