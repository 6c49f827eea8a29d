"""Options of how a run goes (plant, disturbances, length), and of where it is kept."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

from template_control.checks import option_types as values
from template_control.checks import typed
from template_control.checks.option_types import MANY, SEED, number, whole
from template_control.checks.ranges import Index, NotNegative, Range
from template_control.embedding.free.options import FreeOptions
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.plant.terrain_spec import terrain_from
from template_control.run.options import HeadingCommand, Phase, Push, SimulationOptions, TurningRate
from template_control.run.simulation import STEPS
from template_control.storage import writing

_PLANTS = {options.kind: options for options in (PlantOptions, MujocoOptions, IdealOptions)}
_DEFAULT = SimulationOptions().for_robot(free=False)
_AROUND = Range(-360.0, 360.0)  # [deg]
_LONG = 200  # steps beyond which samples are thinned


def add_world_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--plant`` and what it and the motors are like."""
    parser.add_argument(
        "--plant",
        choices=tuple(_PLANTS),
        help="pybullet if not given; mujoco: the other physics engine, if it is installed; ideal:"
        " rigid contacts that stick, no friction; --friction is then the controller's cone only",
    )
    parser.add_argument(
        "--friction",
        type=number(Range(0.05, 5.0)),
        help="Coulomb friction between feet and ground, 0.7 if not given",
    )
    parser.add_argument(
        "--terrain",
        metavar="SPEC",
        help="the ground, which the controller is not told of: step:height=0.03,x=2.5,"
        " stairs:rise=0.02,run=0.6,count=5, slope:angle=4 (degrees), random:height=0.02,seed=3,"
        " flat, or a file: a .toml with points, or x and height in two columns [m]",
    )
    parser.add_argument(
        "--mass-scale",
        type=number(Range(0.5, 2.0)),
        metavar="FACTOR",
        help="masses of the simulated robot over those the controller knows",
    )
    parser.add_argument(
        "--torque-scale",
        type=number(Range(0.01, 10.0)),
        metavar="SHARE",
        help="share of the URDF's torque limits to use",
    )


def add_disturbance_options(parser: argparse.ArgumentParser) -> None:
    """Add pushes, noise, wrong contact flags, ``--estimate``, ``--delay`` and ``--seed``."""
    parser.add_argument(
        "--push",
        action="append",
        metavar="IMPULSE@STEP[:PHASE[:DIRECTION]]",
        help="push the trunk with IMPULSE N s, forward positive, over 0.1 s, in step STEP (0 is the"
        " first), PHASE of a step's duration after its VLO; a free robot DIRECTION degrees to the"
        " left of forward; may be given several times",
    )
    parser.add_argument(
        "--noise",
        type=number(Range(0.0, 1.0)),
        metavar="RAD",
        help="standard deviation of the noise on measured angles; on positions it is this times"
        " l0, on velocities 20 times as many per second",
    )
    parser.add_argument(
        "--contact-errors",
        type=number(Range(0.0, 1.0)),
        metavar="SHARE",
        help="share of the contact flags of the feet that are wrong, drawn at every tick",
    )
    parser.add_argument(
        "--estimate",
        action="store_true",
        help="the controller does not get the state, but what encoders (0.2 mrad), an IMU (5 mrad/s"
        " and 0.1 m/s^2) and the contacts of the feet make of it",
    )
    parser.add_argument(
        "--delay",
        type=number(Range(0.0, 1.0)),
        metavar="S",
        help="from a measurement to the torques computed from it, a multiple of 0.001 s",
    )
    parser.add_argument(
        "--seed",
        type=whole(SEED),
        help="perturb the initial state by up to 5 %% in speed and 2 %% of l0 in height, drawn"
        " with this seed; without it the walk starts on the gait",
    )


def add_course_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--turn`` and ``--step-width``, which go with ``--floating-base``."""
    parser.add_argument(
        "--turn",
        action="append",
        metavar="RATE[@TIME]",
        help="turning rate of a free robot's heading in rad/s, to the left positive; with a time in"
        " s, from then on. May be given several times",
    )
    parser.add_argument(
        "--step-width",
        type=number(Range(0.0, 10.0, above=True)),
        metavar="M",
        help="distance aside between a free robot's left and right footholds; 0.22 l0 if not given",
    )


def add_catch_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--no-catch``."""
    parser.add_argument(
        "--no-catch",
        dest="catches",
        action="store_const",
        const=False,
        help="let a walk that is pushed too hard fall; without this it breaks into a run where it"
        " is too fast, and is carried on, stops or steps back where it is too slow",
    )


