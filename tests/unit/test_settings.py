"""Options as TOML: what goes out comes back, and a mistake is named by its key."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as drawing
from hypothesis import strategies as st

import template_control as tc
from template_control import settings
from template_control.embedding.options import KINDS
from template_control.embedding.phases import PHASES
from template_control.errors import ParameterError
from template_control.robot.start import Pose
from template_control.slip.gaits.gait import Gait
from template_control.slip.scenario.scenario import Scenario


@dataclass(frozen=True)
class Round:
    kind: ClassVar[str] = "round"
    radius: float = 1.0


@dataclass(frozen=True)
class Square:
    kind: ClassVar[str] = "square"
    side: float = 2.0
    name: str = "q"


@dataclass(frozen=True)
class Everything:
    number: float
    count: int = 3
    yes: bool = False
    text: str = ""
    choice: Literal["a", "b"] = "a"
    pair: tuple[float, int] = (0.5, 2)
    several: tuple[Square, ...] = ()
    nested: tuple[tuple[float, float], ...] = ((1.0, 2.0),)
    shape: Round | Square = field(default_factory=Round)
    maybe: Square | None = None
    which: tc.MapKind = tc.MapKind.EXACT
    angles: Mapping[str, float] = field(default_factory=dict)


FINITE = st.floats(allow_nan=False)
SQUARES = st.builds(Square, FINITE, st.text())
ANYTHING = st.builds(
    Everything,
    number=FINITE,
    count=st.integers(-(2**62), 2**62),
    yes=st.booleans(),
    text=st.text(),
    choice=st.sampled_from("ab"),
    pair=st.tuples(FINITE, st.integers(-9, 9)),
    several=st.lists(SQUARES, max_size=3).map(tuple),
    nested=st.lists(st.tuples(FINITE, FINITE), max_size=3).map(tuple),
    shape=st.one_of(st.builds(Round, FINITE), SQUARES),
    maybe=st.one_of(st.none(), SQUARES),
    which=st.sampled_from(tc.MapKind),
    angles=st.dictionaries(st.text(), FINITE, max_size=3),
)


@drawing(max_examples=100, derandomize=True, deadline=None)
@given(ANYTHING)
def test_what_goes_out_comes_back_bit_by_bit(options):
    table = tomllib.loads(settings.text(settings.to_table(options)))
    assert settings.from_table(Everything, table) == options


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "number = 1\nnumbr = 2",
            r"unknown key numbr \(did you mean number\?\): known are number, count,",
        ),
        ("number = '1'", "number is '1': give a number"),
        ("number = true", "number is True: give a number"),
        ("count = 2.0", "count is 2.0: give a whole number"),
        ("yes = 1", "yes is 1: give true or false"),
        ("text = 1", "text is 1: give a text in quotes"),
        ("choice = 'c'", "choice is 'c': give one of a, b"),
        ("pair = [1]", "pair has 1 entries: give 2"),
        ("pair = [1.0, 1.0]", r"pair\[1\] is 1.0: give a whole number"),
        ("pair = 1", "pair is 1: give a list"),
        ("[[several]]\nside = 1\n[[several]]\nedge = 1", r"unknown key several\[1\].edge: known"),
        ("[shape]\nkind = 'flat'", "shape.kind is 'flat': give one of round, square"),
        ("[shape]\nside = 1", "unknown key shape.side: known are radius"),
        ("shape = 1", "shape is 1: give a table"),
        ("maybe = 1", "maybe is 1: give a table"),
        ("which = 'best'", "which is 'best': give one of exact, paper, improved, geyer"),
        ("angles = [1]", r"angles is \[1\]: give a table"),
        ("angles.knee = 'bent'", "angles.knee is 'bent': give a number"),
        ("count = 1", "the table has no number: give one"),
        ("number = ", "is no TOML"),
    ],
)
def test_a_mistake_is_told_with_file_and_key(text, told, tmp_path):
    path = tmp_path / "options.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=told) as caught:
        settings.read(Everything, path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value).replace(str(path), "")


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(ParameterError, match=r"cannot read .*none.toml"):
        settings.read(Everything, tmp_path / "none.toml")


ROUND_TRIPS = {
    "simulation": tc.Experiment(
        steps=17,
        world=tc.IdealOptions(mass_scale=1.1),
        controller=tc.EmbeddingOptions(qp=tc.QpOptions(friction=0.123456789012345)),
        start=(1.1, 0.97, -0.0),
        pushes=(tc.Push(10.0), tc.Push(-3.0, 4, 0.5)),
        sensors=tc.SensorOptions(1e-3, 2e-2, 5, 0.02),
        delay=0.003,
    ),
    "ground": tc.Experiment(world=tc.PlantOptions(terrain=tc.Terrain.step(0.01, 2.0))),
    "lqr": tc.LqrOptions(offset_gain=0.1),
    "scenario": tc.example_one(),
}


@pytest.mark.parametrize("name", ROUND_TRIPS)
def test_the_librarys_options_come_back(name):
    options = ROUND_TRIPS[name]
    table = tomllib.loads(settings.text(settings.to_table(options)))
    assert settings.from_table(type(options), table) == options


def test_a_pose_comes_back():
    pose = Pose(np.array([0.0, 1.02]), np.zeros(2), np.eye(2), np.full((2, 2), 1 / 3), rear=1)
    back = settings.from_table(Pose, tomllib.loads(settings.text(settings.to_table(pose))))
    for name, value in vars(pose).items():
        np.testing.assert_array_equal(getattr(back, name), value)


def test_a_class_that_refuses_a_value_is_heard(tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_text("segments = []")
    with pytest.raises(ParameterError, match=r"scenario.toml: the scenario has no segments"):
        settings.read(Scenario, path)


def test_what_toml_cannot_say_is_refused_unless_it_is_the_default():
    assert "phases" not in settings.to_table(tc.EmbeddingOptions())
    other = {**PHASES, "SS_sc^hop": next(iter(PHASES.values()))}
    with pytest.raises(ParameterError, match=r"controller.phases is dict, which TOML cannot say"):
        settings.to_table(replace(tc.Experiment(), controller=tc.EmbeddingOptions(phases=other)))
    with pytest.raises(ParameterError, match="phases can be given in Python only"):
        settings.from_table(tc.EmbeddingOptions, {"phases": {}})


def test_a_gait_of_ones_own_is_given_in_python_only():
    gait = Gait("hop", tc.SlipParameters(), np.array([0.0, 1.02]), np.zeros(6), 0.0, 0.5, "hop")
    with pytest.raises(ParameterError, match="motion is Gait, which TOML cannot say"):
        settings.to_table(tc.Experiment(motion=gait))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", [{}, {"noise_filter": None, "swing": None, "catches": True}])
def test_options_of_a_kind_of_robot_come_back(kind, changes):
    options = tc.EmbeddingOptions.of_kind(kind, **changes)
    table = tomllib.loads(settings.text(settings.to_table(options)))
    assert settings.from_table(tc.EmbeddingOptions, table) == options


def test_a_table_of_a_kind_has_what_differs_from_it():
    usual = tc.EmbeddingOptions.of_kind("soles")
    table = {"kind": "soles", "lateral": {"reach": 0.3}, "qp": {"friction": 0.5}}
    found = settings.from_table(tc.EmbeddingOptions, table)
    assert found.lateral == replace(usual.lateral, reach=0.3)
    assert found.qp == replace(usual.qp, friction=0.5)
    assert replace(found, lateral=usual.lateral, qp=usual.qp) == usual
    assert settings.from_table(tc.EmbeddingOptions, {"kind": "free", "noise_filter": "none"}) == (
        tc.EmbeddingOptions.of_kind("free", noise_filter=None)
    )


def test_another_kind_keeps_what_was_set():
    options = tc.EmbeddingOptions(trunk_pitch=0.1, qp=tc.QpOptions(friction=0.5))
    found = settings.changed(options, {"kind": "trot", "lateral.reach": 0.3})
    usual = tc.EmbeddingOptions.of_kind("trot")
    assert found == replace(
        usual, trunk_pitch=0.1, qp=options.qp, lateral=replace(usual.lateral, reach=0.3)
    )


def test_keys_that_went_to_a_table_of_their_own_are_read_where_they_were():
    text = "kind = 'free'\nfriction = 0.5\nstep_width = 0.3\nqp.torque_scale = 0.9"
    usual = tc.EmbeddingOptions.of_kind("free")
    found = settings.from_table(tc.EmbeddingOptions, tomllib.loads(text))
    assert found.qp == replace(usual.qp, friction=0.5, torque_scale=0.9)
    assert found.lateral == replace(usual.lateral, step_width=0.3)
    keys = {"friction": 0.4, "qp.speed_share": 0.8, "stop_share": 0.1}
    changed = settings.changed(found, keys)
    assert changed.qp == replace(found.qp, friction=0.4, speed_share=0.8, stop_share=0.1)
    with pytest.raises(ParameterError, match=r"friction is given by two keys: give qp.friction"):
        settings.changed(found, {"friction": 0.4, "qp.friction": 0.4})
    with pytest.raises(ParameterError, match=r"^qp.friction is -1"):
        settings.changed(found, {"friction": -1.0})


def test_an_unknown_kind_is_one_line():
    with pytest.raises(ParameterError, match=r"kind is 'hexapod': give one of planar, free, soles"):
        tc.Experiment().with_({"controller.kind": "hexapod"})
