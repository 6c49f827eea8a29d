"""A scenario: a speed profile with gait switches, as data."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from template_control import settings
from template_control.checks.checked import Checked, checked
from template_control.checks.fitting import check
from template_control.checks.ranges import Count, Degrees, Positive, Range, Speed
from template_control.errors import ParameterError, ScenarioError
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.parameters import SlipParameters

Gait = Literal["walk", "run", "stand"]
Walking = Literal["modified", "active"]

STAND = "stand"
"""The gait of a segment in which the robot stands."""

STAND_HEIGHT = 0.97
"""Height at which a robot stands, over l0."""

MOST_STRIDES = 10_000
"""Largest number of strides of a scenario."""
_OF_MOTION = ("speed", "acceleration", "until_speed", "steps")
_LONGEST = 3600.0  # [s] of a scenario
_HARDEST = 100.0  # [m/s^2]
_ENDS = ("until_speed", "duration", "steps")

Vertical = Annotated[float, Range(-100.0, 100.0)]
"""Vertical speed [m/s]."""


@dataclass(frozen=True)
class Segment(Checked):
    """A stretch of the profile. It ends with ``until_speed``, ``duration`` or ``steps``.

    Attributes:
        gait: "walk", "run" or "stand". Where it differs from the segment before, the first
            stride is the transition.
        speed: wanted at the segment's start [m/s]; None goes on from the profile. A stand has none.
        acceleration: of the wanted speed [m/s^2].
        until_speed: ends when the wanted speed gets there, and the template's own is there
            too if the profile slows down [m/s].
        duration: [s]; of a stand from when the robot is at rest.
        steps: number of strides after the transition.

    Raises:
        ScenarioError: if a value is of a wrong type or out of its range.
    """

    _error = ScenarioError

    gait: Gait
    speed: Speed | None = None
    acceleration: Annotated[float, Range(-_HARDEST, _HARDEST)] = 0.0
    until_speed: Speed | None = None
    duration: Positive | None = None
    steps: Count | None = None


@dataclass(frozen=True)
class Scenario(Checked):
    """Gaits and speeds of the template from a VLO or a stand on; the defaults are Table IV's.

    Attributes:
        segments: the profile.
        parameters: the template.
        map_kind: return map of the controllers; the simulation is always exact.
        start: (3,) dx/dt, y, dy/dt at the first VLO [m/s, m, m/s].
        touchdown_angle: first guess of walking [deg].
        vlo: (2,) y and dy/dt wanted at VLO [m, m/s]. The wanted dx/dt is a segment's speed.
        apex_height: y wanted at apex [m].
        stand_height: y wanted where the robot stands [m].
        walking: "modified" (38) or "active" (37) walking controller.
        name: for titles and files.

    Raises:
        ScenarioError: naming the first thing that is wrong.
    """

    _error = ScenarioError
    kind: ClassVar[str] = "scenario"
    old_keys: ClassVar = {"segment": "segments", "map": "map_kind"}

    segments: tuple[Segment, ...]
    parameters: SlipParameters = field(default_factory=SlipParameters)
    map_kind: MapKind = MapKind.PAPER
    start: tuple[Speed, Positive, Vertical] = (1.1, 0.98, 0.0)
    touchdown_angle: Degrees = 70.0
    vlo: tuple[Positive, Vertical] = (0.98, 0.0)
    apex_height: Positive = 0.98
    stand_height: Positive = STAND_HEIGHT
    walking: Walking = "modified"
    name: str = "scenario"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check(self)

    def on(self, parameters: SlipParameters) -> Scenario:
        """The same scenario for another template.

        Heights grow with l0. Speeds, accelerations and times stay as they were asked for.
        """
        ratio = parameters.rest_length / self.parameters.rest_length
        speed, height, vertical = self.start
        return replace(
            self,
            parameters=parameters,
            start=(speed, height * ratio, vertical),
            vlo=(self.vlo[0] * ratio, self.vlo[1]),
            apex_height=self.apex_height * ratio,
            stand_height=self.stand_height * ratio,
        )

    @property
    def gaits(self) -> frozenset[Gait]:
        """The gaits of its segments."""
        return frozenset(segment.gait for segment in self.segments)

    @property
    def walking_speed(self) -> float:
        """dx/dt at VLO that the first walk begins with [m/s]; the start's where none says it."""
        if self.segments[0].gait != STAND:
            return self.start[0]
        return next((s.speed for s in self.segments if s.speed is not None), self.start[0])

    @property
    def stands(self) -> bool:
        """True if a segment is a stand."""
        return STAND in self.gaits

    def has_any_speed(self, bears: bool) -> bool:
        """True if its walk may have any speed of the family, in steps with push-off.

        Args:
            bears: whether feet bear the centre of pressure around them: then it may stand too.
        """
        return self.gaits <= ({"walk", STAND} if bears else {"walk"})

    def in_motion(self) -> Scenario | None:
        """The scenario without its stands, from a VLO on; None where nothing is left."""
        if not self.stands:
            return self
        moving = tuple(segment for segment in self.segments if segment.gait != STAND)
        if not moving:
            return None
        start = self.start
        if self.segments[0].gait == STAND:
            start = (moving[0].speed or start[0], *self.vlo)
        return replace(self, segments=moving, start=start)


