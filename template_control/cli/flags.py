"""Short flags of the command line: names for keys of an experiment's file."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

from template_control import settings
from template_control.checks import option_types as values
from template_control.checks import typed
from template_control.checks.option_types import MANY, SEED, SPEED, number, whole
from template_control.checks.ranges import Index, NotNegative, Positive, Range
from template_control.errors import ParameterError
from template_control.plant.plant import default_plant
from template_control.plant.terrain import terrain_from
from template_control.robot.library import FLOATING_ROBOTS, SHIPPED
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.run.options import Phase, Push, TurningRate
from template_control.slip.scenario.scenario import load_scenario

LEAVES = {leaf.path: leaf for leaf in settings.leaves(Experiment)}
"""Keys of an experiment's file, by their dotted names."""

_UNIT = re.compile(r" ?\[([^],]+)\]")
_UNSET = re.compile(r"[;.] None: ")


class _Help:
    """Help of the flags that say more than their keys do.

    Attributes:
        gravity: of the robot's model, its template and, if nothing else is said, the world; 9.81
            m/s^2.
        mass: masses of links instead of the URDF's, known to the controller.
        plant_gravity: of the world, unknown to the controller.
        plant_robot: another robot to simulate than the controller's, with the same joints and feet.
        plant_mass: masses of links of the simulated robot, such as a payload's, unknown to the
            controller.
        sagittal_joints: of a 3D URDF: hips and knees; the other joints are locked, the base is held
            in the sagittal plane.
        foot_offset: of these spheres' centres from the foot links' origins, in the links' axes [m].
        upper_body: of a robot on flat feet: joints that are in no leg move, about where they would
            be locked.
        scenario: a speed profile instead of one gait, as template-control slip takes it; it ends
            with the profile, or after --steps.
        gait: walk: the robot's own, for most touchdown angle 66 deg and 1.1 m/s at VLO; paper: the
            equilibrium of Section IV-D, 0.9818 m and 826 J, given for l0 = 1 m and 80 kg and scaled
            to the robot; run.
        to_stand: stop after the steps, and stand for 2 s; steps of start and stop come on top.
        planner: lqr: LQR on the VLO state with an offset estimate; ahead: plans several steps at
            once, towards any speed; modified: the paper's modified walking controller, equation
            (38); deadbeat, for a run; or a class of your own, called with the gait. If not given:
            ahead where a scenario walks only, deadbeat for a run, else lqr.
        map: return map that the modified planner tries its steps on; exact if not given.
        no_catch: let a walk that is pushed too hard fall; without this it breaks into a run where
            it is too fast, and is carried on, stops or steps back where it is too slow.
        friction: Coulomb friction between feet and ground, 0.7 if not given.
        terrain: the ground, which the controller does not know: step:height=0.03,x=2.5,
            stairs:rise=0.02,run=0.6,count=5, slope:angle=4 (degrees), random:height=0.02,seed=3,
            flat, or a file: a .toml with points, or x and height in two columns [m].
        push: push the trunk with IMPULSE N s, forward positive, over 0.1 s, in step STEP (0 is the
            first), PHASE of a step's duration after its VLO; a floating-base robot DIRECTION
            degrees to the left of forward; may be given several times.
        noise: standard deviation of the noise on measured angles; on positions it is this times l0,
            on velocities 20 times as many per second.
        contact_errors: share of the contact flags of the feet that are wrong, drawn at every tick.
        estimate: the controller does not get the state, but what encoders (0.2 mrad), an IMU
            (5 mrad/s and 0.1 m/s^2) and the contacts of the feet make of it.
        seed: perturb the initial state by up to 5 % in speed and 2 % of l0 in height, drawn with
            this seed; without it the run starts on the gait.
        turn: turning rate of a floating-base robot's heading in rad/s, to the left positive; with a
            time in s, from then on. May be given several times.
        step_width: lateral distance between a floating-base robot's left and right footholds; 0.22
            l0 if not given.
        record_every: keep every n-th sample in run.npz; by default 1 up to 200 steps, then 5.
    """


_HELP = settings.described(_Help)


