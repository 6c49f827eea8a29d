"""What a user gives is checked when it is given: types, ranges and shapes."""

import pydoc
from dataclasses import dataclass, fields, is_dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pytest

import template_control as tc
from template_control import embedding, estimation, run, slip, sweep, whole_body
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import (
    Array,
    Count,
    Interval,
    NotNegative,
    Positive,
    Range,
    Shape,
)
from template_control.embedding.planners.transition import TransitionOptions
from template_control.errors import ParameterError, RobotError, ScenarioError, SweepError
from template_control.robot.start import Pose
from template_control.slip.automaton.automaton import AUTOMATON


@dataclass(frozen=True)
class Sample(Checked):
    count: Count = 1
    size: Positive = 1.0
    several: tuple[NotNegative, ...] = ()
    both: Interval = (0.0, 1.0)
    word: Literal["a", "b"] = "a"
    switch: bool = True
    inner: tc.Push | None = None
    plane: Annotated[Array, Shape((2, 2))] | None = None
    bound: Annotated[float, Range(0.0, endless=True)] = np.inf


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"count": 2.5}, "Sample.count is 2.5: give a whole number from 1 to 1000000"),
        ({"count": True}, "whole number"),
        ({"size": 0}, "Sample.size is 0: give a positive number"),
        ({"size": "1"}, "is '1': give a positive number"),
        ({"size": np.nan}, "is nan"),
        ({"size": 10**400}, "positive number"),
        ({"several": 3}, "give a tuple"),
        ({"several": [1.0, -1.0]}, "each a number from 0 up"),
        ({"several": "12"}, "give a tuple"),
        ({"both": (1.0, 0.0)}, "the smaller one first"),
        ({"both": (1.0,)}, "2 times a finite number"),
        ({"word": "c"}, "give one of 'a', 'b'"),
        ({"switch": 1}, "give True or False"),
        ({"inner": {"impulse": 1.0}}, "give a Push or None"),
        ({"plane": np.zeros(4)}, "an array of 2 by 2 finite numbers"),
        ({"plane": np.full((2, 2), np.nan)}, "an array of 2 by 2 finite numbers"),
        ({"bound": -np.inf}, "bound is -inf"),
    ],
)
def test_what_does_not_fit_is_named_with_what_would(wrong, words):
    with pytest.raises(ParameterError) as caught:
        Sample(**wrong)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_arrays_and_numpy_s_numbers_are_welcome():
    made = Sample(
        count=np.int64(3), size=np.float32(0.5), several=np.array([1.0, 2.0]), both=[0, 2],
        switch=np.bool_(False), plane=[[1, 2], [3, 4]],
    )  # fmt: skip
    assert made.several == (1.0, 2.0)
    assert made.both == (0.0, 2.0)
    assert [type(x) for x in (made.count, made.size, made.switch)] == [int, float, bool]
    assert made.plane.dtype == np.float64


def test_a_function_checks_its_arguments():
    @checked
    def twice(x: Positive, other: Count = 1, *, named: float = 0.0) -> Any:
        return 2 * x, other, named

    assert twice(np.float64(2.0), 1, named=0) == (4.0, 1, 0.0)
    for wrong, word in (((-1,), "twice: x is -1"), ((1, 0), "other is 0")):
        with pytest.raises(ParameterError, match=word):
            twice(*wrong)
    with pytest.raises(ParameterError, match="twice: named is 'b'"):
        twice(1.0, named="b")
    with pytest.raises(TypeError, match="takes from 1 to 2 positional arguments but 3"):
        twice(1.0, 2, 3)
    with pytest.raises(TypeError, match="unexpected keyword argument 'more'"):
        twice(1.0, more=3)
    with pytest.raises(TypeError, match=r"twice\(\) missing 1 required"):
        twice()


OPTIONS = [
    tc.EmbeddingOptions, tc.IdealOptions, tc.LqrOptions, tc.PlantOptions, tc.SensorOptions,
    tc.Experiment, tc.SlipParameters, embedding.GuardOptions, embedding.LeanOptions,
    estimation.FrictionOptions,
    embedding.AheadOptions,
    embedding.ModifiedOptions, embedding.ReplanOptions,
    embedding.RunningOptions, TransitionOptions, run.GaitSpec,
    embedding.SwingOptions, run.FallOptions,
    sweep.SweepOptions, whole_body.ComTask, whole_body.FootTask, whole_body.MomentumTask,
    whole_body.PostureTask, whole_body.QpOptions,
]  # fmt: skip


@pytest.mark.parametrize("kind", OPTIONS, ids=lambda kind: kind.__name__)
def test_no_field_of_any_options_takes_a_stranger(kind):
    assert is_dataclass(kind)
    for field in fields(kind):
        for wrong in (object(), np.nan, -1e9j, b"x", [object()]):
            with pytest.raises((ParameterError, SweepError), match=field.name):
                kind(**{field.name: wrong})


