"""Short flags of the command line: names for keys of an experiment's file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

from template_control.checks import option_types as values
from template_control.checks import typed
from template_control.checks.option_types import MANY, SEED, SPEED, number, whole
from template_control.checks.ranges import Index, NotNegative, Positive, Range
from template_control.embedding.planners.ahead import AheadOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.planners.modified import ModifiedOptions
from template_control.embedding.planners.running import RunningOptions
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.plant.plant import default_plant
from template_control.plant.terrain import terrain_from
from template_control.robot.library import FLOATING_ROBOTS, SHIPPED
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import STEPS
from template_control.run.options import Phase, Push, TurningRate
from template_control.slip.scenario.scenario import load_scenario

_DEFAULT = RobotSpec().model
_PLANTS = tuple(options.kind for options in (PlantOptions, MujocoOptions, IdealOptions))
PLANNERS: dict[str, Any] = {
    options.kind: options for options in (LqrOptions, AheadOptions, ModifiedOptions, RunningOptions)
}
"""Options of planners by name."""

_MAPS = ("paper", "improved", "exact")
_TURN = Range(-6.3, 6.3)  # [rad] about once around: degrees are not taken for it
_AROUND = Range(-360.0, 360.0)  # [deg]


class Flag(NamedTuple):
    """A short name for keys of an experiment.

    ``names`` are of the option, ``keys`` dotted; the value is set at each. ``argument`` is what
    ``add_argument`` needs to know, ``read`` makes the keys' value of the typed one.
    """

    names: str
    keys: str
    about: str
    argument: Mapping[str, Any] = MappingProxyType({})
    read: Callable[[Any], Any] | None = None

    @property
    def dest(self) -> str:
        """Name in a namespace."""
        return self.names.split()[0].lstrip("-").replace("-", "_")

    def add(self, parser: Any) -> None:
        """Add the option to a parser or a group of it."""
        parser.add_argument(*self.names.split(), dest=self.dest, help=self.about, **self.argument)


_ON = {"action": "store_const", "const": True}
_OFF = {"action": "store_const", "const": False}
_MANY = {"action": "append"}


def _model(robot: str) -> RobotSpec:
    """A path is made absolute, so that what is written down does not depend on the folder."""
    own = robot not in SHIPPED and ("/" in robot or robot.endswith(".urdf"))
    return RobotSpec(str(Path(robot).absolute()) if own else robot)


_masses = partial(typed.numbers, form="LINK=MASS with the mass in kg", hint=Positive)

ROBOT = (
    Flag(
        "--robot",
        "robot",
        f"a shipped robot ({', '.join(SHIPPED)}) or the path of a planar URDF; {_DEFAULT} if not"
        " given",
        {"metavar": "NAME|URDF"},
        _model,
    ),
    Flag(
        "--floating-base --free",
        "robot.free",
        f"nothing holds the robot: it walks in space, as {', '.join(FLOATING_ROBOTS)} can, and 3D"
        " URDFs of two or four legs with hip ab- and adduction",
        _ON,
    ),
)
MASSES = (
    Flag(
        "--gravity",
        "robot.gravity",
        "of the robot's model, its template and, if nothing else is said, the world; 9.81 m/s^2",
        {"type": number(Range(0.1, 100.0)), "metavar": "M/S^2"},
    ),
    Flag(
        "--mass",
        "robot.masses",
        "masses of links instead of the URDF's, known to the controller",
        {"nargs": "+", "metavar": "LINK=KG"},
        partial(_masses, "--mass"),
    ),
    Flag(
        "--plant-gravity",
        "world.gravity",
        "of the world, unknown to the controller",
        {"type": number(Range(0.1, 100.0)), "metavar": "M/S^2"},
    ),
    Flag(
        "--plant-robot",
        "world.robot",
        "another robot to simulate than the controller's, with the same joints and feet",
        {"metavar": "NAME|URDF"},
        _model,
    ),
    Flag(
        "--plant-mass",
        "world.robot.masses",
        "masses of links of the simulated robot, such as a payload's, unknown to the controller",
        {"nargs": "+", "metavar": "LINK=KG"},
        partial(_masses, "--plant-mass"),
    ),
)
OWN_URDF = (
    Flag(
        "--feet",
        "robot.feet",
        "its foot links, left and right, or four; left_foot and right_foot if not given",
        {"nargs": "+", "metavar": "LINK"},
    ),
    Flag(
        "--sagittal-joints",
        "robot.sagittal_joints",
        "of a 3D URDF: hips and knees; the other joints are locked, the base is held in the"
        " sagittal plane",
        {"nargs": 4, "metavar": "JOINT"},
    ),
    Flag(
        "--locked",
        "robot.locked",
        "of a 3D URDF: angles of locked joints; in its plane a robot's other joints are locked at"
        " 0",
        {"nargs": "+", "metavar": "JOINT=RAD"},
        lambda texts: typed.numbers(
            "--locked", texts, "JOINT=ANGLE with the angle in rad", Annotated[float, _TURN]
        ),
    ),
    Flag(
        "--foot-radius",
        "robot.foot_radius",
        "of a 3D URDF: radius of the spheres put into its feet",
        {"type": number(Range(0.0, 1.0, above=True)), "metavar": "M"},
    ),
    Flag(
        "--foot-offset",
        "robot.foot_offset",
        "of these spheres' centres from the foot links' origins, in the links' axes [m]",
        {"type": number(Range(-1.0, 1.0)), "nargs": 3, "metavar": ("X", "Y", "Z")},
    ),
    Flag(
        "--flat-feet",
        "robot.flat_feet",
        "of a floating-base biped: it stands on soles, which its feet's collision shapes have;"
        " joints that are in no leg are locked",
        _ON,
    ),
    Flag(
        "--upper-body",
        "robot.upper_body",
        "of a robot on flat feet: joints that are in no leg move, about where they would be locked",
        _ON,
    ),
    Flag(
        "--lossless",
        "robot.lossless",
        "leave out the damping and friction of the URDF's joints",
        _ON,
    ),
)
SCENARIO = Flag(
    "--scenario",
    "motion",
    "a speed profile instead of one gait, as template-control slip takes it; it ends with the"
    " profile, or after --steps",
    {"type": values.path, "metavar": "TOML"},
    load_scenario,
)
GAIT = (
    Flag(
        "--gait",
        "motion.name",
        "walk: the robot's own, for most touchdown angle 66 deg and 1.1 m/s at VLO; paper: the"
        " equilibrium of Section IV-D, 0.9818 m and 826 J, given for l0 = 1 m and 80 kg and scaled"
        " to the robot; run",
        {"choices": ("walk", "paper", "run")},
    ),
    Flag(
        "--speed",
        "motion.speed",
        "of a walk the mean forward speed, instead of its own; of a run dx/dt at apex, 3 m/s for"
        " l0 = 1 m if not given",
        {"type": number(SPEED), "metavar": "M/S"},
    ),
    Flag(
        "--touchdown-angle",
        "motion.touchdown_angle",
        "of a walk instead of its own, from the ground to the leg",
        {"type": number(Range(1.0, 89.0)), "metavar": "DEG"},
    ),
    Flag(
        "--apex",
        "motion.apex_height",
        "of a run, height of the apex; one that suits the speed if not given",
        {"type": number(Range(0.01, 10.0)), "metavar": "M"},
    ),
)
STANDS = (
    Flag("--from-stand", "motion.from_stand", "stand for 2 s, and start to walk from there", _ON),
    Flag(
        "--to-stand",
        "motion.to_stand",
        "stop after the steps, and stand for 2 s; steps of start and stop come on top",
        _ON,
    ),
)
PLANNER = (
    Flag(
        "--planner",
        "planner",
        "lqr: LQR on the VLO state with an offset estimate; ahead: plans several steps at once,"
        " towards any speed; modified: the paper's modified walking controller, equation (38);"
        " deadbeat, for a run; or a class of your own, called with the gait. If not given:"
        " ahead where a scenario walks only, deadbeat for a run, else lqr",
        {"metavar": "NAME|MODULE:CLASS"},
    ),
    Flag(
        "--map",
        "planner.map_kind",
        "return map that the modified planner tries its steps on; exact if not given",
        {"choices": _MAPS},
    ),
    Flag(
        "--strict",
        "strict",
        "refuse a scenario whose walk wants a speed or a change of speed that cannot be had;"
        " without this the nearest is taken, and the table says so",
        _ON,
    ),
    Flag(
        "--no-catch",
        "controller.catches",
        "let a walk that is pushed too hard fall; without this it breaks into a run where it is too"
        " fast, and is carried on, stops or steps back where it is too slow",
        _OFF,
    ),
)
WORLD = (
    Flag(
        "--plant",
        "world.kind",
        f"{default_plant().kind} if not given; pybullet and mujoco: physics engines; ideal: rigid"
        " contacts that stick, no friction; --friction is then the controller's cone only",
        {"choices": _PLANTS},
    ),
    Flag(
        "--friction",
        "controller.friction world.friction",
        "Coulomb friction between feet and ground, 0.7 if not given",
        {"type": number(Range(0.05, 5.0))},
    ),
    Flag(
        "--terrain",
        "world.terrain",
        "the ground, which the controller does not know: step:height=0.03,x=2.5,"
        " stairs:rise=0.02,run=0.6,count=5, slope:angle=4 (degrees), random:height=0.02,seed=3,"
        " flat, or a file: a .toml with points, or x and height in two columns [m]",
        {"metavar": "SPEC"},
        terrain_from,
    ),
    Flag(
        "--mass-scale",
        "world.mass_scale",
        "masses of the simulated robot over those the controller knows",
        {"type": number(Range(0.5, 2.0)), "metavar": "FACTOR"},
    ),
    Flag(
        "--torque-scale",
        "controller.torque_scale",
        "share of the URDF's torque limits to use",
        {"type": number(Range(0.01, 10.0)), "metavar": "SHARE"},
    ),
)


def _push(text: str) -> Push:
    impulse, _, when = text.partition("@")
    step, _, rest = when.partition(":")
    phase, _, degrees = rest.partition(":")
    where = f"--push {text}"
    if not (impulse and step):
        raise ParameterError(
            f"{where}: give IMPULSE@STEP or IMPULSE@STEP:PHASE, such as 10@4:0.5; or of a"
            " floating-base robot IMPULSE@STEP:PHASE:DIRECTION, such as 10@4:0.5:90"
        )
    direction = typed.number(f"{where}: direction", degrees or "0", Annotated[float, _AROUND])
    return Push(
        typed.number(f"{where}: impulse", impulse, float),
        typed.number(f"{where}: step", step, Index),
        typed.number(f"{where}: phase", phase or "0", Phase),
        direction=math.radians(direction),
    )


def _turns(texts: list[str]) -> list[list[float]]:
    turns = [_turn(text) for text in texts]
    times = [time for time, _ in turns]
    twice = next((time for time in times if times.count(time) > 1), None)
    if twice is not None:
        raise ParameterError(f"--turn has two rates from {twice:g} s on: give one")
    return [list(turn) for turn in sorted({0.0: 0.0, **dict(turns)}.items())]


def _turn(text: str) -> tuple[float, float]:
    """Time from which a rate holds, and the rate."""
    rate, at, time = text.partition("@")
    where = f"--turn {text}"
    if not (rate and (time or not at)):
        raise ParameterError(f"{where}: give RATE or RATE@TIME, such as -0.2@10")
    return typed.number(f"{where}: time", time or "0", NotNegative), typed.number(
        f"{where}: rate", rate, TurningRate
    )


DISTURBANCES = (
    Flag(
        "--push",
        "pushes",
        "push the trunk with IMPULSE N s, forward positive, over 0.1 s, in step STEP (0 is the"
        " first), PHASE of a step's duration after its VLO; a floating-base robot DIRECTION degrees"
        " to the left of forward; may be given several times",
        {**_MANY, "metavar": "IMPULSE@STEP[:PHASE[:DIRECTION]]"},
        lambda texts: tuple(map(_push, texts)),
    ),
    Flag(
        "--noise",
        "sensors.noise",
        "standard deviation of the noise on measured angles; on positions it is this times l0, on"
        " velocities 20 times as many per second",
        {"type": number(Range(0.0, 1.0)), "metavar": "RAD"},
    ),
    Flag(
        "--contact-errors",
        "sensors.contact_errors",
        "share of the contact flags of the feet that are wrong, drawn at every tick",
        {"type": number(Range(0.0, 1.0)), "metavar": "SHARE"},
    ),
    Flag(
        "--estimate",
        "sensors.kind",
        "the controller does not get the state, but what encoders (0.2 mrad), an IMU (5 mrad/s and"
        " 0.1 m/s^2) and the contacts of the feet make of it",
        {"action": "store_const", "const": "imu"},
    ),
    Flag(
        "--delay",
        "delay",
        "from a measurement to the torques computed from it, a multiple of 0.001 s",
        {"type": number(Range(0.0, 1.0)), "metavar": "S"},
    ),
    Flag(
        "--seed",
        "seed",
        "perturb the initial state by up to 5 %% in speed and 2 %% of l0 in height, drawn with this"
        " seed; without it the run starts on the gait",
        {"type": whole(SEED)},
    ),
)
COURSE = (
    Flag(
        "--turn",
        "course.turns",
        "turning rate of a floating-base robot's heading in rad/s, to the left positive; with a"
        " time in s, from then on. May be given several times",
        {**_MANY, "metavar": "RATE[@TIME]"},
        _turns,
    ),
    Flag(
        "--side-speed",
        "course.side_speed",
        "speed of a floating-base robot to the left",
        {"type": number(Range(-5.0, 5.0)), "metavar": "M/S"},
    ),
    Flag(
        "--step-width",
        "course.step_width",
        "lateral distance between a floating-base robot's left and right footholds; 0.22 l0 if not"
        " given",
        {"type": number(Range(0.0, 10.0, above=True)), "metavar": "M"},
    ),
)
LENGTH = (
    Flag(
        "--steps",
        "steps",
        f"steps to make, section to section; {STEPS} where no scenario says when to stop",
        {"type": whole(MANY)},
    ),
    Flag(
        "--record-every",
        "record_every",
        "keep every n-th sample in run.npz; by default 1 up to 200 steps, then 5",
        {"type": whole(MANY), "metavar": "N"},
    ),
)
SUBJECT = (*ROBOT, *MASSES, *OWN_URDF, SCENARIO, *GAIT, *PLANNER, *WORLD)
"""Flags of an undisturbed experiment."""

ALL = (*SUBJECT, *STANDS, *DISTURBANCES, *COURSE, *LENGTH)  # flags of a run
