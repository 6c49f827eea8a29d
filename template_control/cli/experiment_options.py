"""Options of the commands that make an experiment: short flags, and one for every key.

Every key of the experiment's file has a flag, ``--KEY VALUE`` with the value as TOML says it, which
``template-control keys`` lists; :mod:`~.flags` has short ones for some.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

from template_control.checks import option_types as values
from template_control.cli.flags import ALL, GAIT, LEAVES, OWN_URDF, PERTURBED, STANDS, Flag
from template_control.embedding.options import KINDS
from template_control.embedding.planners.ahead import AheadOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.planners.modified import ModifiedOptions
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.run.specs import OwnPlanner, PlannerSpec
from template_control.slip.scenario.scenario import Scenario

_LONG, _THIN = 200, 5  # steps beyond which by default every 5th sample is kept
_PLANNERS = {options.kind: options for options in get_args(PlannerSpec) if options != OwnPlanner}


def add_flags(parser: argparse.ArgumentParser, flags: Sequence[Flag]) -> None:
    """Add ``--config``, flags (some of ``ALL``), and one for every key."""
    parser.add_argument(
        "--config",
        type=values.path,
        metavar="TOML",
        help="an experiment, such as the run.toml next to every run.npz; options on the command"
        " line come before those of the file",
    )
    own = parser.add_argument_group("a URDF of your own")
    for flag in flags:
        flag.add(own if flag in OWN_URDF else parser)
    parser.add_argument_group(
        "all keys", "every key of an experiment's file is an option: template-control keys"
    )
    for key in LEAVES:
        if "." in key:
            parser.add_argument(
                f"--{key}", dest="keys", action=_Key, help=argparse.SUPPRESS, metavar="VALUE"
            )


class _Key(argparse.Action):
    """Collects ``--KEY VALUE``, the value as TOML says it; a text may be without its quotes."""

    def __call__(self, parser: Any, namespace: Any, value: Any, option: Any = None) -> None:
        try:
            found = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            found = value
        keys = {**(getattr(namespace, "keys", None) or {}), str(option)[2:]: found}
        namespace.keys = keys


def experiment_from(options: argparse.Namespace, default: Experiment | None = None) -> Experiment:
    """The experiment that was asked for; ``default`` holds where nothing says otherwise."""
    base = default or Experiment()
    if options.config is not None:
        base = Experiment.load(options.config)
    given: dict[str, Any] = {}
    for flag in ALL:
        value = getattr(options, flag.dest, None)
        if value is not None:
            found = value if flag.read is None else flag.read(value)
            given |= dict.fromkeys(flag.keys.split(), found)
    _check_motion(base, given)
    typed_keys: dict[str, Any] = options.keys or {}
    first = ("robot", "motion", "world.kind", "sensors.kind")
    head = {k: v for k, v in (given | typed_keys).items() if k.startswith(first)}
    base = base.with_(head)
    rest = {k: v for k, v in given.items() if k not in head}
    _complete(base, options, rest)
    return base.with_(rest | {k: v for k, v in typed_keys.items() if k not in head})


def _check_motion(base: Experiment, given: dict[str, Any]) -> None:
    """Refuse a gait's option where there is a scenario."""
    if isinstance(given.get("motion", base.motion), Scenario):
        for flag in (*GAIT, *STANDS, PERTURBED):
            if flag.keys in given:
                hint = ": give it segments that stand" if flag in STANDS else ": leave one out"
                raise ParameterError(f"{flag.names} does not go with a scenario{hint}")


def _complete(base: Experiment, options: argparse.Namespace, given: dict[str, Any]) -> None:
    """Set a flag's further keys, which depend on the rest of the experiment."""
    if not isinstance(base.world, PlantOptions):
        given.pop("world.friction", None)  # the ideal world has none
    if "world.robot" in given and isinstance(base.robot, RobotSpec):
        model = given["world.robot"].model  # what else it needs, it needs as the controller's
        given["world.robot"] = replace(base.robot, model=model, gravity=None, masses={})
    if "planner" in given:
        given["planner"] = _planner(given["planner"], base)
    if "planner.map_kind" in given:
        chosen = given.get("planner") or base.resolved().planner
        if not isinstance(chosen, ModifiedOptions):
            raise ParameterError(
                f"--map does not go with planner {getattr(chosen, 'kind', 'of your own')}: leave it"
                " out, or give --planner modified"
            )
    if "course.turns" in given:
        (_, rate), *later = given.pop("course.turns")
        given |= {"course.turning_rate": rate, "course.turns": later}
    seed = given.get("seed")
    if seed is not None:
        given["start"] = None  # the file's
    if getattr(options, "estimate", None):
        if "sensors.noise" in given:
            raise ParameterError(
                "--noise does not go with --estimate, which has its own: leave one out"
            )
        given["sensors.seed"] = seed or 0
    if "sensors.noise" in given:
        given |= {"sensors.kind": "state"} | {
            f"sensors.{name}_noise": 0.0 for name in ("position", "velocity")
        }
    if options.config is None and given.get("steps", 0) > _LONG:
        given.setdefault("record_every", _THIN)


def _planner(name: str, base: Experiment) -> Any:
    """Options of a planner by its name; of the same one as before those that it had."""
    if name not in _PLANNERS:
        if ":" not in name:
            raise ParameterError(
                f"--planner is {name!r}: give {', '.join(_PLANNERS)} or module:Class"
            )
        return OwnPlanner(name)
    if getattr(base.planner, "kind", None) == name:
        return base.planner
    own = KINDS[base.tuning.kind]
    return {LqrOptions.kind: own.lqr, AheadOptions.kind: own.ahead}.get(name) or _PLANNERS[name]()
