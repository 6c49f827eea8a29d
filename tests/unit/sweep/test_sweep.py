"""Sweeps: order, seeds, failures, bad input, and the runs they are made of."""

import math
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_work import P, drawn, fragile, other, quietly, square, walking_step

from template_control.embedding.planners.lqr import LqrPlanner
from template_control.errors import SweepError
from template_control.robot.library import load_robot
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.slip.automaton.vocabulary import MapKind, Outcome
from template_control.slip.gaits.gait import gait_at
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import Segment, example_one
from template_control.storage import to_jsonable
from template_control.sweep.sweep import SweepOptions, grid, item_seed, sample, sweep


def short_scenario(speed, kind):
    scenario = replace(
        example_one(MapKind[kind]), segments=(Segment("walk", speed=speed, steps=3),)
    )
    record = simulate_scenario(scenario)
    return {"completed": record.completed, "speed": record.section_state[-1, 0]}


def robot_run(speed):
    gait = gait_at(P, np.radians(66.0), speed)
    record = simulate(Experiment(load_robot("five-link"), planner=LqrPlanner(gait), steps=2))
    return {"fell": record.fell, "steps": record.steps, "distance": record.com[-1, 0]}


def test_grid_is_the_product_last_axis_fastest():
    assert grid(a=[1, 2], b=["x", "y"]) == [
        {"a": 1, "b": "x"},
        {"a": 1, "b": "y"},
        {"a": 2, "b": "x"},
        {"a": 2, "b": "y"},
    ]
    assert [type(item["v"]) for item in grid(v=np.linspace(0.0, 1.0, 2))] == [float, float]
    for axis in ("walk", 3.0):
        with pytest.raises(SweepError, match=r"axis gait is .* give a list"):
            grid(gait=axis)


def test_samples_are_uniform_seeded_and_grow():
    items = sample(4000, 5, speed=(0.5, 1.5), angle=(-70.0, -60.0))
    speed, angle = np.array([[i["speed"], i["angle"]] for i in items]).T
    assert speed.min() >= 0.5
    assert speed.max() <= 1.5
    assert np.mean(speed) == pytest.approx(1.0, abs=0.02)
    assert np.var(angle) == pytest.approx(100.0 / 12.0, rel=0.05)
    assert abs(np.corrcoef(speed, angle)[0, 1]) < 0.05
    assert sample(10, 5, speed=(0.5, 1.5), angle=(-70.0, -60.0)) == items[:10]
    assert sample(10, 6, speed=(0.5, 1.5), angle=(-70.0, -60.0)) != items[:10]
    for bounds in ((1.0, 0.0), (0.0, math.inf), 3.0):
        with pytest.raises(SweepError, match=r"range speed is .* give"):
            sample(3, 0, speed=bounds)


@settings(max_examples=25, deadline=None)
@given(
    xs=st.lists(st.integers(0, 50), max_size=30),
    seed=st.integers(0, 2**40),
    in_flight=st.integers(1, 8),
)
def test_order_and_seeds_do_not_depend_on_how_it_runs(xs, seed, in_flight):
    items = [{"x": x} for x in xs]
    with ThreadPoolExecutor(3) as threads:
        result = quietly(drawn, items, executor=threads, seed=seed, in_flight=in_flight)
    seeds = [item_seed(seed, i) for i in range(len(xs))]
    assert result.items == tuple(items)
    assert list(result.seeds) == seeds
    assert list(result.results) == [drawn(x, s) for x, s in zip(xs, seeds, strict=True)]
    assert len(set(seeds)) == len(seeds)


def test_processes_give_what_threads_give():
    items = grid(x=range(20))
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        results = [quietly(drawn, items, executor=e, seed=3) for e in (threads, processes, None)]
    assert results[0] == results[1] == results[2]
    assert quietly(drawn, items, seed=4).seeds != results[0].seeds


def test_failures_are_recorded_with_their_reason(tmp_path):
    items = grid(x=[0, 1, 2, 3, 4, -5, 9])
    path = tmp_path / "s.jsonl"
    result = quietly(fragile, items, path)
    assert result.failures == {
        2: "ValueError: two is too much",
        3: "SystemExit: leaving",
        4: "TypeError: a object is no plain data: give numbers, texts, arrays, or lists and"
        " dictionaries of them",
        5: "ValueError: math domain error",
    }
    np.testing.assert_array_equal(
        result.column("root"), [0.0, 1.0, np.nan, np.nan, np.nan, np.nan, 3.0]
    )
    assert result.results[2] is None
    assert quietly(fragile, items, path) == result


