"""The route of a scenario: its segments, stride by stride."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import StrideKind, WalkingStride
from template_control.slip.maps.section import APEX, REST, VLO, Section, section_of
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.scenario.scenario import STAND, Gait, Scenario, Segment

# A change of speed of a scenario that stands takes a stride of its own; dx/dt at VLO / sqrt(g l0):
_STOPPABLE = 0.16  # from which one step leads to rest
_SLOWED = 0.11  # to which a faster walk is slowed down first, so that its last step can be short
# Difference from the wanted speed that the walking planner is left to make good: a stride of its
# own throws a robot that has reached its speed off it.
_BEHIND = 0.03

_STRIDES: dict[tuple[Section, Gait], str] = {
    (VLO, "walk"): StrideKind.WALK,
    (VLO, "run"): StrideKind.WALK_TO_RUN,
    (APEX, "run"): StrideKind.RUN,
    (APEX, "walk"): StrideKind.RUN_TO_WALK,
    (REST, "stand"): StrideKind.STAND,
    (REST, "walk"): StrideKind.STAND_TO_WALK,
    (VLO, "stand"): StrideKind.WALK_TO_STAND,
}
_KEPT = (StrideKind.WALK, StrideKind.RUN, StrideKind.STAND)  # all others are transitions
_GAITS: dict[Section, Gait] = {VLO: "walk", APEX: "run", REST: "stand"}  # that sections are of
_FIRST_DURATION = 1.6  # of sqrt(l0/g): guess of a stride's duration before one was made
_LONGEST = 2.0  # of that guess: what took longer was no stride alone, but one that a run caught


def _leads_to(kind: str) -> Section:
    """The section that a kind of stride ends at."""
    return section_of(AUTOMATON.sections(AUTOMATON.starts[kind])[1])


@dataclass(frozen=True)
class _Progress:
    """Progress of a run in its scenario."""

    speed: float  # of the profile where the segment begins [m/s]
    began: float = 0.0  # when that was [s]
    index: int = 0  # of the segment
    strides: int = 0  # done in the segment, transitions not counted
    duration: Mapping[str, float] = field(default_factory=dict)  # of each kind's last stride [s]
    last: tuple[str, float] | None = None  # kind of the stride under way, and when it began
    walking: bool = True  # the walk has come to its speed since the last stand
    took: float | None = None  # how long the stride took, None if it follows from the times [s]
    over: bool = False  # past the last segment

    @property
    def kind(self) -> str:
        """Of the stride under way."""
        return "" if self.last is None else self.last[0]

    def arrived(self, now: float) -> _Progress:
        """At a section: the stride that was under way is done."""
        if self.last is None:
            return replace(self, began=now)
        kind, left = self.last
        took = now - left if self.took is None else self.took
        here = replace(self, duration={**self.duration, kind: took}, last=None, took=None)
        if kind not in _KEPT and not (kind == StrideKind.CHANGE_SPEED and self.walking):
            # The transition leads to where the segment's profile begins.
            return replace(here, began=now)
        return replace(here, strides=self.strides + 1)

    def profile(self, segment: Segment, now: float) -> float:
        """The segment's profile, whatever ends it [m/s]."""
        return self.speed + segment.acceleration * (now - self.began)

    def wanted(self, segment: Segment, now: float) -> float:
        """The profile's speed, which stops rising at ``until_speed`` [m/s]."""
        value = self.profile(segment, now)
        if segment.until_speed is not None and segment.acceleration > 0.0:
            return min(value, segment.until_speed)
        return max(value, 0.0)

    def ends(self, segment: Segment, now: float, speed: float) -> bool:
        """True if the segment ends at a section passed at ``now`` with ``speed``."""
        if segment.duration is not None and now - self.began >= segment.duration:
            return True
        if segment.steps is not None and self.strides >= segment.steps:
            return True
        if segment.until_speed is None:
            return False
        wanted = self.profile(segment, now)
        if segment.acceleration > 0.0:
            return wanted >= segment.until_speed
        return wanted <= segment.until_speed and speed < segment.until_speed


