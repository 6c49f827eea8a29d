"""Simulate a scenario: controllers on the chosen map, the template on the exact model."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from template_control.errors import ScenarioError
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event, Slot
from template_control.slip.control.controllers import (
    ActiveRunning,
    ActiveWalking,
    Controller,
    ModifiedWalking,
    RunToWalk,
    WalkToRun,
)
from template_control.slip.control.step_solver import StepSolution
from template_control.slip.dynamics.stride import Stride, StrideSimulator, controls
from template_control.slip.maps.section import VLO, section_of
from template_control.slip.scenario.record import ScenarioRecord
from template_control.slip.scenario.scenario import Scenario, Segment

Array = NDArray[np.float64]

_SAMPLES = 40  # a stride
_STRIDES = ("w", "wr", "r", "rw")
_FIRST_DURATION = 1.6  # of sqrt(l0/g): guess of a stride's duration before one was made
_LIMIT = 10_000


@dataclass
class _Profile:
    """Where in the scenario the template is."""

    segments: tuple[Segment, ...]
    index: int = 0
    began: float = 0.0
    speed: float = 0.0
    strides: int = 0

    @property
    def segment(self) -> Segment:
        return self.segments[self.index]

    def wanted(self, now: float) -> float:
        """The profile's speed; it stops rising at ``until_speed``."""
        s = self.segment
        value = self.speed + s.acceleration * (now - self.began)
        if s.until_speed is not None and s.acceleration > 0.0:
            return min(value, s.until_speed)
        return max(value, 0.0)

    def over(self, now: float, speed: float) -> bool:
        """Whether the present segment ends at a section at ``now`` with this speed."""
        s = self.segment
        if s.duration is not None and now - self.began >= s.duration:
            return True
        if s.steps is not None and self.strides >= s.steps:
            return True
        if s.until_speed is None:
            return False
        wanted = self.speed + s.acceleration * (now - self.began)
        if s.acceleration > 0.0:
            return wanted >= s.until_speed
        return wanted <= s.until_speed and speed < s.until_speed

    def advance(self, now: float, speed: float) -> bool:
        """Go to the segment that holds at ``now``; False past the last."""
        while self.over(now, speed):
            wanted = self.wanted(now)
            if self.index + 1 == len(self.segments):
                return False
            self.index += 1
            self.began, self.strides = now, 0
            self.speed = wanted if self.segment.speed is None else self.segment.speed
        return True


@dataclass
class _Log:
    """Lists that become the record's arrays."""

    samples: list[Array] = field(default_factory=list)
    footholds: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])
    strides: list[int] = field(default_factory=list)
    sections: list[tuple[float, Array]] = field(default_factory=list)
    wanted: list[float] = field(default_factory=list)
    targets: list[Array] = field(default_factory=list)
    solutions: list[StepSolution] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def simulate_scenario(
    scenario: Scenario, progress: Callable[[float], None] | None = None
) -> ScenarioRecord:
    """Go through a scenario; a failed stride ends it, is recorded and raises nothing.

    Args:
        scenario: the profile and the controllers' map.
        progress: called with the simulated time [s] after each stride.

    Raises:
        ScenarioError: if a target of the profile is beyond any stride.
    """
    p = scenario.parameters
    workers = _controllers(scenario)
    guesses: dict[str, Array] = {}
    k0 = p.leg_stiffness
    guesses["w"] = controls(np.radians(scenario.touchdown_angle), k0, k0)
    duration = dict.fromkeys(_STRIDES, _FIRST_DURATION * np.sqrt(p.rest_length / p.gravity))
    profile = _Profile(scenario.segments, speed=scenario.segments[0].speed or 0.0)
    log = _Log()
    state, now, section, failure = VLO.state(scenario.start), 0.0, VLO, ""
    simulator = StrideSimulator(p)
    walking_target = np.array([profile.speed, *scenario.vlo])
    log.sections.append((now, VLO.of(state)))
    while profile.advance(now, float(state[2])) and len(log.strides) < _LIMIT:
        runs = profile.segment.gait == "run"
        kind = ("wr" if runs else "w") if section is VLO else ("r" if runs else "rw")
        speed = profile.wanted(now if kind in ("wr", "rw") else now + duration[kind])
        target = np.array([speed, scenario.apex_height] if runs else [speed, *scenario.vlo])
        z = section.of(state)
        begin = time.perf_counter()
        try:
            if kind == "wr":
                # The rear leg walks on: its controls are the walking controller's.
                walk = workers["w"].solve(z, walking_target, guesses["w"])
                guesses[kind] = walk.controls
            solution = workers[kind].solve(z, target, guesses.get(kind))
        except ValueError as error:
            raise ScenarioError(f"segment {profile.index + 1} at {now:.2f} s: {error}") from None
        log.seconds.append(time.perf_counter() - begin)
        guesses[kind] = solution.controls
        if kind == "w":
            walking_target = target
        toe = float(state[0])
        stride = simulator.run(STRIDE_START[kind], state, solution.controls, (toe, toe))
        _note(log, kind, stride, now, speed, target, solution, p.rest_length)
        now += stride.duration
        if kind in ("wr", "rw"):
            profile.began = now  # the transition leads to where the segment's profile begins
        else:
            profile.strides += 1
        state = stride.state
        duration[kind] = stride.duration
        log.sections.append((now, VLO.of(state)))
        if progress is not None:
            progress(now)
        if not stride.completed:
            failure = f"stride {len(log.strides)} ({kind}): {stride.outcome.reason}"
            break
        section = section_of(AUTOMATON.sections(STRIDE_START[kind])[1])
    return _record(scenario, log, failure)


