"""Time and error of one SLIP step by method, of its Jacobian and of one controller solve.

Run: python benchmarks/slip_step.py [--json]

The methods of a step take turns, so that a busy machine slows all alike. DOP853 and heyoka
interpret the library's automaton too, from Python, and integrate the equations of motion as
written here; errors are the worst against DOP853 at 1e-13, in SI units. The spread is from
quartile to quartile; where it is above 10 % the machine was busy.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Column, Table
from scipy.integrate import solve_ivp

from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Edge, Node
from template_control.slip.automaton.vocabulary import MapKind, Outcome
from template_control.slip.control import controllers
from template_control.slip.dynamics.guards import guard
from template_control.slip.dynamics.kernel import apply_reset
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import gait_at
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import section_of
from template_control.slip.parameters import SlipParameters

try:
    import heyoka
except ImportError:
    heyoka = None

Array = NDArray[np.float64]
Flow = Callable[[Node, Array, Array, Array], tuple[float, Array, Edge]]
Row = dict[str, Any]

_P = SlipParameters()
_M, _G, _L0 = _P.mass, _P.gravity, _P.rest_length
_MAPS = (MapKind.GEYER, MapKind.PAPER, MapKind.IMPROVED, MapKind.EXACT)
_APEX, _CHANGE_APEX = np.array([3.0, 0.98]), np.array([2.0, 0.98])  # of a run, of transitions
_SAMPLE, _SOME, _FEW = 2000, 200, 20  # states
_SOLVES, _ROUNDS, _REPETITIONS = 50, 5, 25
_LIMIT = 5.0  # [s] of a phase
_TOLERANCE = 1e-10  # of DOP853 and heyoka, where they are timed


class Case(NamedTuple):
    """A stride, the states (n, m) it starts from and its controls (NUM_SLOTS,)."""

    stride: str
    states: Array
    controls: Array


Passages = tuple[Array, Array]
"""Strides' event times (n, events) [s]; distance covered [m] and state at the end (n, 1 + m)."""


def _rates(state: Any, toes: Any, stiffness: Any) -> tuple[Any, ...]:
    """Equations of motion on the legs that stand, for numbers and heyoka's expressions."""
    ax, ay = 0.0 * state[0], 0.0 * state[0] - _G
    for leg in range(len(toes)):
        dx, dy = state[0] - toes[leg], state[1]
        length = np.sqrt(dx * dx + dy * dy)
        force = stiffness[leg] * (_L0 - length) / (_M * length)
        ax, ay = ax + force * dx, ay + force * dy
    return state[2], state[3], ax, ay


_compiled_rates = njit(_rates)


def _standing(node: Node) -> tuple[list[int], list[int]]:
    """Legs on the ground and the slots of their stiffness."""
    legs = [(leg, slot) for leg, slot in enumerate((node.rear, node.front)) if slot is not None]
    return [leg for leg, _ in legs], [int(slot) for _, slot in legs]


def dop853(tolerance: float) -> Flow:
    """Phases by scipy, each edge of the node a terminal event."""

    def flow(node: Node, state: Array, toes: Array, u: Array) -> tuple[float, Array, Edge]:
        legs, slots = _standing(node)
        feet, stiffness, height = toes[legs], u[slots], _L0 * np.sin(u[0])

        def event(edge: Edge) -> Any:
            def value(_: float, s: Array) -> Any:
                return guard(int(edge.event), s, toes, _L0, height)

            value.terminal, value.direction = True, 1.0  # type: ignore[attr-defined]
            return value

        def rates(_: float, s: Array) -> Any:
            return _compiled_rates(s, feet, stiffness)

        events, accuracy = [event(e) for e in node.edges], {"rtol": tolerance, "atol": tolerance}
        solution = solve_ivp(rates, (0.0, _LIMIT), state, "DOP853", events=events, **accuracy)
        fired = next(i for i, times in enumerate(solution.t_events) if times.size)
        return solution.t[-1], solution.y[:, -1].copy(), node.edges[fired]

    return flow


def _symbolic(function: Any) -> Callable[..., Any]:
    """The same formula for heyoka's expressions, which numpy's functions do not take."""
    return FunctionType(function.__code__, {**function.__globals__, "np": heyoka})


def _taylor(node: Node) -> Any:
    """heyoka's integrator of one phase; its parameters are toes, stiffnesses, height."""
    par, state = heyoka.par, heyoka.make_vars("x", "y", "u", "v")
    legs, _ = _standing(node)
    rates = _symbolic(_rates)(state, [par[leg] for leg in legs], [par[2 + leg] for leg in legs])
    value = _symbolic(guard.py_func)
    guards = [value(int(e.event), state, [par[0], par[1]], _L0, par[4]) for e in node.edges]
    events = [heyoka.t_event(g, direction=heyoka.event_direction.positive) for g in guards]
    system = list(zip(state, rates, strict=True))
    return heyoka.taylor_adaptive(system, [0.0, 1.0, 1.0, 0.0], tol=_TOLERANCE, t_events=events)