def add_length_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--steps`` and ``--record-every``."""
    parser.add_argument(
        "--steps",
        type=whole(MANY),
        help=f"steps to walk, VLO to VLO; {STEPS} where no scenario says when to stop",
    )
    parser.add_argument(
        "--record-every",
        type=whole(MANY),
        metavar="N",
        help=f"keep every n-th sample in run.npz; by default 1 up to {_LONG} steps, then 5",
    )


def simulation_choice(
    options: argparse.Namespace, base: SimulationOptions, ends: bool
) -> SimulationOptions:
    """How the run is to go, but for noise and seed, which need its gait.

    Args:
        options: as parsed.
        base: what holds where an option was not given.
        ends: whether a scenario ends the run.

    Raises:
        ParameterError: if a number is out of its range.
    """
    given: dict[str, Any] = {"plant": _plant(options, base)}
    embedding = {n: getattr(options, n, None) for n in ("friction", "torque_scale", "catches")}
    tuning = base.tuning(free=False)
    if getattr(options, "free", None) and not isinstance(tuning, FreeOptions):
        tuning = FreeOptions()  # the file's is that of the robot held in its plane
    given["embedding"] = replace(tuning, **_without_none(embedding))
    given["course"] = _course(options, base.course)
    if options.push is not None:
        given["pushes"] = tuple(map(_push, options.push))
    given["delay"] = options.delay
    given["steps"] = options.steps or base.steps or (None if ends else STEPS)
    thinned = base.for_robot(free=False) == _DEFAULT and (given["steps"] or 0) > _LONG
    given["record_every"] = options.record_every or (5 if thinned else None)
    return replace(base, **_without_none(given))


def _plant(options: argparse.Namespace, base: SimulationOptions) -> PlantOptions | IdealOptions:
    plant = base.plant
    assert isinstance(plant, PlantOptions | IdealOptions)  # a file holds no other plant
    if options.plant not in (None, plant.kind):
        made = _PLANTS[options.plant]
        shared = {f.name for f in fields(made)} & {f.name for f in fields(plant)}
        plant = made(**{name: getattr(plant, name) for name in shared})
    given: dict[str, Any] = {"mass_scale": options.mass_scale}
    if options.terrain is not None:
        given["terrain"] = terrain_from(options.terrain)
    if isinstance(plant, PlantOptions):
        given["friction"] = options.friction
        if options.terrain is not None:
            plant = replace(plant, ground_step=None)  # the file's, which this one replaces
    return replace(plant, **_without_none(given))


def _course(options: argparse.Namespace, base: HeadingCommand) -> HeadingCommand:
    wanted: dict[str, Any] = {"step_width": getattr(options, "step_width", None)}
    turns = [_turn(text) for text in getattr(options, "turn", None) or ()]
    if turns:
        times = [time for time, _ in turns]
        twice = next((time for time in times if times.count(time) > 1), None)
        if twice is not None:
            raise ParameterError(f"--turn has two rates from {twice:g} s on: give one")
        first, *later = sorted({0.0: 0.0, **dict(turns)}.items())
        wanted["turning_rate"], wanted["turns"] = first[1], tuple(later)
    return replace(base, **_without_none(wanted))


def _turn(text: str) -> tuple[float, float]:
    """Time from which a rate holds, and the rate."""
    rate, at, time = text.partition("@")
    where = f"--turn {text}"
    if not (rate and (time or not at)):
        raise ParameterError(f"{where}: give RATE or RATE@TIME, such as -0.2@10")
    return typed.number(f"{where}: time", time or "0", NotNegative), typed.number(
        f"{where}: rate", rate, TurningRate
    )


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _push(text: str) -> Push:
    impulse, _, when = text.partition("@")
    step, _, rest = when.partition(":")
    phase, _, degrees = rest.partition(":")
    where = f"--push {text}"
    if not (impulse and step):
        raise ParameterError(
            f"{where}: give IMPULSE@STEP or IMPULSE@STEP:PHASE, such as 10@4:0.5; or of a"
            " free robot IMPULSE@STEP:PHASE:DIRECTION, such as 10@4:0.5:90"
        )
    direction = typed.number(f"{where}: direction", degrees or "0", Annotated[float, _AROUND])
    return Push(
        typed.number(f"{where}: impulse", impulse, float),
        typed.number(f"{where}: step", step, Index),
        typed.number(f"{where}: phase", phase or "0", Phase),
        direction=math.radians(direction),
    )


def add_output_options(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add ``--output``, ``--json`` and ``--no-figures``.

    Args:
        parser: of the command.
        folder: where runs go if nothing else is said.
    """
    parser.add_argument(
        "--output",
        type=values.path,
        default=Path(folder),
        help=f"folder for run.npz, run.toml and figures, {folder} if not given; a run that is"
        " there is replaced, and the command says so",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the table as JSON, and nothing else, on stdout"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw figures")


@contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """Keep a folder for a run; says on stderr if a run in it will be replaced.

    Args:
        folder: as asked for.

    Yields:
        The folder; see :func:`~template_control.storage.writing`.

    Raises:
        RecordError: if nothing can be written there, or another command writes there now.
    """
    with writing(folder):
        if (folder / "run.npz").exists():
            print(
                f"template-control: the run in {folder} will be replaced; --output keeps both",
                file=sys.stderr,
            )
        yield folder