class Flag(NamedTuple):
    """A short name for keys of an experiment.

    ``names`` are of the option, ``keys`` dotted; the value is set at each. ``type`` reads a typed
    value, in a range that may be narrower than the key's; ``argument`` is given to ``add_argument``
    instead of what the key says; ``read`` makes the keys' value of the typed ones. Without
    ``about`` the help is :class:`_Help`'s, or what the docstring says of the first key, where a
    None is an option that is not given.
    """

    names: str
    keys: str
    type: Callable[[str], Any] | None = None
    argument: Mapping[str, Any] = MappingProxyType({})
    read: Callable[[Any], Any] | None = None
    about: str = ""

    @property
    def dest(self) -> str:
        """Name in a namespace."""
        return self.names.split()[0].lstrip("-").replace("-", "_")

    def add(self, parser: Any) -> None:
        """Add the option to a parser or a group of it."""
        key = self.keys.split()[0]
        how = dict(self.argument) or _usual(LEAVES[key])
        if self.type is not None:
            how = {"metavar": "N", **how, "type": self.type}
        about = self.about or _HELP.get(self.dest) or _UNIT.sub("", LEAVES[key].about, count=1)
        how["help"] = _UNSET.sub("; if not given, ", about).rstrip(".").replace("%", "%%")
        parser.add_argument(*self.names.split(), dest=self.dest, **how)


def _usual(leaf: settings.Leaf) -> dict[str, Any]:
    """What the key says of its option: that it has no value; or which; or in which unit."""
    if leaf.hint is bool:
        return {"action": "store_const", "const": not leaf.default}
    if get_origin(leaf.hint) is Literal:
        return {"choices": get_args(leaf.hint)}
    unit = _UNIT.search(leaf.about)
    return {"metavar": unit[1].upper()} if unit else {}


def _model(robot: str) -> RobotSpec:
    """A path is made absolute, so that what is written down does not depend on the folder."""
    own = robot not in SHIPPED and ("/" in robot or robot.endswith(".urdf"))
    return RobotSpec(str(Path(robot).absolute()) if own else robot)


_URDF = {"metavar": "NAME|URDF"}
_MASSES = {"nargs": "+", "metavar": "LINK=KG"}
_masses = partial(typed.numbers, form="LINK=MASS with the mass in kg", hint=Positive)