def taylor(stride: str, spent: list[float]) -> Flow:
    """Phases by heyoka, one integrator a node, compiled here.

    Each phase adds to ``spent`` the seconds of heyoka's own call, without Python around it.
    """
    integrators = {node.name: _taylor(node) for node in AUTOMATON.stride(STRIDE_START[stride])}

    def flow(node: Node, state: Array, toes: Array, u: Array) -> tuple[float, Array, Edge]:
        ta, parameters = integrators[node.name], np.zeros(5)
        legs, slots = _standing(node)
        parameters[:2], parameters[4] = toes, _L0 * np.sin(u[0])
        parameters[[2 + leg for leg in legs]] = u[slots]
        ta.time, ta.state[:], ta.pars[:] = 0.0, state, parameters[: len(ta.pars)]
        ta.reset_cooldowns()
        start = time.perf_counter()
        outcome = int(ta.propagate_until(_LIMIT)[0])  # -1, -2, ...: the terminal event
        spent.append(time.perf_counter() - start)
        return ta.time, ta.state.copy(), node.edges[-outcome - 1]

    return flow


def _stride(flow: Flow, case: Case, z: Array) -> Passages:
    node = AUTOMATON.node(STRIDE_START[case.stride])
    begin, end = (section_of(event) for event in AUTOMATON.sections(node.name))
    state, toes, durations = begin.state(z), np.zeros(2), []
    while True:
        duration, state, edge = flow(node, state, toes, case.controls)
        durations.append(duration)
        apply_reset(int(edge.reset), state, toes, _L0, case.controls[0])
        successor = AUTOMATON.successor(node.name, edge.event)
        if edge.section:
            return np.cumsum(durations), np.append(state[0], end.of(state))
        node = AUTOMATON.node(successor)


def drive(flow: Flow, case: Case, states: Array) -> Passages:
    """Strides through the automaton's nodes by ``flow``; KeyError where one fails."""
    times, ends = zip(*(_stride(flow, case, z) for z in states), strict=True)
    return np.array(times), np.array(ends)


def mapped(kind: MapKind, case: Case, states: Array) -> Passages:
    """Strides by a return map; only the exact one's simulation tells event times."""
    result = ReturnMap(_P, case.stride, kind)(states, case.controls)
    ends = np.column_stack((result.advance, result.state))
    if kind is not MapKind.EXACT:
        return np.empty(0), ends
    start = STRIDE_START[case.stride]
    begin = section_of(AUTOMATON.sections(start)[0])
    strides = [simulate_stride(_P, start, begin.state(z), case.controls) for z in states]
    return np.array([[e.time for e in stride.events] for stride in strides]), ends


def errors(found: Passages, truth: Passages) -> Row:
    """Worst errors of state (distance included) [m, m/s] and event times [s]."""
    state = np.max(np.abs(found[1] - truth[1]))
    times = np.max(np.abs(found[0] - truth[0])) if found[0].size else None
    return {"state error": state, "time error": times}


def take_turns(methods: dict[str, tuple[int, Callable[[], object]]]) -> dict[str, Array]:
    """Microseconds a state by every method (_REPETITIONS,)."""
    samples: dict[str, list[float]] = {name: [] for name in methods}
    for _ in range(1 + _REPETITIONS):
        for name, (count, method) in methods.items():
            start = time.perf_counter()
            method()
            samples[name].append(1e6 * (time.perf_counter() - start) / count)
    return {name: np.array(sample[1:]) for name, sample in samples.items()}  # the first compiles


def _summary(us: Array, exact: Array) -> Row:
    """Median and spread; the ratio is taken turn by turn, as the machine's load varies."""
    low, median, high = np.percentile(us, [25, 50, 75])
    ratio = np.median(us / exact)
    return {"us": median, "spread %": 1e2 * (high / low - 1.0), "over EXACT": ratio}


