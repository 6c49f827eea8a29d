"""A whole run as data: robot, gait, planner and options, to be written down and done again.

``walk`` writes one beside every run, ``run.toml``; ``walk --config run.toml`` repeats the run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import NamedTuple

from template_control import settings, storage
from template_control.checks.checked import Checked, checked
from template_control.embedding.free.options import FREE_PLANNER
from template_control.embedding.planners.ahead import AheadOptions, AheadPlanner
from template_control.embedding.planners.default import default_planners, first_speed
from template_control.embedding.planners.lqr import LqrOptions, LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.planners.running import RunningOptions, RunningPlanner
from template_control.embedding.planners.walk_kernels import WALK
from template_control.embedding.robot_route import robot_route
from template_control.embedding.robot_template import check_apex
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.run.options import HeadingCommand, SimulationOptions
from template_control.run.record import Record
from template_control.run.simulation import STEPS, simulate
from template_control.run.specs import GaitSpec, OwnPlanner, PlannerSpec, RobotSpec
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.gaits.running_gait import RunningGait
from template_control.slip.gaits.walking_by_speed import walking_gait
from template_control.slip.scenario.scenario import STAND_HEIGHT, Scenario, Segment
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.warm_up import ready

_STAND = 2.0  # a walk's first and last stand [s]


class PreparedRun(NamedTuple):
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
            walks only, running for a run, else lqr, tuned for the kind of robot.
        simulation: how the run goes; the robot's own tuning where none is given.
        scenario: a speed profile instead of one gait.

    Raises:
        ParameterError: if both a scenario and another gait are given.
    """

    robot: RobotSpec = field(default_factory=RobotSpec)
    gait: GaitSpec = field(default_factory=GaitSpec)
    planner: PlannerSpec | None = None
    simulation: SimulationOptions = field(default_factory=SimulationOptions)
    scenario: Scenario | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "simulation", self.simulation.for_robot(self.robot.free))
        if self.scenario is not None:
            for f in fields(GaitSpec):
                if getattr(self.gait, f.name) != f.default:
                    words = "gait" if f.name == "name" else f.name.replace("_", " ")
                    raise ParameterError(f"{words} does not go with a scenario: leave one out")

    @property
    def chosen(self) -> PlannerSpec:
        """The planner, with its tuning."""
        if self.planner is not None:
            return self.planner
        if self.robot.free:
            return FREE_PLANNER
        if self.scenario is not None:
            return AheadOptions() if self.scenario.only_walks else LqrOptions()
        return RunningOptions() if self.gait.name == "run" else LqrOptions()

    def resolved(self) -> RunConfig:
        """The same run with the planner that is used where none was given."""
        return replace(self, planner=self.chosen)

    def prepare(self) -> PreparedRun:
        """Load the robot and make its gait, route and planner.

        Raises:
            TemplateControlError: if one of them is not to be had.
        """
        if not self.robot.free and self.simulation.course != HeadingCommand():
            raise ParameterError(
                "a course, of turning rate or step width, is for a free robot: give"
                " --floating-base, or leave it out"
            )
        if not self.robot.free and any(push.direction for push in self.simulation.pushes):
            raise ParameterError(
                "a push with a direction is for a free robot: give --floating-base, or leave it out"
            )
        robot = self.robot.load()
        ready(WALK)  # before the gait is looked for, which would compile a part of it alone
        if self.scenario is None:
            choice, scale = self.gait, self.simulation.tuning(self.robot.free).torque_scale
            if choice.apex_height is not None:
                check_apex(robot, choice.run_speed(robot), choice.apex_height, scale)
            gait = choice.of(robot, scale)
            planner = self._planner(gait)
            kept = planner.gait if isinstance(planner, AheadPlanner) else gait
            return PreparedRun(robot, kept, None, {kept.stride: planner})
        if isinstance(self.chosen, AheadOptions):
            route = robot_route(robot, self.scenario, push_off=True)
            ahead = AheadPlanner(route.parameters, self.chosen, first_speed(route))
            return PreparedRun(robot, ahead.gait, route, default_planners(route, ahead))
        route = robot_route(robot, self.scenario, push_off=False)
        walk = walking_gait(route.parameters, first_speed(route))
        return PreparedRun(robot, walk, route, default_planners(route, self._planner(walk)))

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
        return replace(self, gait=GaitSpec(), simulation=options, scenario=scenario)

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
        return LqrPlanner(gait, chosen)

    @checked
    def save(self, path: str | Path) -> Path:
        """Write it as TOML, :meth:`resolved`, every number included.

        Raises:
            RecordError: if the file cannot be written.
            ParameterError: if something in it can be given in Python only.
        """
        table = settings.to_table(self.resolved())
        return storage.write_text(path, _HEAD + settings.text(table))

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
