"""Simulation of a scenario: controllers on the chosen map, the template on the exact model."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np

from template_control import storage
from template_control.arrays import Array, BoolArray, IntArray
from template_control.checks.checked import checked
from template_control.errors import ScenarioError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event, Slot, StrideKind
from template_control.slip.control.controllers import (
    ActiveRunning,
    ActiveWalking,
    Controller,
    ModifiedWalking,
    RunToWalk,
    StepSolution,
    WalkToRun,
)
from template_control.slip.dynamics.stride import Stride, StrideSimulator, controls
from template_control.slip.maps.section import PADDED, VLO, section_of
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.scenario.scenario import MOST_STRIDES, Scenario
from template_control.slip.scenario.scenario_route import ScenarioRoute

FORMAT = "template-control scenario 2"
_METADATA: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("name", "map", "failure"), (str,)),
    **dict.fromkeys(("nodes", "phases", "strides"), (list,)),
    "parameters": (dict,),
}


@dataclass(frozen=True)
class ScenarioRecord:
    """A simulated scenario; T samples, S strides, F footholds; SI units, y up.

    Each field's annotation has its axes as of :func:`~template_control.storage.load`.

    Attributes:
        time: (T,) [s].
        state: (T, 4) x, y, dx/dt, dy/dt of the CoM on the exact model.
        node: (T,) index into ``metadata["nodes"]``.
        toes: (T, 2) x of rear and front toe.
        stiffness: (T, 2) of rear and front leg, 0 in the air [N/m].
        foothold: (F, 2) time and x of each touchdown, the first stance's included.
        stride: (S,) index into ``metadata["strides"]`` of the kind of stride.
        section_time: (S + 1,) of the section each stride starts from, and of the last.
        section_state: (S + 1, 3) dx/dt, y, dy/dt there.
        wanted_speed: (S,) the profile's speed that the stride aimed at.
        target: (S, 3) state aimed at.
        predicted: (S, 3) state the controller's map expected.
        controls: (S, NUM_SLOTS) u.
        residual: (S,) of the controller's optimisation.
        reached: (S,) whether it met its target.
        solve_seconds: (S,) wall-clock time of each controller.
        metadata: scenario, names of nodes and strides, how it ended.
    """

    time: Annotated[Array, "T"]
    state: Annotated[Array, "T 4"]
    node: Annotated[IntArray, "T <nodes"]
    toes: Annotated[Array, "T 2"]
    stiffness: Annotated[Array, "T 2"]
    foothold: Annotated[Array, "F 2"]
    stride: Annotated[IntArray, "S <strides"]
    section_time: Annotated[Array, "S+1"]
    section_state: Annotated[Array, "S+1 3"]
    wanted_speed: Annotated[Array, "S"]
    target: Annotated[Array, "S 3"]
    predicted: Annotated[Array, "S 3"]
    controls: Annotated[Array, "S 6"]
    residual: Annotated[Array, "S"]
    reached: Annotated[BoolArray, "S"]
    solve_seconds: Annotated[Array, "S"]
    metadata: dict[str, Any]

    def __repr__(self) -> str:
        end = "completed" if self.completed else f"ended: {self.metadata['failure']}"
        return (
            f"<ScenarioRecord of {self.metadata['name']}: {len(self.stride)} strides in"
            f" {self.time[-1]:.2f} s, {len(self.time)} samples, {end}>"
        )

    @property
    def completed(self) -> bool:
        """True if every segment was gone through."""
        return not self.metadata["failure"]

    @property
    def strides(self) -> list[str]:
        """Kind of each stride, a key of ``STRIDE_START``."""
        return [self.metadata["strides"][i] for i in self.stride]

    def during(self, stride: int) -> slice:
        """Samples of a stride."""
        begin, end = np.searchsorted(self.time, self.section_time[stride : stride + 2])
        return slice(int(begin), int(end))

    def energies(self) -> dict[str, Array]:
        """``forward`` and ``vertical`` kinetic, ``gravity``, ``spring``, ``total`` (T,) [J]."""
        p = self.metadata["parameters"]
        x, y, u, v = self.state.T
        length = np.hypot(x[:, None] - self.toes, y[:, None])
        spring = 0.5 * np.sum(self.stiffness * (p["rest_length"] - length) ** 2, axis=1)
        parts = {
            "forward": 0.5 * p["mass"] * u**2,
            "vertical": 0.5 * p["mass"] * v**2,
            "gravity": p["mass"] * p["gravity"] * y,
            "spring": spring,
        }
        return {**parts, "total": np.sum(list(parts.values()), axis=0)}

    def energy_phase(self, stride: int) -> float:
        """Correlation of forward kinetic and gravitational energy over a stride.

        Near -1 they are out of phase, as in walking; near +1 in phase, as in running. The
        straight line between a stride's ends is taken off first: it is acceleration.
        """
        w = self.during(stride)
        e = self.energies()
        share = np.linspace(0.0, 1.0, w.stop - w.start)
        forward, gravity = (
            x - x[0] - share * (x[-1] - x[0]) for x in (e["forward"][w], e["gravity"][w])
        )
        return float(np.corrcoef(forward, gravity)[0, 1])

    @checked
    def save(self, path: str | Path) -> Path:
        """Write it; see :func:`~template_control.storage.save`."""
        return storage.save(self, path, FORMAT)

    @classmethod
    @checked
    def load(cls, path: str | Path) -> ScenarioRecord:
        """Read it; see :func:`~template_control.storage.load`."""
        hints = get_type_hints(cls, include_extras=True)
        sizes = {name: get_args(hint)[1] for name, hint in hints.items() if name != "metadata"}
        return storage.load(cls, path, FORMAT, sizes, _METADATA)


_SAMPLES = 40  # a stride
_STRIDES = (StrideKind.WALK, StrideKind.WALK_TO_RUN, StrideKind.RUN, StrideKind.RUN_TO_WALK)


class _Made(NamedTuple):
    """A stride that was made, and when it began [s]."""

    began: float
    goal: StrideGoal
    solution: StepSolution
    solve_seconds: float
    stride: Stride

    @property
    def ended(self) -> float:
        """When its section was reached [s]."""
        return self.began + self.stride.duration

    def samples(self) -> Array:
        """(_SAMPLES, 10) time, state, node, toes, stiffnesses."""
        times = np.linspace(0.0, self.stride.duration, _SAMPLES, endpoint=False)
        state, meta = self.stride.sample(times)[:, :4], self.stride.meta[self.stride.rows(times)]
        return np.column_stack((self.began + times, state, meta[:, [2, 3, 4, 5, 6]]))

    def footholds(self, rest_length: float) -> list[tuple[float, float]]:
        """Time and x of each touchdown."""
        reach = rest_length * np.cos(self.solution.controls[Slot.TOUCHDOWN_ANGLE])
        landed = (e for e in self.stride.events if e.event is Event.TOUCHDOWN)
        return [(self.began + e.time, float(e.state[0] + reach)) for e in landed]


class _Controllers:
    """A controller for each kind of stride; each search begins at the controls found last."""

    def __init__(self, scenario: Scenario) -> None:
        p, kind = scenario.parameters, scenario.map_kind
        walking = ModifiedWalking if scenario.walking == "modified" else ActiveWalking
        made = (walking, WalkToRun, ActiveRunning, RunToWalk)
        self._by_stride: dict[str, Controller] = {c.design.stride: c(p, kind) for c in made}
        k0 = p.leg_stiffness
        first = controls(np.radians(scenario.touchdown_angle), k0, k0)
        self._guesses: dict[str, Array] = {StrideKind.WALK: first}
        self._walking_target = np.array([scenario.segments[0].speed or 0.0, *scenario.vlo])

    def solve(self, z: Array, goal: StrideGoal) -> StepSolution:
        """Controls of the stride from section state ``z`` (n,) that ``goal`` asks for."""
        if goal.stride == StrideKind.WALK_TO_RUN:
            # The rear leg walks on: its controls are the walking controller's.
            walk = self._search(StrideKind.WALK, z, self._walking_target)
            self._guesses[StrideKind.WALK_TO_RUN] = walk.controls
        elif goal.stride == StrideKind.WALK:
            self._walking_target = goal.target
        solution = self._search(goal.stride, z, goal.target)
        self._guesses[goal.stride] = solution.controls
        return solution

    def _search(self, stride: str, z: Array, target: Array) -> StepSolution:
        return self._by_stride[stride].solve(z, target, self._guesses.get(stride))


@checked
def simulate_scenario(
    scenario: Scenario, progress: Callable[[float], None] | None = None
) -> ScenarioRecord:
    """Go through a scenario; a failed stride ends it, is recorded and raises nothing.

    The template cannot stand: stands are left out, and the walk after one begins in its gait.

    Args:
        scenario: the profile and the controllers' map.
        progress: called with the simulated time [s] after each stride.

    Raises:
        ScenarioError: if a target of the profile is beyond any stride, or no segment moves.
    """
    moving = scenario.in_motion()
    if moving is None:
        raise ScenarioError("the template cannot stand: give the scenario a segment that walks")
    route, controllers = ScenarioRoute(moving), _Controllers(moving)
    simulator = StrideSimulator(moving.parameters)
    section, z = route.section, route.start
    first = state = section.state(z)
    made: list[_Made] = []
    now, failure = 0.0, ""
    while not failure and (goal := route.next(section, z, now)) is not None:
        if len(made) == MOST_STRIDES:
            failure = f"stopped in segment {goal.segment + 1}, after {MOST_STRIDES} strides"
            break
        begin = time.perf_counter()
        try:
            solution = controllers.solve(z, goal)
        except ValueError as error:
            raise ScenarioError(f"segment {goal.segment + 1} at {now:.2f} s: {error}") from None
        seconds = time.perf_counter() - begin
        toe = float(state[0])
        start = AUTOMATON.start(goal.stride).name
        stride = simulator.run(start, state, solution.controls, (toe, toe))
        made.append(_Made(now, goal, solution, seconds, stride))
        route.took(stride.duration)
        now, state = made[-1].ended, stride.state
        if progress is not None:
            progress(now)
        if not stride.completed:
            failure = f"stride {len(made)} ({goal.stride}): {stride.outcome.reason}"
        section = section_of(AUTOMATON.sections(start)[1])
        z = section.of(state)
    return _record(moving, first, made, failure)


def _padded(states: list[Array]) -> Array:
    """(S, 3) states at VLO or apex, where dy/dt is 0."""
    return np.array([[*z, 0.0][:PADDED] for z in states])


def _record(scenario: Scenario, first: Array, made: list[_Made], failure: str) -> ScenarioRecord:
    """The record of strides from the CoM's state ``first`` (4,) on."""
    table, length = np.concatenate([m.samples() for m in made]), scenario.parameters.rest_length
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
        foothold=np.array([(0.0, 0.0), *(at for m in made for at in m.footholds(length))]),
        stride=np.array([_STRIDES.index(m.goal.stride) for m in made]),
        section_time=np.array([0.0, *(m.ended for m in made)]),
        # At an apex, too, dy/dt is kept as it was found.
        section_state=np.array(
            [VLO.of(state) for state in (first, *(m.stride.state for m in made))]
        ),
        wanted_speed=np.array([m.goal.wanted_speed for m in made]),
        target=_padded([m.goal.target for m in made]),
        predicted=_padded([m.solution.predicted for m in made]),
        controls=np.array([m.solution.controls for m in made]),
        residual=np.array([m.solution.residual for m in made]),
        reached=np.array([m.solution.reached for m in made]),
        solve_seconds=np.array([m.solve_seconds for m in made]),
        metadata=metadata,
    )