def measure_steps(case: Case) -> dict[str, Row]:
    """Time and errors of one stride by every method, and time of the maps' Jacobians."""
    states, u = case.states, case.controls
    few, some, tiled = states[:_FEW], states[:_SOME], np.tile(u, (len(states), 1))
    steps = {kind.name: ReturnMap(_P, case.stride, kind) for kind in _MAPS}
    found = {kind.name: mapped(kind, case, few) for kind in _MAPS}
    methods: dict[str, tuple[int, Callable[[], object]]] = {
        name: (len(states), partial(step, states, tiled)) for name, step in steps.items()
    }
    flows = [("DOP853", dop853(_TOLERANCE), few)]
    spent: list[float] = []
    if heyoka is not None:
        flows.append(("heyoka", taylor(case.stride, spent), some))
    for name, flow, sample in flows:
        methods[name] = len(sample), partial(drive, flow, case, sample)
        found[name] = drive(flow, case, few)
    for name, step in steps.items():
        jacobians = partial(lambda f: [f(z, u) for z in some], step.linearise)
        methods[f"{name} Jacobian"] = len(some), jacobians
    truth = drive(dop853(1e-13), case, few)
    spent.clear()
    samples = take_turns(methods)
    if spent:
        turns = np.sum(np.reshape(spent, (1 + _REPETITIONS, -1)), axis=1)[1:]
        samples["heyoka's own call"] = 1e6 * turns / len(some)
    rows = {name: _summary(us, samples["EXACT"]) for name, us in samples.items()}
    for name, passages in found.items():
        rows[name] |= errors(passages, truth)
    return rows if heyoka is not None else rows | {"no heyoka: pip install -e '.[bench]'": {}}


def measure_controller(make: Any, states: Array, target: Array) -> dict[str, Row]:
    """Milliseconds of a solve on each map and its residual, without a guess and with the last."""
    rows: dict[str, Row] = {}
    for kind in (MapKind.EXACT, MapKind.IMPROVED, MapKind.PAPER):
        solver, row = make(_P, kind), {}
        first = solver.solve(states.mean(axis=0), target)  # compiles
        for begin in ("cold", "warm"):
            times, residuals, last = [], [], first
            for z in np.tile(states, (_ROUNDS, 1)):
                start = time.perf_counter()
                last = solver.solve(z, target, last.controls if begin == "warm" else None)
                times.append(1e3 * (time.perf_counter() - start))
                residuals.append(last.residual)
            row[f"{begin} ms"], row[f"{begin} p99 ms"] = np.percentile(times, [50, 99])
            row[f"{begin} residual"] = np.median(residuals)
        rows[f"{make.__name__} {kind.name}"] = row
    return rows


def measure() -> dict[str, dict[str, Row]]:
    """Rows by their name, by title of their table."""
    random = np.random.default_rng(0)
    gait = gait_at(_P, np.radians(66.0), 1.1)
    running = controllers.ActiveRunning(_P).solve(_APEX, _APEX).controls

    def around(centre: Array, widths: list[float], count: int = _SOLVES) -> Array:
        return centre + random.uniform(-1.0, 1.0, (count, len(centre))) * widths

    def case(stride: str, centre: Array, widths: list[float], u: Array) -> Case:
        states = around(centre, widths, 2 * _SAMPLE)
        valid = ReturnMap(_P, stride)(states, u).outcome == Outcome.SECTION
        return Case(stride, states[valid][:_SAMPLE], u)

    walks = case("w", gait.vlo, [0.1, 0.008, 0.05], gait.controls)
    runs = case("r", _APEX, [0.3, 0.02], running)
    vlo, apex = around(gait.vlo, [0.05, 0.005, 0.05]), around(_APEX, [0.3, 0.02])
    change = around(_CHANGE_APEX, [0.1, 0.01])
    solves = (
        measure_controller(controllers.ActiveRunning, apex, _APEX),
        measure_controller(controllers.ActiveWalking, vlo, gait.vlo),
        measure_controller(controllers.ModifiedWalking, vlo, gait.vlo),
        measure_controller(controllers.WalkToRun, vlo, _CHANGE_APEX),
        measure_controller(controllers.RunToWalk, change, gait.vlo),
    )
    return {
        "walking step, VLO to VLO": measure_steps(walks),
        "running step, apex to apex": measure_steps(runs),
        "one solve of a controller": {name: row for rows in solves for name, row in rows.items()},
    }


def main() -> None:
    """Print the tables, or one JSON object."""
    parser = argparse.ArgumentParser(description="Time one SLIP step and one controller solve.")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    as_json = parser.parse_args().json
    tables = measure()
    if as_json:
        print(json.dumps(tables, default=float))
        return
    for title, rows in tables.items():
        keys = list(next(iter(rows.values())))
        columns = (Column(key, justify="right") for key in keys)
        table = Table(Column("", no_wrap=True), *columns, title=title)
        for name, row in rows.items():
            values = (row.get(key) for key in keys)
            table.add_row(name, *("-" if v is None else f"{v:.4g}" for v in values))
        Console(markup=False, width=100).print(table)


if __name__ == "__main__":
    main()
