"""A whole run as data: robot, gait, planner and options, to be written down and done again.

``walk`` writes one beside every run, ``run.toml``; ``walk --config run.toml`` repeats the run.
"""

from __future__ import annotations

import importlib
import inspect
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from template_control import settings, storage
from template_control.checks.checked import Checked, checked
from template_control.embedding.ahead.options import AheadOptions
from template_control.embedding.ahead.planner import AheadPlanner
from template_control.embedding.free.options import FREE_PLANNER
from template_control.embedding.planners.default import default_planners, first_speed
from template_control.embedding.planners.lqr import LqrOptions, LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.planners.running import RunningOptions, RunningPlanner
from template_control.embedding.planners.walk_kernels import WALK
from template_control.embedding.robot_route import robot_route
from template_control.embedding.robot_template import (
    check_apex,
    default_gait,
    paper_gait,
    robot_gait_for_speed,
    template_for,
)
from template_control.errors import ParameterError
from template_control.parts import ready
from template_control.robot.biped import Biped
from template_control.robot.free.free_biped import FreeBiped
from template_control.robot.library import ROBOTS, load_free_robot, load_robot
from template_control.robot.planar_biped import PlanarBiped
from template_control.run.options import Course, SimulationOptions
from template_control.run.record import Record
from template_control.run.simulation import STEPS, simulate
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.gaits.mean_speed import gait_for_speed
from template_control.slip.gaits.running_gait import RunningGait, running_gait
from template_control.slip.gaits.walking_family import walking_gait
from template_control.slip.scenario.route import ScenarioRoute
from template_control.slip.scenario.scenario import STAND_HEIGHT, Scenario, Segment
from template_control.slip.similarity import REFERENCE


@dataclass(frozen=True)
class RobotChoice(Checked):
    """Which robot; what a URDF of one's own may need is as in :meth:`PlanarBiped.from_urdf`.

    Attributes:
        model: a shipped robot, or the path of a URDF.
        feet: its foot links; None: left_foot and right_foot.
        sagittal_joints: of a 3D URDF, hips and knees.
        foot_radius: of the spheres put into the feet of a 3D URDF [m].
        locked: angle of each locked joint of a 3D URDF that is not at 0 [rad].
        free: whether nothing holds the robot; its URDF is a 3D one, and all its joints move.
    """

    model: str = "five-link"
    feet: tuple[str, str] | None = None
    sagittal_joints: tuple[str, ...] = ()
    foot_radius: float | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    free: bool = False

    def load(self) -> Biped:
        """The robot.

        Raises:
            RobotError: if there is none, or it is no such biped.
            ParameterError: if a shipped robot comes with what only a URDF needs.
        """
        own = {
            "feet": self.feet,
            "sagittal_joints": self.sagittal_joints,
            "foot_radius": self.foot_radius,
            "locked": self.locked,
        }
        given = {name: value for name, value in own.items() if value not in (None, (), {})}
        if not given:
            return load_free_robot(self.model) if self.free else load_robot(self.model)
        if self.model in ROBOTS:
            names = ", ".join(name.replace("_", " ") for name in given)
            raise ParameterError(f"{names} go with a URDF, not with {self.model}: leave them out")
        if self.free:
            idle = [
                name.replace("_", " ") for name in ("sagittal_joints", "locked") if name in given
            ]
            if idle:
                raise ParameterError(f"{', '.join(idle)} hold a robot in its plane: leave them out")
            return FreeBiped.from_urdf(self.model, **given)  # type: ignore[arg-type]
        return PlanarBiped.from_urdf(self.model, **given)  # type: ignore[arg-type]


_GAIT_NUMBERS = {
    "walk": ("speed", "touchdown_angle"),
    "paper": (),
    "run": ("speed", "apex_height"),
}
_RUN = 3.0 / float(np.sqrt(REFERENCE.gravity * REFERENCE.rest_length))