def _controllers(scenario: Scenario) -> dict[str, Controller]:
    p, kind = scenario.parameters, scenario.map_kind
    walking = ModifiedWalking if scenario.walking == "modified" else ActiveWalking
    return {
        "w": walking(p, kind),
        "wr": WalkToRun(p, kind),
        "r": ActiveRunning(p, kind),
        "rw": RunToWalk(p, kind),
    }


def _padded(values: Array) -> Array:
    return np.concatenate((values, np.zeros(3 - len(values))))


def _note(
    log: _Log,
    kind: str,
    stride: Stride,
    now: float,
    speed: float,
    target: Array,
    solution: StepSolution,
    rest_length: float,
) -> None:
    """Append a stride to the log."""
    times = np.linspace(0.0, stride.duration, _SAMPLES, endpoint=False)
    row = np.clip(np.searchsorted(stride.meta[:, 0], times, side="right") - 1, 0, None)
    log.samples.append(
        np.column_stack(
            (now + times, stride.sample(times)[:, :4], stride.meta[row][:, [2, 3, 4, 5, 6]])
        )
    )
    reach = rest_length * np.cos(solution.controls[Slot.TOUCHDOWN_ANGLE])
    log.footholds += [
        (now + e.time, float(e.state[0] + reach))
        for e in stride.events
        if e.event is Event.TOUCHDOWN
    ]
    log.strides.append(_STRIDES.index(kind))
    log.wanted.append(speed)
    log.targets.append(_padded(target))
    log.solutions.append(solution)


def _record(scenario: Scenario, log: _Log, failure: str) -> ScenarioRecord:
    table = np.concatenate(log.samples) if log.samples else np.empty((0, 10))
    count = len(log.strides)
    metadata = {
        "name": scenario.name,
        "map": scenario.map_kind.name.lower(),
        "walking": scenario.walking,
        "parameters": asdict(scenario.parameters),
        "segments": [asdict(s) for s in scenario.segments],
        "nodes": [node.name for node in AUTOMATON.nodes],
        "phases": [node.phase.name for node in AUTOMATON.nodes],
        "strides": list(_STRIDES),
        "failure": failure,
    }
    return ScenarioRecord(
        time=table[:, 0],
        state=table[:, 1:5],
        node=table[:, 5].astype(np.int64),
        toes=table[:, 6:8],
        stiffness=table[:, 8:10],
        foothold=np.array(log.footholds),
        stride=np.array(log.strides, dtype=np.int64),
        section_time=np.array([t for t, _ in log.sections]),
        section_state=np.array([z for _, z in log.sections]),
        wanted_speed=np.array(log.wanted),
        target=np.array(log.targets).reshape(count, 3),
        predicted=np.array([_padded(s.predicted) for s in log.solutions]).reshape(count, 3),
        controls=np.array([s.controls for s in log.solutions]).reshape(count, -1),
        residual=np.array([s.residual for s in log.solutions]),
        reached=np.array([s.reached for s in log.solutions], dtype=bool),
        solve_seconds=np.array(log.seconds),
        metadata=metadata,
    )
