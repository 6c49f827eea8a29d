"""Which planner chooses the steps, as data."""

from __future__ import annotations

import importlib
import inspect
import os
import sys
from dataclasses import dataclass
from typing import ClassVar

from template_control.checks.checked import Checked
from template_control.embedding.ahead.options import AheadOptions
from template_control.embedding.planners.planner import Planner
from template_control.embedding.planners.running import RunningOptions
from template_control.embedding.planners.walking.lqr_options import LqrOptions
from template_control.embedding.planners.walking.modified import ModifiedOptions
from template_control.errors import ParameterError
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.gaits.running_gait import RunningGait

_PLANNER_MEMBERS = ("gait", "offset", "reset", "decide", "observe")


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


PlannerChoice = LqrOptions | AheadOptions | ModifiedOptions | RunningOptions | OwnPlanner
"""Which planner, with its tuning."""