def _check(scenario: Scenario) -> None:
    s = scenario
    length = s.parameters.rest_length
    for name, height, most in (
        ("start height", s.start[1], length),
        ("vlo height", s.vlo[0], length),
        ("stand_height", s.stand_height, length),
        ("apex_height", s.apex_height, 100.0 * length),
    ):
        below = Annotated[float, Range(0.0, most, above=True, below=True)]
        check(name, height, below, ScenarioError)
    if not s.segments:
        raise ScenarioError("the scenario has no segments: give at least one [[segments]]")
    for i, segment in enumerate(s.segments, 1):
        _check_segment(f"segment {i}", segment)
    first = s.segments[0]
    if first.gait != STAND and (first.gait != "walk" or first.speed is None):
        raise ScenarioError(
            "segment 1 must stand, or walk at a given speed: the start is a stand or a VLO"
        )
    _check_stands(s.segments)
    _check_profile(s.segments)


def _check_stands(segments: tuple[Segment, ...]) -> None:
    """Check that stands are entered from a walk, and left for a walk of a given speed."""
    for i, (one, other) in enumerate(pairwise(segments), 1):
        if {one.gait, other.gait} == {STAND, "run"}:
            raise ScenarioError(
                f"segments {i} and {i + 1} {one.gait} and {other.gait}: put one between them that"
                " walks"
            )
        if one.gait == STAND and other.gait == "walk" and other.speed is None:
            raise ScenarioError(f"segment {i + 1} walks after a stand: give it a speed")


def _check_profile(segments: tuple[Segment, ...]) -> None:
    """Check that every segment ends, and the whole scenario within an hour.

    Where a segment ends after some steps, the speed at which the next one begins is not known.
    """
    total, speed = 0.0, None
    for i, segment in enumerate(segments, 1):
        if segment.gait == STAND:
            speed = 0.0
        elif segment.speed is not None:
            speed = segment.speed
        lasts, until, rate = segment.duration or 0.0, segment.until_speed, segment.acceleration
        if until is not None and speed is not None:
            lasts = (until - speed) / rate
            if lasts < 0.0:
                raise ScenarioError(
                    f"segment {i} begins at {speed:g} m/s and never gets to until_speed {until:g}"
                    f" with an acceleration of {rate:g}: give the other sign"
                )
        total += lasts
        if total > _LONGEST:
            raise ScenarioError(
                f"segment {i} ends after {total:g} s: give a scenario of at most {_LONGEST:g} s"
            )
        if speed is not None:
            speed = max(speed + rate * lasts, 0.0) if segment.steps is None else None
    strides = sum(segment.steps or 0 for segment in segments)
    if strides > MOST_STRIDES:
        raise ScenarioError(f"the segments have {strides} steps: give at most {MOST_STRIDES}")


def _check_segment(where: str, segment: Segment) -> None:
    if segment.gait == STAND:
        moves = [name for name in _OF_MOTION if getattr(segment, name)]
        if moves:
            raise ScenarioError(f"{where} stands and has {moves[0]}: give it a duration only")
    ends = [name for name in _ENDS if getattr(segment, name) is not None]
    if not ends:
        raise ScenarioError(f"{where} never ends: give it until_speed, duration or steps")
    if len(ends) > 1:
        raise ScenarioError(f"{where} has {' and '.join(ends)}: give it one of them")
    if segment.until_speed is not None and segment.acceleration == 0.0:
        raise ScenarioError(f"{where} has until_speed but no acceleration: give one")


@checked
def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario from a TOML file, as :mod:`~template_control.settings` has it.

    The attributes' names are its keys: ``[parameters]`` holds the template, each ``[[segments]]`` a
    :class:`Segment`; ``map_kind`` is the map's name in lower case.

    Args:
        path: of the file.

    Raises:
        ScenarioError: naming the file and what is wrong in it.
    """
    try:
        return settings.read(Scenario, path)
    except ParameterError as error:
        raise ScenarioError(str(error)) from None


@checked
def example_one(map_kind: MapKind = MapKind.PAPER, acceleration: float = 1.05) -> Scenario:
    """The paper's Example I (Section V-A): walk, run up to 5 m/s and down again, walk.

    It starts at the VLO speed that is 1.17 m/s on average, as Section V-A has it (Table IV
    has 1.1 m/s there, which is 1.13 m/s on average); it ends at Table IV's 1.1 m/s.

    Args:
        map_kind: return map of the controllers.
        acceleration: of the run, and its negative [m/s^2].
    """
    return Scenario(
        segments=(
            Segment("walk", speed=1.125, duration=0.8),
            Segment("run", speed=1.9, acceleration=acceleration, until_speed=5.0),
            Segment("run", duration=1.5),
            Segment("run", acceleration=-acceleration, until_speed=2.0),
            Segment("walk", speed=1.1, steps=20),
        ),
        map_kind=map_kind,
        start=(1.125, 0.98, 0.0),
        name="Example I",
    )
