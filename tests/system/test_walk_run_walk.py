"""Robots walk, run and walk on in PyBullet, within their motors' torques."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from places import EXAMPLES
from printed import EXAMPLE_ONE
from printed import go as go_as_printed

import template_control as tc
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import Scenario, Segment, load_scenario


def go(example, name, **options):
    """A robot's way through an example."""
    scenario = load_scenario(EXAMPLES / example)
    return tc.simulate(tc.Experiment(tc.load_robot(name), scenario, **options))


def strides(record):
    return record.kinds_of_stride[:-1]


def check(record):
    """Went to the end within its torques."""
    assert record.fall_reason == ""
    assert record.arrived
    assert record.solved.all()
    assert np.all(np.abs(record.torque) <= record.torque_limit)


def settled(record):
    """Walks as is wanted, after both transitions."""
    error = record.section_state[-5:] - record.section_target[-6:-1]
    assert np.all(np.abs(error[:, 0]) < 0.04), "of 1.1 m/s"
    assert np.all(np.abs(error[:, 1]) < 8e-3)


@pytest.mark.slow(seconds=4)
def test_five_link_walks_runs_at_three_metres_a_second_and_walks():
    """On ground that is more slippery than the default's, as a push's test has that."""
    ground, known = (
        tc.PlantOptions(friction=0.5),
        tc.EmbeddingOptions(qp=tc.QpOptions(friction=0.5)),
    )
    record = go("walk_run_walk.toml", "five-link", world=ground, controller=known)
    check(record)
    kinds = strides(record)
    runs = kinds.count("r")
    assert kinds == ["w"] * 8 + ["wr"] + ["r"] * runs + ["rw"] + ["w"] * 15
    assert runs > 25
    speed = record.section_state[:, 0]
    assert speed.max() == pytest.approx(3.0, abs=0.03)
    error = speed[1:] - record.section_target[:-1, 0]
    assert np.sqrt(np.mean(error**2)) < 0.06, "it keeps up with +-0.35 m/s^2"
    assert speed[9] == pytest.approx(1.3, abs=0.05), "the transition hits its first apex"
    share = record.summary.saturated_share
    assert share < 0.025
    assert record.section_trim[8] != 0.0
    assert record.section_trim[9] == 0.0, "the walk after the run stands up: it learns anew"
    settled(record)


# A slow run of a few strides between two walks; the pushes are of 0.1 s.
SHORT = Scenario(
    segments=(
        Segment("walk", speed=1.1, steps=7),
        Segment("run", speed=1.3, duration=1.0),
        Segment("walk", speed=1.1, steps=8),
    ),
    start=(1.1, 0.978, 0.0),
    map_kind=MapKind.EXACT,
)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(
    "pushes",
    [
        # In double stance and at the bottom of the stance, where the leg must become stiffer; and
        # in the stance from the run to the walk, after which a leg lands far ahead.
        (tc.Push(-15.0, 7, 1.0), tc.Push(-15.0, 11, 0.14)),
        (tc.Push(15.0, 7, 1.0), tc.Push(15.0, 11, 0.14)),
    ],
)
def test_five_link_holds_pushes_within_both_transitions(pushes):
    record = tc.simulate(tc.Experiment(tc.load_robot("five-link"), motion=SHORT, pushes=pushes))
    check(record)
    kinds = strides(record)
    for push, kind in zip(pushes, ("wr", "rw"), strict=True):
        assert kinds[push.step] == kind
        begin, end = record.section_time[push.step : push.step + 2]
        within = (record.time >= begin) & (record.time < end)
        assert np.any(record.push[within] != 0.0)
    assert np.all(np.abs(record.section_state[-3:, 1] - 0.978) < 0.03)
    assert np.all(np.abs(record.section_state[-3:, 0] - 1.1) < 0.2)


@pytest.mark.slow(seconds=4)
def test_five_link_holds_pushes_while_it_accelerates_and_decelerates():
    pushes = (tc.Push(-21.0, 14, 0.5), tc.Push(21.0, 34, 0.6))
    record = go("walk_run_walk.toml", "five-link", pushes=pushes)
    check(record)
    kinds = strides(record)
    assert {kinds[n] for push in pushes for n in (push.step, push.step + 10)} == {"r"}
    target, speed = record.section_target[:-1, 0], record.section_state[1:, 0]
    assert target[13] < target[14] < target[15]
    assert target[35] < target[34] < target[33]
    for push in pushes:
        assert np.max(np.abs(speed - target)[push.step : push.step + 2]) > 0.15
        # Ten strides on it is where the profile wants it.
        assert abs(speed[push.step + 10] - target[push.step + 10]) < 0.05
    settled(record)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("off", [1e-6, 1e-4])
def test_runner_goes_through_example_one_from_a_start_that_is_a_hair_off(off):
    # The first made a knee hit its stop, and fell; the other never came down from 2.7 m/s in time.
    scenario = load_scenario(EXAMPLES / "example_one.toml")
    speed, height, rise = scenario.start
    scenario = replace(scenario, start=(speed + off, height, rise))
    record = tc.simulate(tc.Experiment(tc.load_robot("runner"), scenario, record_every=5))
    check(record)
    error = record.section_state[1:, 0] - record.section_target[:-1, 0]
    assert np.sqrt(np.mean(error**2)) < 0.15


@pytest.mark.slow(seconds=6)
def test_runner_goes_through_example_one_as_its_template_does(tmp_path, monkeypatch):
    record = go_as_printed(EXAMPLE_ONE, tmp_path, monkeypatch)
    check(record)
    template = simulate_scenario(load_scenario(EXAMPLES / "example_one.toml"))
    assert template.completed
    kinds = Counter(strides(record))
    assert kinds["wr"] == kinds["rw"] == 1
    # The last segment's twenty steps, and those of the first 0.8 s.
    assert 21 <= kinds["w"] <= 23
    # And one from the last section on.
    assert record.kinds_of_stride[-22:] == ["rw", *["w"] * 21]
    speed = record.section_state[:, 0]
    assert speed.max() == pytest.approx(5.0, abs=0.05)
    error = speed[1:] - record.section_target[:-1, 0]
    assert np.sqrt(np.mean(error**2)) < 0.15
    settled(record)