ROBOT = (
    Flag(
        "--robot",
        "robot",
        argument=_URDF,
        read=_model,
        about=f"a shipped robot ({', '.join(SHIPPED)}) or the path of a planar URDF;"
        f" {RobotSpec().model} if not given",
    ),
    Flag(
        "--floating-base --free",
        "robot.free",
        about=f"nothing holds the robot: it walks in space, as {', '.join(FLOATING_ROBOTS)} can,"
        " and 3D URDFs of two or four legs with hip ab- and adduction",
    ),
)
MASSES = (
    Flag("--gravity", "robot.gravity", number(Range(0.1, 100.0))),
    Flag("--mass", "robot.masses", argument=_MASSES, read=partial(_masses, "--mass")),
    Flag("--plant-gravity", "world.gravity", number(Range(0.1, 100.0))),
    Flag("--plant-robot", "world.robot", argument=_URDF, read=_model),
    Flag(
        "--plant-mass",
        "world.robot.masses",
        argument=_MASSES,
        read=partial(_masses, "--plant-mass"),
    ),
)
OWN_URDF = (
    Flag("--feet", "robot.feet", argument={"nargs": "+", "metavar": "LINK"}),
    Flag("--sagittal-joints", "robot.sagittal_joints", argument={"nargs": 4, "metavar": "JOINT"}),
    Flag(
        "--locked",
        "robot.locked",
        argument={"nargs": "+", "metavar": "JOINT=RAD"},
        read=lambda texts: typed.numbers(
            "--locked",
            texts,
            "JOINT=ANGLE with the angle in rad",
            Annotated[float, Range(-6.3, 6.3)],  # about once around: degrees are not taken for it
        ),
    ),
    Flag("--foot-radius", "robot.foot_radius", number(Range(0.0, 1.0, above=True))),
    Flag(
        "--foot-offset",
        "robot.foot_offset",
        number(Range(-1.0, 1.0)),
        {"nargs": 3, "metavar": ("X", "Y", "Z")},
    ),
    Flag("--flat-feet", "robot.flat_feet"),
    Flag("--upper-body", "robot.upper_body"),
    Flag("--lossless", "robot.lossless"),
)
SCENARIO = Flag("--scenario", "motion", values.path, {"metavar": "TOML"}, load_scenario)
GAIT = (
    Flag("--gait", "motion.name"),
    Flag("--speed", "motion.speed", number(SPEED)),
    Flag("--touchdown-angle", "motion.touchdown_angle", number(Range(1.0, 89.0))),
    Flag("--apex", "motion.apex_height", number(Range(0.01, 10.0))),
)
STANDS = (Flag("--from-stand", "motion.from_stand"), Flag("--to-stand", "motion.to_stand"))
PLANNER = (
    Flag("--planner", "planner", argument={"metavar": "NAME|MODULE:CLASS"}),
    Flag("--map", "planner.map_kind", argument={"choices": ("paper", "improved", "exact")}),
    Flag("--strict", "strict"),
    Flag("--no-catch", "controller.catches"),
)
WORLD = (
    Flag(
        "--plant",
        "world.kind",
        about=f"{default_plant().kind} if not given; pybullet and mujoco: physics engines; ideal:"
        " rigid contacts that stick, no friction; --friction is then the controller's cone only",
    ),
    Flag("--friction", "controller.qp.friction world.friction", number(Range(0.05, 5.0))),
    Flag("--terrain", "world.terrain", argument={"metavar": "SPEC"}, read=terrain_from),
    Flag("--mass-scale", "world.mass_scale", number(Range(0.5, 2.0))),
    Flag("--torque-scale", "controller.qp.torque_scale", number(Range(0.01, 10.0))),
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
    direction = typed.number(
        f"{where}: direction", degrees or "0", Annotated[float, Range(-360.0, 360.0)]
    )
    return Push(
        typed.number(f"{where}: impulse", impulse, float),
        typed.number(f"{where}: step", step, Index),
        typed.number(f"{where}: phase", phase or "0", Phase),
        direction=math.radians(direction),
    )


def _turns(texts: list[str]) -> list[list[float]]:
    """Times from which rates hold, each with its rate; straight on at first."""
    turns: dict[float, float] = {}
    for text in texts:
        rate, at, time = text.partition("@")
        where = f"--turn {text}"
        if not (rate and (time or not at)):
            raise ParameterError(f"{where}: give RATE or RATE@TIME, such as -0.2@10")
        begin = typed.number(f"{where}: time", time or "0", NotNegative)
        if begin in turns:
            raise ParameterError(f"--turn has two rates from {begin:g} s on: give one")
        turns[begin] = typed.number(f"{where}: rate", rate, TurningRate)
    return [list(turn) for turn in sorted({0.0: 0.0, **turns}.items())]


PERTURBED = Flag("--seed", "seed", whole(SEED))
DISTURBANCES = (
    Flag(
        "--push",
        "pushes",
        argument={"action": "append", "metavar": "IMPULSE@STEP[:PHASE[:DIRECTION]]"},
        read=lambda texts: tuple(map(_push, texts)),
    ),
    Flag("--noise", "sensors.noise", number(Range(0.0, 1.0))),
    Flag("--contact-errors", "sensors.contact_errors", number(Range(0.0, 1.0))),
    Flag("--estimate", "sensors.kind", argument={"action": "store_const", "const": "imu"}),
    Flag("--delay", "delay", number(Range(0.0, 1.0))),
    PERTURBED,
)
COURSE = (
    Flag(
        "--turn",
        "course.turns",
        argument={"action": "append", "metavar": "RATE[@TIME]"},
        read=_turns,
    ),
    Flag("--side-speed", "course.side_speed", number(Range(-5.0, 5.0))),
    Flag("--step-width", "course.step_width", number(Range(0.0, 10.0, above=True))),
)
LENGTH = (
    Flag("--steps", "steps", whole(MANY)),
    Flag("--record-every", "record_every", whole(MANY)),
)
SUBJECT = (*ROBOT, *MASSES, *OWN_URDF, SCENARIO, *GAIT, *PLANNER, *WORLD)
"""Flags of an undisturbed experiment."""

ALL = (*SUBJECT, *STANDS, *DISTURBANCES, *COURSE, *LENGTH)  # flags of a run
