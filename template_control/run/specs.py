"""Robot, gait and planner of a run, as data."""

from __future__ import annotations

import importlib
import inspect
import os
import sys
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.fitting import members
from template_control.checks.ranges import Degrees, Positive, Speed
from template_control.embedding.planners.ahead import AheadOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.embedding.planners.modified import ModifiedOptions
from template_control.embedding.planners.planner import Planner
from template_control.embedding.planners.running import RunningOptions
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.template import (
    default_gait,
    paper_gait,
    robot_gait_for_speed,
    template_for,
)
from template_control.slip.gaits.gait import Gait, WalkingGait
from template_control.slip.gaits.running_gait import RunningGait, running_gait
from template_control.slip.gaits.walking_by_speed import gait_for_speed
from template_control.slip.similarity import REFERENCE

_GAIT_NUMBERS = {"walk": ("speed", "touchdown_angle"), "paper": (), "run": ("speed", "apex_height")}
_RUN = 3.0 / float(np.sqrt(REFERENCE.gravity * REFERENCE.rest_length))
SOLE_RUN = 0.53
"""Run on soles, by default and the fastest by command: dx/dt at apex over sqrt(g l0). G1 keeps it;
with 1.75 m/s (0.69) a fifth of its ticks is at a limit, and at 2 m/s it falls."""


@dataclass(frozen=True)
class GaitSpec(Checked):
    """Specification of a gait of the robot's template.

    Attributes:
        name: "walk", the robot's own; "paper", the equilibrium of Section IV-D; or "run".
        speed: of a walk the mean forward speed, instead of its own; of a run dx/dt at apex [m/s];
            None: 3 m/s for l0 = 1 m.
        touchdown_angle: of a walk, from the ground to the leg, instead of its own [deg].
        apex_height: of a run [m]; None: one that suits its speed.
        from_stand: of a walk, whether the robot stands for 2 s first.
        to_stand: of a walk, whether it stops after its steps, and stands for 2 s.

    Raises:
        ParameterError: if a gait is given what it does not have.
    """

    kind: ClassVar[str] = "gait"

    name: Literal["walk", "paper", "run"] = "walk"
    speed: Speed | None = None
    touchdown_angle: Degrees | None = None
    apex_height: Positive | None = None
    from_stand: bool = False
    to_stand: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("speed", "touchdown_angle", "apex_height"):
            if getattr(self, name) is not None and name not in _GAIT_NUMBERS[self.name]:
                words = name.replace("_", " ")
                raise ParameterError(f"{words} does not go with gait {self.name}: leave one out")
        if self.name == "run" and (self.from_stand or self.to_stand):
            raise ParameterError("gait run does not begin in a stand: give a walk")

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
        """Of a run of a ``robot``, dx/dt at apex [m/s]; the robot's last update is overwritten."""
        if self.speed is not None:
            return self.speed
        return (SOLE_RUN if robot.patches else _RUN) * template_for(robot).speed_unit


@dataclass(frozen=True)
class OwnPlanner(Checked):
    """A planner of the user's own.

    Attributes:
        path: "module:Class"; the class is called with the gait. The module is looked for in the
            current folder too.
    """

    kind: ClassVar[str] = "own"

    path: str

    def make(self, gait: Gait) -> Planner:
        """The planner that is to lead to a ``gait``.

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
            lacking = [n for n in members(Planner) if not hasattr(made, n)]
            raise ParameterError(
                f"planner {self.path!r} lacks {', '.join(lacking)}: derive it from Planner"
            )
        return made


PlannerSpec = LqrOptions | AheadOptions | ModifiedOptions | RunningOptions | OwnPlanner
"""A planner with its tuning."""