class ScenarioRoute:
    """The route of a :class:`~.scenario.Scenario`: its speed profile and its gaits.

    The times of the calls show how long strides take, how many were made, and when a
    transition has led to the segment that it belongs to.

    Args:
        scenario: the profile.
        apex_height: y wanted at apex [m] by dx/dt there [m/s]; None: the scenario's.
        vlo_height: y wanted at VLO [m] by dx/dt there [m/s]; None: the scenario's.
        walks: kind of its walking steps, "wp" with push-off.
        bears: whether feet bear the centre of pressure around them, so that a stand starts and
            stops at the walk's own speed. Over feet that are points a change of speed takes a
            stride of its own, and a step closes the feet.
    """

    endless = False

    @checked
    def __init__(
        self,
        scenario: Scenario,
        apex_height: Callable[[float], float] | None = None,
        vlo_height: Callable[[float], float] | None = None,
        walks: WalkingStride = StrideKind.WALK,
        *,
        bears: bool = False,
    ) -> None:
        self.scenario = scenario
        self.walks, self._bears = walks, bears
        self._vlo_height = vlo_height or (lambda speed: scenario.vlo[0])
        self._apex_height = apex_height or (lambda speed: scenario.apex_height)
        self.parameters = scenario.parameters
        stands = scenario.segments[0].gait == STAND
        self.section = REST if stands else VLO
        start = (0.0, scenario.stand_height, 0.0) if stands else scenario.start
        self.start = np.array(start, dtype=float)
        p = self.parameters
        self._guess = _FIRST_DURATION * np.sqrt(p.rest_length / p.gravity)
        self._unit = p.speed_unit
        self.reset()

    @property
    def pushes_off(self) -> bool:
        """True if its walking steps have a push-off."""
        return self.walks != StrideKind.WALK

    def reset(self) -> None:
        """Back to the beginning."""
        first = self.scenario.segments[0]
        self._progress = _Progress(first.speed or 0.0, walking=first.gait != STAND)

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`Route.next`."""
        self._progress, goal = self._go(section, z, now)
        return goal

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`Route.ahead`."""
        return self._go(section, z, now)[1]

    def took(self, duration: float) -> None:
        """Take note of how long the stride under way took [s], before the section it ends at.

        This call is optional. Without it the duration is a difference of two times, with its
        rounding.
        """
        self._progress = replace(self._progress, took=duration)

    def _go(self, section: Section, z: Array, now: float) -> tuple[_Progress, StrideGoal | None]:
        here = self._segment(self._progress.arrived(now), float(z[0]), now)
        if here.over:
            return here, None
        s = self.scenario
        segment = s.segments[here.index]
        kind = _STRIDES[section, segment.gait]
        stopped = section is REST and self._progress.kind == StrideKind.WALK_TO_STAND
        if stopped and not self._bears:
            kind = StrideKind.STEP_FORWARD  # the last step of a walk is a long one
        if kind in (StrideKind.WALK_TO_STAND, StrideKind.WALK):
            here, kind = self._reached(here, kind, float(z[0]), now)
        # A transition aims at where the profile begins, the others at where they will end.
        aims = kind in _KEPT or (kind == StrideKind.CHANGE_SPEED and here.walking)
        took = min(here.duration.get(kind, self._guess), _LONGEST * self._guess)
        ahead = took if aims else 0.0
        speed = here.wanted(segment, now + ahead)
        if segment.gait == STAND:
            speed = _SLOWED * self._unit if kind == StrideKind.CHANGE_SPEED else 0.0
        if _leads_to(kind) is REST:
            target = [0.0, s.stand_height, 0.0]
        elif segment.gait == "run":
            target = [speed, self._apex_height(speed)]
        else:
            target = [speed, self._vlo_height(speed), s.vlo[1]]
        then = self._then(kind, here.index)
        goal = StrideGoal(self._named(kind), np.array(target), speed, here.index, then)
        return replace(here, last=(kind, now)), goal

    def _named(self, kind: str) -> str:
        """The kind of stride that a kind of the tables is made as."""
        return self.walks if kind == StrideKind.WALK else kind

    def _reached(
        self, here: _Progress, kind: str, speed: float, now: float
    ) -> tuple[_Progress, str]:
        """The stride at VLO with ``speed``: one to another speed comes first where it must."""
        segment = self.scenario.segments[here.index]
        if segment.gait == STAND:
            slow = self._bears or speed <= _STOPPABLE * self._unit
            return replace(here, walking=False), kind if slow else StrideKind.CHANGE_SPEED
        near = abs(speed - here.wanted(segment, now)) <= _BEHIND * self._unit
        if near or self._bears or not self.scenario.stands:
            return replace(here, walking=True), kind
        return here, StrideKind.CHANGE_SPEED

    def _then(self, kind: str, index: int) -> str | None:
        """The next kind of stride after those of ``kind`` in segment ``index``."""
        section = _leads_to(kind)
        gait = _GAITS[section]
        if kind not in _KEPT:
            return self._named(_STRIDES[section, gait])
        later = (segment.gait for segment in self.scenario.segments[index:])
        return next(
            (self._named(_STRIDES[section, other]) for other in later if other != gait), None
        )

    def _segment(self, here: _Progress, speed: float, now: float) -> _Progress:
        """Enter the segment that holds at ``now``."""
        segments = self.scenario.segments
        while not here.over and here.ends(segments[here.index], now, speed):
            wanted = here.wanted(segments[here.index], now)
            if here.index + 1 == len(segments):
                return replace(here, over=True)
            stands = segments[here.index + 1].gait == STAND
            given = 0.0 if stands else segments[here.index + 1].speed
            here = replace(
                here,
                speed=wanted if given is None else given,
                began=now,
                index=here.index + 1,
                strides=0,
            )
        return here
