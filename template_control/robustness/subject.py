"""What is disturbed: the robot, what it keeps, and the engine that it goes in."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from template_control.checks.checked import Checked
from template_control.plant.bullet import PlantOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.robustness.disturbance import Situation
from template_control.run.config import RunConfig
from template_control.run.specs import GaitSpec, RobotSpec

Engine = Literal["pybullet", "mujoco"]
"""A physics engine, by the ``kind`` of its options."""

ENGINES: dict[str, type[PlantOptions]] = {o.kind: o for o in (PlantOptions, MujocoOptions)}
"""Options of each."""


@dataclass(frozen=True)
class Subject(Checked):
    """What is disturbed.

    Attributes:
        robot: which one.
        speed: of a run, dx/dt at apex [m/s]; of a free robot, which walks, its mean speed. None:
            the robot walks its own gait.
        plant: the engine.
    """

    robot: RobotSpec = field(default_factory=RobotSpec)
    speed: float | None = None
    plant: Engine = "pybullet"

    def situation(self) -> Situation:
        """The robot with its gait and planner, and the world.

        Raises:
            TemplateControlError: if robot or gait is not to be had.
        """
        runs = self.speed is not None and not self.robot.free
        ready = RunConfig(self.robot, GaitSpec("run" if runs else "walk", self.speed)).prepare()
        planner = ready.planners[ready.gait.stride]
        return Situation(ready.robot, ready.gait, planner, ENGINES[self.plant]())