@dataclass(frozen=True)
class GaitChoice(Checked):
    """Which gait of the robot's template.

    Attributes:
        name: "walk", the robot's own; "paper", the equilibrium of Section IV-D; or "run".
        speed: of a walk the mean forward speed, instead of its own; of a run dx/dt at apex
            [m/s]; None: 3 m/s for l0 = 1 m.
        touchdown_angle: of a walk, from the ground to the leg, instead of its own [deg].
        apex_height: of a run [m]; None: one that suits its speed.

    Raises:
        ParameterError: if a gait is given what it does not have.
    """

    name: Literal["walk", "paper", "run"] = "walk"
    speed: float | None = None
    touchdown_angle: float | None = None
    apex_height: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("speed", "touchdown_angle", "apex_height"):
            if getattr(self, name) is not None and name not in _GAIT_NUMBERS[self.name]:
                words = name.replace("_", " ")
                raise ParameterError(f"{words} does not go with gait {self.name}: leave one out")

    def of(self, robot: Biped, torque_scale: float = 1.0) -> WalkingGait | RunningGait:
        """The gait on a robot's template.

        Args:
            robot: its last update is overwritten.
            torque_scale: share of the URDF's torque limits that may be used.

        Raises:
            GaitError: if the template has no such gait, or it is too slow or fast for the robot.
        """
        if self.name == "run":
            return running_gait(template_for(robot), self.run_speed(robot), self.apex_height)
        if self.name == "paper":
            return paper_gait(template_for(robot))
        angle = None if self.touchdown_angle is None else float(np.radians(self.touchdown_angle))
        if self.speed is not None and angle is None:
            return robot_gait_for_speed(robot, self.speed, torque_scale)
        if self.speed is not None:
            return gait_for_speed(template_for(robot), self.speed, touchdown_angle=angle)
        return default_gait(robot, angle)

    def run_speed(self, robot: Biped) -> float:
        """Of a run, dx/dt at apex [m/s].

        Args:
            robot: its last update is overwritten.
        """
        if self.speed is not None:
            return self.speed
        template = template_for(robot)
        return _RUN * float(np.sqrt(template.gravity * template.rest_length))


@dataclass(frozen=True)
class OwnPlanner(Checked):
    """A planner of the user's own.

    Attributes:
        path: "module:Class"; the class is called with the gait. The module is looked for in the
            current folder too.
    """

    kind: ClassVar[str] = "own"

    path: str

    def make(self, gait: WalkingGait | RunningGait) -> Planner:
        """The planner.

        Args:
            gait: that it is to lead to.

        Raises:
            ParameterError: if there is no such class, or what it makes is no planner.
        """
        module, _, name = self.path.partition(":")
        if not (module and name):
            raise ParameterError(f"planner {self.path!r}: give the name of one, or module:Class")
        folder = os.getcwd()
        if folder not in sys.path:
            sys.path.insert(0, folder)
        try:
            chosen = getattr(importlib.import_module(module), name, None)
        except ModuleNotFoundError as error:
            raise ParameterError(
                f"planner {self.path!r}: there is no module {error.name}; it is looked for in"
                " the current folder and among the installed packages"
            ) from None
        except SyntaxError as error:
            raise ParameterError(f"planner {self.path!r} is no Python: {error}") from None
        if not isinstance(chosen, type):
            raise ParameterError(f"planner {self.path!r}: module {module} has no class {name}")
        try:
            inspect.signature(chosen).bind(gait)
        except TypeError as error:
            raise ParameterError(f"planner {self.path!r} must take a gait alone: {error}") from None
        made = chosen(gait)
        if not isinstance(made, Planner):
            lacking = [n for n in _PLANNER_MEMBERS if not hasattr(made, n)]
            raise ParameterError(
                f"planner {self.path!r} lacks {', '.join(lacking)}: docs/your_planner.md tells"
                " what a planner has"
            )
        return made


_STAND = 2.0  # a walk's first and last stand [s]
_PLANNER_MEMBERS = ("gait", "offset", "reset", "decide", "observe")

PlannerChoice = LqrOptions | AheadOptions | ModifiedOptions | RunningOptions | OwnPlanner
"""Which planner, with its tuning."""


class Ready(NamedTuple):
    """What a run is made of, loaded.

    Attributes:
        robot: the model.
        gait: that the robot keeps, or begins with.
        route: the scenario on the robot; None: the gait is kept.
        planners: one for each kind of stride.
    """

    robot: Biped
    gait: WalkingGait | RunningGait
    route: ScenarioRoute | None
    planners: Planners

    def run(
        self, options: SimulationOptions, progress: Callable[[int], None] | None = None
    ) -> Record:
        """Do the run; see :func:`~.simulation.simulate`.

        Args:
            options: how it goes.
            progress: called with the number of completed steps after each.

        Raises:
            TemplateControlError: if the robot cannot start so.
        """
        if self.route is None:
            return simulate(self.robot, self.planners[self.gait.stride], options, progress)
        return simulate(self.robot, self.route, options, progress, self.planners)