def test_columns_are_arrays_or_refused():
    items = grid(x=[1, 2, 3])
    with ThreadPoolExecutor(1) as threads:
        run = partial(quietly, items=items, executor=threads)
        rows = run(lambda x: {"v": [x, math.nan if x == 2 else x]} if x < 3 else 1 / 0)
        np.testing.assert_array_equal(rows.column("v"), [[1, 1], [2, np.nan], [np.nan, np.nan]])
        assert run(lambda x: 1 / 0).column("v").shape == (3,)
        with pytest.raises(SweepError, match="item 0: 'w' is missing"):
            rows.column("w")
        with pytest.raises(SweepError, match="item 0: the result is missing or is no number"):
            run(lambda x: "text").column()
        with pytest.raises(SweepError, match="another shape"):
            run(lambda x: [0] * x).column()


def test_an_executor_that_was_shut_down_is_told():
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(SweepError, match=r"broke down .*shutdown"):
        quietly(square, grid(x=range(3)), executor=pool)


@pytest.mark.parametrize(
    ("function", "items", "options", "culprit"),
    [
        (square, [{"y": 1}], {}, "item 0 does not fit the function: missing .*'x'"),
        (square, [{"x": 1}, {"x": 1, "y": 1}], {}, "item 1 does not fit"),
        (square, [{"x": 1, "seed": 1}], {}, "item 0 is .* without 'seed'"),
        (square, [3], {}, "item 0 is 3: give a dictionary"),
        (square, [], {"seed": -1}, "seed is -1"),
        (square, [], {"in_flight": 0}, "in_flight is 0"),
        (lambda x: x, [{"x": 1}], {}, "define it at the top level of a module"),
        (3, [{"x": 1}], {}, "3 shows no parameters: give a function"),
        (square, [{"x": P}], {"path": "s"}, "item 0 cannot be written to a file: a SlipParameters"),
        (partial(other, P), [{}], {"path": "s"}, "the function cannot be written to a file"),
    ],
)
def test_bad_input_is_named(tmp_path, monkeypatch, function, items, options, culprit):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SweepError, match=culprit):
        quietly(function, items, **options)
    assert not any(tmp_path.iterdir())


def test_no_items_give_no_results(tmp_path):
    for _ in range(2):
        result = quietly(square, [], tmp_path / "s.jsonl")
        assert result.items == result.results == ()
        assert result.column().shape == (0,)


def test_the_bar_is_on_stderr(capfd):
    sweep(fragile, grid(x=[1, 2, 9]), options=SweepOptions(label="roots"))
    out, error = capfd.readouterr()
    assert out == ""
    for text in ("roots", "3/3", "1 failed"):
        assert text in error


class Counting(ThreadPoolExecutor):
    """Counts the calls it has and has not finished."""

    def __init__(self):
        super().__init__(2)
        self.now = self.most = 0
        self.lock = threading.Lock()

    def _count(self, change):
        with self.lock:
            self.now += change
            self.most = max(self.most, self.now)

    def submit(self, *arguments, **keywords):
        self._count(1)
        future = super().submit(*arguments, **keywords)
        future.add_done_callback(lambda _: self._count(-1))
        return future


def test_no_more_items_than_asked_are_with_the_executor():
    with Counting() as pool:
        result = quietly(square, grid(x=range(500)), executor=pool, in_flight=7)
    assert 2 <= pool.most <= 7
    np.testing.assert_array_equal(result.column(), np.arange(500) ** 2)


def test_steps_of_the_template_in_processes():
    result = quietly(walking_step, grid(angle=[64.0, 66.0, 68.0], speed=[1.1, 40.0]))
    assert sorted(result.failures) == [1, 3, 5]  # no gait at 40 m/s
    assert all(reason.startswith("GaitError: ") for reason in result.failures.values())
    assert np.all(result.column("outcome")[::2] == Outcome.SECTION)
    assert np.max(result.column("error")[::2]) < 1e-9


def test_scenarios_in_processes():
    items = grid(speed=[1.1, 1.15], kind=["PAPER", "IMPROVED"])
    result = quietly(short_scenario, items)
    assert np.all(result.column("completed") == 1.0)
    assert np.all(result.column("speed")[2:] > result.column("speed")[:2])  # faster as asked
    assert list(result.results) == [to_jsonable(short_scenario(**item)) for item in items]


@pytest.mark.slow
def test_robot_runs_in_processes():
    items = grid(speed=[1.05, 1.1])
    result = quietly(robot_run, items)
    assert np.all(result.column("steps") == 2)
    assert not np.any(result.column("fell"))
    assert list(result.results) == [to_jsonable(robot_run(**item)) for item in items]
