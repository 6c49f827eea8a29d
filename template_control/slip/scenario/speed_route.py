"""Route at a speed that a function of time gives: standing, walking and running."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.fitting import check
from template_control.checks.ranges import NotNegative, Positive
from template_control.errors import ScenarioError
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.gaits.walking_by_speed import gaits_by_speed, walking_by_speed
from template_control.slip.maps.section import APEX, REST, VLO, Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SpeedAtTime, StrideGoal
from template_control.slip.scenario.scenario import STAND, STAND_HEIGHT, Gait
from template_control.slip.similarity import ACCELERATION, REFERENCE, SPEED, Scale, scaled, tuned

_FIRST_DURATION = 2.2  # of sqrt(l0 / g): guess of a step's duration before one was made
# Changes of the gait, for the reference template.
_SLOWEST = 0.3  # mean speed of the slowest walk that robots keep [m/s]; a slower one stands
_NEAR = 0.1  # difference from it with which a run begins [m/s]
_FIRST = 1.3  # dx/dt at the first apex of a run [m/s]: the slower, the less torque it needs
_LAST = 1.4  # dx/dt at apex from which on a run may end [m/s]
_LEAN = 3.5  # time of the trunk to lean forward before a run, and to rise after it [s]
_KEPT = (StrideKind.WALK_PUSH_OFF, StrideKind.RUN, StrideKind.HOP)
_STOP = 0.5  # dx/dt at VLO from which one step leads to rest [m/s]


@dataclass(frozen=True)
class GaitChangeOptions(Checked):
    """Border of walk and run by speed, and the change of a run's speed.

    Attributes:
        run: mean speed from which a robot runs, and below which it walks [m/s].
        take_off: dx/dt at the VLO where a run begins and ends [m/s].
        fastest: dx/dt at apex of the fastest run [m/s]; a faster one is not wanted of the template.
        hop: mean speed below which a robot that runs hops: it runs slowly, on the spot and
            backward [m/s]; 0: it does not.
        hysteresis: width of the band about ``run`` in which it keeps its gait [m/s].
        acceleration: of the speed that is wanted of a run, on its way to another [m/s^2].
    """

    run: Positive = tuned(1.4, SPEED)
    take_off: Positive = tuned(1.1, SPEED)
    fastest: Positive = tuned(6.0, SPEED)
    hop: NotNegative = tuned(0.0, SPEED)
    hysteresis: NotNegative = tuned(0.1, SPEED)
    acceleration: Positive = tuned(0.35, ACCELERATION)


class _Way(NamedTuple):
    """Progress on the route."""

    began: float  # time of the last section [s]
    took: float  # duration of the last stride of a gait, or a guess [s]
    stride: str = ""  # kind of the one under way
    runs: bool = False  # it has begun to change to a run, or it runs
    since: float = -np.inf  # since then the trunk leans forward for a run, or rises after one [s]
    reference: float = 0.0  # speed wanted of a run, on its way to the wanted one [m/s]


class SpeedRoute:
    """Moves at a speed that a function of time gives.

    A step aims at the speed that is wanted when it will be over, and takes that of the family's
    gait at VLO for it. Beyond the family's range the target is beyond its end too, by as much; the
    planner takes the end.

    With more gaits than the walk, the speed chooses the gait: below 0.3 m/s (for l0 = 1 m) the
    robot stands, from ``changes.run`` on it runs. A change from a stand to a run, or back, leads
    through a walk.

    Args:
        parameters: the template.
        speed: a :class:`~.route.SpeedProfile`, or any function of time.
        duration: when the route ends [s]; None: it does not.
        gaits: those that it may have; the walk always.
        changes: of the gait, for the reference template.
        bears: whether feet bear the centre of pressure around them, as of
            :class:`~.scenario_route.ScenarioRoute`; no step closes them then.
    """

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        speed: SpeedAtTime,
        duration: Positive | None = None,
        gaits: Sequence[Gait] = ("walk",),
        changes: GaitChangeOptions | None = None,
        *,
        bears: bool = False,
    ) -> None:
        self.parameters, self._bears = parameters, bears
        self.gaits = frozenset((*gaits, "walk"))
        scale = Scale.of(parameters)
        self.changes = scaled(changes or GaitChangeOptions(), scale)
        self._slowest, self._near, self._first, self._last, self._stop = (
            speed * scale.speed for speed in (_SLOWEST, _NEAR, _FIRST, _LAST, _STOP)
        )
        self._take_off = self.changes.take_off
        self._slowest_hop = running_speeds(parameters, StrideKind.HOP)[0]
        self._least = self._first - self._near if self.changes.hop else -np.inf
        self._lean = _LEAN * scale.time
        self._slowest_run, fastest = running_speeds(parameters)
        self._fastest = min(fastest, self.changes.fastest)
        self._speed, self._duration = speed, duration
        self._family = walking_by_speed()
        low, high = self._family.range(parameters)
        self._range = low, high
        first = self._wanted(0.0)
        rest = STAND_HEIGHT / REFERENCE.rest_length * parameters.rest_length
        self._rest: Array = np.array([0.0, rest, 0.0])
        gait = self._gait(first, _Way(0.0, 0.0))
        self.section: Section = REST if gait == STAND else VLO
        if gait == "run":
            walk = gaits_by_speed(parameters).gait(self._take_off)
        else:
            walk = self._family.gait_for(parameters, min(max(first, low), high))
        self.start: Array = self._rest if gait == STAND else walk.state
        self.walking_speed = float(walk.state[0])
        self._guess = _FIRST_DURATION * float(np.sqrt(parameters.rest_length / parameters.gravity))
        self.reset()

    @property
    def endless(self) -> bool:
        """See :class:`~.route.Route`."""
        return self._duration is None

    def reset(self) -> None:
        """See :class:`~.route.Route`."""
        self._way = _Way(0.0, self._guess)

    def next(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.next`."""
        if now > self._way.began:
            # A stand or a change of gait says nothing about the next stride's duration.
            repeats = self._way.stride in _KEPT
            took = now - self._way.began if repeats else self._guess
            self._way = self._way._replace(took=took)
        self._way, goal = self._go(section, z, now)
        return goal

    def ahead(self, section: Section, z: Array, now: float) -> StrideGoal | None:
        """See :meth:`~.route.Route.ahead`."""
        return self._go(section, z, now)[1]

    def _go(self, section: Section, z: Array, now: float) -> tuple[_Way, StrideGoal | None]:
        if self._duration is not None and now >= self._duration:
            return self._way, None
        wanted = self._wanted(now + self._way.took)
        way, speed = self._way, float(z[0])
        if way.stride == StrideKind.RUN_TO_WALK:
            way = way._replace(runs=False, since=now)
        step = {REST: self._from_rest, VLO: self._from_vlo, APEX: self._from_apex}[section]
        way, goal = step(way, speed, wanted, now)
        return way._replace(began=now, stride=goal.stride), goal

    def _gait(self, wanted: float, way: _Way) -> Gait:
        """The gait of a mean speed [m/s]."""
        border = self.changes.run + self._later(way)
        if "run" in self.gaits and (wanted >= border or self._hops(wanted, way)):
            return "run"
        return STAND if STAND in self.gaits and wanted < self._slowest else "walk"

    def _later(self, way: _Way) -> float:
        """How far above its border a run begins, and below it ends [m/s]."""
        return 0.5 * self.changes.hysteresis * (-1.0 if way.runs else 1.0)

    def _hops(self, wanted: float, way: _Way) -> bool:
        """Whether a mean speed [m/s] is a hop's."""
        return self.changes.hop > 0.0 and wanted < self.changes.hop - self._later(way)

    def _from_rest(
        self, way: _Way, speed: float, wanted: float, now: float
    ) -> tuple[_Way, StrideGoal]:
        stopped = way.stride == StrideKind.WALK_TO_STAND
        if stopped and not self._bears:  # the last step of a walk is a long one
            return way, self._stand(StrideKind.STEP_FORWARD, StrideKind.STAND)
        if self._gait(wanted, way) == STAND:
            return way, self._stand(StrideKind.STAND, None)
        goal = self._walk(min(wanted, self._take_off))
        return way, replace(goal, stride=StrideKind.STAND_TO_WALK, then=goal.stride)

    def _from_vlo(
        self, way: _Way, speed: float, wanted: float, now: float
    ) -> tuple[_Way, StrideGoal]:
        gait = self._gait(wanted, way)
        if gait == "run":
            if not way.runs:
                way = way._replace(runs=True, since=now)
            if abs(speed - self._take_off) <= self._near and now - way.since >= self._lean:
                way = way._replace(reference=self._first)
                return way, self._run(StrideKind.WALK_TO_RUN, self._first)
            return way, self._to_take_off(StrideKind.WALK_PUSH_OFF, StrideKind.WALK_TO_RUN)
        if way.runs:  # the run is not wanted any more
            way = way._replace(runs=False, since=now)
        if gait == STAND and way.stride != StrideKind.WALK_PUSH_OFF:
            # No swing foot is on its way to a foothold yet: the first step keeps the speed.
            target = np.array([speed, self._rest[1], 0.0])
            return way, StrideGoal(StrideKind.WALK_PUSH_OFF, target, speed)
        if gait == STAND and speed <= self._stop and now - way.since >= self._lean:
            then = StrideKind.STAND if self._bears else StrideKind.STEP_FORWARD
            return way, self._stand(StrideKind.WALK_TO_STAND, then)
        return way, self._walk(wanted if gait == "walk" else self._range[0])

    def _from_apex(
        self, way: _Way, speed: float, wanted: float, now: float
    ) -> tuple[_Way, StrideGoal]:
        on = self._gait(wanted, way) == "run"
        if not on and self._least <= speed <= self._last:
            return way, self._to_take_off(StrideKind.RUN_TO_WALK, StrideKind.WALK_PUSH_OFF)
        least = self._slowest_hop if self._hops(wanted, way) else self._first
        aim = min(max(wanted, least), self._fastest) if on else self._first
        most = self.changes.acceleration * way.took
        way = way._replace(reference=min(max(aim, way.reference - most), way.reference + most))
        hops = way.reference < self._slowest_run
        goal = self._run(StrideKind.HOP if hops else StrideKind.RUN, way.reference)
        return way, replace(goal, then=None if on else StrideKind.RUN_TO_WALK)

    def _stand(self, stride: str, then: str | None) -> StrideGoal:
        """A stride to a stand."""
        return StrideGoal(stride, self._rest, 0.0, then=then)

    def _to_take_off(self, stride: str, then: str) -> StrideGoal:
        """A stride to the VLO where a run begins or ends."""
        height = self._family.vlo_for(self.parameters, self._take_off)[1]
        target = np.array([self._take_off, height, 0.0])
        return StrideGoal(stride, target, self._take_off, then=then)

    def _walk(self, wanted: float) -> StrideGoal:
        """A walking step at a mean speed [m/s]."""
        speed, height = self._family.vlo_for(self.parameters, wanted)
        beyond = wanted - min(max(wanted, self._range[0]), self._range[1])
        target = np.array([speed + beyond, height, 0.0])
        return StrideGoal(StrideKind.WALK_PUSH_OFF, target, wanted)

    def _run(self, stride: str, speed: float) -> StrideGoal:
        """A stride to an apex with a speed [m/s]."""
        p = self.parameters
        height = suited_height(speed / p.speed_unit) * p.rest_length
        return StrideGoal(stride, np.array([speed, height]), speed, then=StrideKind.RUN)

    def _wanted(self, time: float) -> float:
        """The wanted mean speed [m/s]; a ScenarioError if the function does not say one."""
        kind = float if self.changes.hop else NotNegative
        found = check(f"the wanted speed at {time:g} s", self._speed(time), kind, ScenarioError)
        return float(found)
