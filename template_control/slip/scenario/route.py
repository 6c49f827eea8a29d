"""Routes: the next stride and its target state; speed profiles and commands.

One type for all that follow one: the template's :func:`~.run.simulate_scenario` and a robot's
controller ask the same question at each section they come to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import SpeedOrRest
from template_control.errors import ParameterError, ScenarioError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.dynamics.stride import finite
from template_control.slip.gaits.gait import Gait as PeriodicGait
from template_control.slip.maps.section import Section, section_of
from template_control.slip.parameters import SlipParameters


@dataclass(frozen=True)
class StrideGoal:
    """Stride that a route asks for at a section, and its target.

    Attributes:
        stride: the kind of stride that comes next, a key of ``STRIDE_START``.
        target: (n,) state wanted at the section the stride ends at.
        wanted_speed: the profile's speed there [m/s].
        segment: index of the scenario's segment, from 0.
        then: the next kind of stride that is another, as far as is known; what it needs can be
            prepared.
    """

    stride: str
    target: Array
    wanted_speed: float
    segment: int = 0
    then: str | None = None

    @property
    def closes(self) -> bool:
        """Whether the feet are closed next, by a step."""
        return self.then == StrideKind.STEP_FORWARD


@runtime_checkable
class Route(Protocol):
    """Choice of the next stride at every section."""

    @property
    def parameters(self) -> SlipParameters:
        """The template that the route is for."""

    @property
    def start(self) -> Array:
        """(n,) state at :attr:`section` to begin in."""

    @property
    def section(self) -> Section:
        """The section that a run begins at."""

    @property
    def endless(self) -> bool:
        """True if :meth:`next` always knows a stride."""

    def reset(self) -> None:
        """Go back to the beginning; a run calls it first."""

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """Go on from a section; call it once at each, in order.

        Args:
            section: where the run is.
            z: (n,) its state there.
            now: time [s].

        Returns:
            The stride that begins here, None where the route ends.
        """

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """Goal that :meth:`next` would return here; the route does not go on.

        Arguments as for :meth:`next`.
        """


class SteadyRoute:
    """A route that repeats one stride to one target for ever.

    Args:
        parameters: the template.
        stride: key of the automaton's ``starts``; it ends at the section it begins at.
        target: (n,) state wanted there.
        start: (n,) state to begin in; the target by default.
        automaton: that the stride is of.

    Raises:
        ParameterError: for a stride that is unknown or cannot follow itself, and for a state
            of a wrong shape or with a number that is not finite.
    """

    endless = True

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        stride: str,
        target: Sequence[float] | Array,
        start: Sequence[float] | Array | None = None,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        begin, end = automaton.sections(automaton.start(stride).name)
        if begin is not end:
            raise ParameterError(
                f"stride {stride!r} leads from {begin.name} to {end.name} and cannot follow itself:"
                " give one that ends where it begins"
            )
        self.parameters = parameters
        self.section = section_of(begin)
        size = self.section.dimension
        aim = finite("target", target, size)
        self.start = aim.copy() if start is None else finite("start", start, size)
        self._goal = StrideGoal(stride, aim, float(aim[0]))

    @classmethod
    def of(cls, gait: PeriodicGait, automaton: Automaton = AUTOMATON) -> SteadyRoute:
        """The route that keeps a gait.

        Args:
            gait: any whose stride returns to its state.
            automaton: that its stride is of.
        """
        return cls(gait.parameters, gait.stride, gait.state, automaton=automaton)

    def reset(self) -> None:
        """Do nothing: every stride is alike."""

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`Route.next`."""
        return self._goal

    ahead = next


@dataclass(frozen=True)
class SpeedProfile(Checked):
    """Speeds at times, and straight lines between them; called with a time, it gives the speed.

    Before the first time and after the last the speed is that time's.

    Attributes:
        times: rising [s].
        speeds: mean forward speed wanted at each [m/s].

    Raises:
        ScenarioError: if there are not as many speeds as times, or the times do not rise.
    """

    _error = ScenarioError

    times: tuple[float, ...]
    speeds: tuple[SpeedOrRest, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.times or len(self.times) != len(self.speeds):
            raise ScenarioError(
                f"a profile has {len(self.times)} times and {len(self.speeds)} speeds: give one"
                " speed for each time, and at least one"
            )
        for before, after in pairwise(self.times):
            if after <= before:
                raise ScenarioError(
                    f"a profile's time {after:g} s comes after {before:g} s: give rising times"
                )

    def __call__(self, time: float) -> float:
        """The speed wanted at ``time`` [s]."""
        return float(np.interp(time, self.times, self.speeds))


SpeedAtTime = Callable[[float], float]
"""The mean forward speed wanted at a time: m/s, from s."""