@dataclass(frozen=True)
class RunConfig(Checked):
    """All that a run depends on; the same library repeats it to the last bit.

    Attributes:
        robot: which one.
        gait: which one, where there is no scenario.
        planner: which one, with its tuning; None: ahead where a planar robot has a scenario that
            walks only, else lqr.
        simulation: how the run goes.
        scenario: a speed profile instead of one gait.

    Raises:
        ParameterError: if both a scenario and another gait are given.
    """

    robot: RobotChoice = field(default_factory=RobotChoice)
    gait: GaitChoice = field(default_factory=GaitChoice)
    planner: PlannerChoice | None = None
    simulation: SimulationOptions = field(default_factory=SimulationOptions)
    scenario: Scenario | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scenario is not None:
            for f in fields(GaitChoice):
                if getattr(self.gait, f.name) != f.default:
                    words = "gait" if f.name == "name" else f.name.replace("_", " ")
                    raise ParameterError(f"{words} does not go with a scenario: leave one out")

    @property
    def chosen(self) -> PlannerChoice:
        """The planner, with its tuning."""
        if self.planner is not None:
            return self.planner
        planar = not self.robot.free
        walks = planar and self.scenario is not None and self.scenario.only_walks
        return AheadOptions() if walks else LqrOptions()

    def prepare(self) -> Ready:
        """Load the robot and make its gait, route and planner.

        Raises:
            TemplateControlError: if one of them is not to be had.
        """
        if not self.robot.free and self.simulation.course != Course():
            raise ParameterError(
                "a course, of turning rate or step width, is for a free robot: give --free, or"
                " leave it out"
            )
        robot = self.robot.load()
        ready(WALK)  # before the gait is looked for, which would compile a part of it alone
        if self.scenario is None:
            choice, scale = self.gait, self.simulation.embedding.torque_scale
            if choice.apex_height is not None:
                check_apex(robot, choice.run_speed(robot), choice.apex_height, scale)
            gait = choice.of(robot, scale)
            planner = self._planner(gait)
            kept = planner.gait if isinstance(planner, AheadPlanner) else gait
            return Ready(robot, kept, None, {kept.stride: planner})
        if isinstance(self.chosen, AheadOptions):
            route = robot_route(robot, self.scenario, push_off=True)
            ahead = AheadPlanner(route.parameters, self.chosen, first_speed(route))
            return Ready(robot, ahead.gait, route, default_planners(route, ahead))
        route = robot_route(robot, self.scenario, push_off=False)
        walk = walking_gait(route.parameters, first_speed(route))
        return Ready(robot, walk, route, default_planners(route, self._planner(walk)))

    def with_stands(self, before: bool, after: bool) -> RunConfig:
        """The same walk as a scenario that begins or ends in a stand.

        Args:
            before: whether the robot stands before it walks.
            after: whether it stops and stands where its steps are done.

        Raises:
            ParameterError: if a scenario is given: it has its own stands; or a run, or a start.
            TemplateControlError: if the robot or its gait is not to be had.
        """
        if self.scenario is not None:
            raise ParameterError(
                "a scenario does not go with from stand or to stand: give it segments that stand"
            )
        robot = self.robot.load()
        gait = self.gait.of(robot)
        if not isinstance(gait, WalkingGait):
            raise ParameterError(f"gait {gait.name} does not begin in a stand: give a walk")
        if before and (self.simulation.start is not None or self.simulation.pose is not None):
            raise ParameterError("a start does not go with from stand: leave one out")
        steps = self.simulation.steps or STEPS
        speed, height, vertical = gait.vlo.tolist()
        stand = Segment("stand", duration=_STAND)
        walk = Segment("walk", speed=speed, steps=steps)
        scenario = Scenario(
            segments=(*(stand,) * before, walk, *(stand,) * after),
            parameters=gait.parameters,
            start=(speed, height, vertical),
            vlo=(height, vertical),
            apex_height=height,
            stand_height=STAND_HEIGHT * gait.parameters.rest_length,
            name=gait.name,
        )
        options = replace(self.simulation, steps=None)
        return replace(self, gait=GaitChoice(), simulation=options, scenario=scenario)

    def _planner(self, gait: WalkingGait | RunningGait) -> Planner:
        chosen = self.chosen
        if isinstance(chosen, OwnPlanner):
            return chosen.make(gait)
        if isinstance(gait, RunningGait) != isinstance(chosen, RunningOptions):
            raise ParameterError(
                f"planner {chosen.kind} does not plan gait {gait.name}: leave one out"
            )
        if isinstance(gait, RunningGait):
            assert isinstance(chosen, RunningOptions)
            return RunningPlanner(gait, chosen)
        if isinstance(chosen, ModifiedOptions):
            return ModifiedPlanner(gait, chosen)
        if isinstance(chosen, AheadOptions):
            return AheadPlanner(gait.parameters, chosen, float(gait.vlo[0]))
        assert isinstance(chosen, LqrOptions)
        default = self.robot.free and chosen == LqrOptions()
        return LqrPlanner(gait, FREE_PLANNER if default else chosen)

    @checked
    def save(self, path: str | Path) -> Path:
        """Write it as TOML, every number included.

        Raises:
            RecordError: if the file cannot be written.
            ParameterError: if something in it can be given in Python only.
        """
        whole = replace(self, planner=self.chosen)
        return storage.write_text(path, _HEAD + settings.text(settings.to_table(whole)))

    @classmethod
    @checked
    def load(cls, path: str | Path) -> RunConfig:
        """Read what :meth:`save` wrote, or a file that has only some of its keys.

        Raises:
            ParameterError: naming the file and the key, if it cannot be read, has an unknown key
                or a value of another type or out of its range.
        """
        return settings.read(cls, path)


_HEAD = "# template-control walk --config FILE repeats this run; so does run, for a run.\n"