@pytest.mark.parametrize(
    "make",
    [
        lambda: whole_body.QpOptions(torque_scale=-1),
        lambda: whole_body.QpOptions(torque_scale=np.nan),
        lambda: whole_body.QpOptions(friction=np.nan),
        lambda: tc.PlantOptions(friction=np.nan),
        lambda: tc.Push(impulse=np.nan),
        lambda: tc.Experiment(steps=50, pushes=(tc.Push(1.0, step=99),)),
        lambda: tc.Experiment(steps=10, pushes=(tc.Push(1.0),)),
        lambda: tc.Experiment(steps=2.5),
        lambda: tc.Experiment(pushes=tc.Push(1.0)),
        lambda: tc.simulate("five-link"),
        lambda: tc.LqrPlanner(tc.SlipParameters()),
        lambda: tc.RunningPlanner(tc.gait_at(tc.SlipParameters(), np.radians(66.0), 1.1)),
        lambda: embedding.Lean((2.0, 1.0), (0.3, 0.3)),
        lambda: embedding.Lean((2.0,), ()),
        lambda: TransitionOptions(base=(12.2,)),
        lambda: run.GaitSpec("jump"),
        lambda: slip.running_gait(tc.SlipParameters(), 3.0, leg_stiffness=-1.0),
        lambda: tc.ScenarioRoute(slip.Scenario((slip.Segment("walk", speed=1.1, steps=1),)), 0.98),
        lambda: tc.gait_at(None, 1.1, 1.1),
        lambda: tc.load_robot(3),
        lambda: tc.ReturnMap("w"),
        lambda: tc.simulate_stride(tc.SlipParameters(), "nowhere", [0, 1, 1, 0], np.ones(5)),
    ],
)
def test_what_was_taken_or_gave_a_traceback_is_refused(make):
    with pytest.raises(ParameterError) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_each_room_has_its_own_error():
    with pytest.raises(RobotError, match=r"Link\.mass is 'x'"):
        tc.Link(1.0, "x", 1.0, 1.0)
    with pytest.raises(ScenarioError, match=r"Segment\.steps is 2\.5"):
        slip.Segment("walk", speed=1.1, steps=2.5)


def test_a_push_after_the_last_of_the_steps_that_nobody_gave(robot, default_gait):
    with pytest.raises(ParameterError, match="step 50, and the run has steps 0 to 49"):
        tc.simulate(
            tc.Experiment(
                robot, planner=tc.LqrPlanner(default_gait), pushes=(tc.Push(1.0, step=50),)
            )
        )


def test_an_array_is_a_start_and_the_run_is_kept(robot, default_gait, tmp_path):
    record = tc.simulate(
        tc.Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=1, start=default_gait.vlo)
    )
    assert record.options["start"] == default_gait.vlo.tolist()
    assert tc.Record.load(record.save(tmp_path / "run.npz")).steps == 1


class Unspeakable(embedding.SwingOptions):
    """Options that cannot be copied, nor shown."""

    def __deepcopy__(self, memo):
        raise RuntimeError("no copy")

    def __repr__(self):
        raise RuntimeError("no text")


def test_nothing_that_cannot_be_written_down_loses_a_run(robot, default_gait):
    options = tc.EmbeddingOptions(swing=Unspeakable())
    record = tc.simulate(
        tc.Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=1, controller=options)
    )
    assert record.options["embedding"]["swing"]["clearance"] == 0.05


def test_a_repr_has_what_is_not_as_by_default():
    options = tc.EmbeddingOptions(trunk_pitch=0.1, tasks={"com": {"gains": (80.0, 18.0)}})
    assert repr(tc.EmbeddingOptions()) == "EmbeddingOptions()"
    assert repr(options) == (
        "EmbeddingOptions(trunk_pitch=0.1, tasks={'com': {'gains': (80.0, 18.0)}})"
    )
    strong = tc.EmbeddingOptions(qp=whole_body.QpOptions(torque_scale=2.0))
    assert repr(strong) == "EmbeddingOptions(qp=QpOptions(torque_scale=2.0))"
    assert repr(tc.Push(5.0, 2)) == "Push(impulse=5.0, step=2)"
    assert repr(tc.Experiment()) == "Experiment()"


def test_options_with_arrays_can_be_compared():
    def pose(height):
        return Pose([0.0, height], [1.0, 0.0], np.zeros((2, 2)), np.zeros((2, 2)))

    assert pose(0.9) == pose(0.9)
    assert pose(0.9) != pose(0.8)
    assert tc.Experiment(pose=pose(0.9)) == tc.Experiment(pose=pose(0.9))
    assert pose(0.9) != 0.9


@pytest.mark.parametrize("thing", [tc.simulate, tc.load_record, tc.save_figures])
def test_help_fits_a_screen(thing):
    text = pydoc.plain(pydoc.render_doc(thing))
    assert len(text.splitlines()) <= 40
    assert len(text) <= 3000


@pytest.mark.parametrize(
    "thing",
    [
        tc.EmbeddingOptions(),
        tc.EmbeddingOptions.of_kind("free"),
        tc.Experiment().resolved(),
        AUTOMATON,
    ],
    ids=lambda thing: type(thing).__name__,
)
def test_a_repr_fits_a_few_lines(thing):
    assert len(repr(thing)) <= 240
