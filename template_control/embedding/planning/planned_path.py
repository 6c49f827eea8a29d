"""The template's path that the robot follows, and how far along it the robot is."""

from __future__ import annotations

import numpy as np

from template_control.embedding.references.template_path import Landing, TemplatePath
from template_control.slip.automaton.vocabulary import NUM_EVENTS, Event


class PlannedPath:
    """The path from the last plan on, and which of its events are over.

    Attributes:
        path: the template's, from the last plan on.
        dues: time on the path at which each :class:`Event` comes next [s], inf if it does not.
        feet: that were the rear and the front leg's where the path starts.
    """

    def __init__(self) -> None:
        self.path: TemplatePath
        self.dues = [np.inf] * NUM_EVENTS
        self._passed = 0  # so many of the path's events are over
        self.feet = (0, 1)

    def take(self, path: TemplatePath, feet: tuple[int, int]) -> None:
        """Follow another path, from its start.

        Args:
            path: the template's.
            feet: that are the rear and the front leg's where it starts.
        """
        self.path, self.feet = path, feet
        self._look_ahead(0)

    def due(self, event: Event) -> float:
        """Time on the path at which ``event`` comes next [s], inf if it does not."""
        return self.dues[event]

    def pass_event(self, event: Event) -> None:
        """The robot has fired ``event``."""
        self._look_ahead(self.path.after(event, self._passed))

    def _look_ahead(self, passed: int) -> None:
        """So many of the path's events are over: note when each comes next."""
        self._passed = passed
        self.dues = self.path.dues(passed)

    def landing(self, foot: int) -> Landing:
        """Where and when on the path a foot next touches down."""
        return self.path.landings[self.feet.index(foot)]

    @property
    def toe(self) -> float:
        """x of the template's rear toe [m]."""
        return float(self.path.curve.look[0])

    def stand_on(self, foot: int) -> None:
        """The template's rear toe is now the one that was this foot's at the start of the path."""
        self.path.curve.look[0] = self.path.toes[self.feet.index(foot)]
