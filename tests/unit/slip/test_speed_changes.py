"""The table of changes of speed: what it holds, and the search that makes it."""

import json
from dataclasses import replace
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Outcome
from template_control.slip.maps.return_map import LANDING_TIME, LIFTED_TIME, REAR_BOTTOM, ReturnMap
from template_control.slip.planning import change_search
from template_control.slip.planning.change_search import SPEEDS, search_changes
from template_control.slip.planning.gait_table import (
    CONTROL,
    SLOTS,
    STATE,
    STATE_TOLERANCE,
    gait_table,
    row_at,
)
from template_control.slip.planning.plan_costs import DEFECT, KNEE_STRAIGHT
from template_control.slip.planning.speed_changes import speed_changes

P = tc.SlipParameters()
KNEES = 320.0  # [N m]
SWING = 0.16  # [s]


def whole(changes):
    """Changes from one gait to another one; the others are their rests."""
    gaits = np.array([row_at(gait_table(P), speed)[STATE:CONTROL] for speed in SPEEDS])
    return [c for c in changes.rest if np.min(np.max(np.abs(c.states[0] - gaits), axis=1)) < 1e-4]


def stride(change, i):
    """Result of a step on the template, and the stiffnesses."""
    u = np.zeros(NUM_SLOTS)
    u[SLOTS] = change.controls[i] * [1.0, *[change.stiffness[i]] * 3]
    result, outcome = ReturnMap(P, "wp").evaluate(change.states[i], u)
    assert outcome is Outcome.SECTION
    return result, u[SLOTS[1:]]


def test_there_is_a_change_between_any_two_of_the_gaits():
    ends = {(round(c.states[0, 0], 3), round(c.states[-1, 0], 3)) for c in whole(speed_changes(P))}
    assert ends >= {(a, b) for a in SPEEDS for b in SPEEDS if a != b and b > 0.3}
    assert min(speed for _, speed in ends) > 0.3, "slower gaits are rough"


def test_the_steps_are_those_of_the_template_and_its_gaits():
    table = gait_table(P)
    for change in whole(speed_changes(P)):
        for i in range(len(change.controls)):
            end = stride(change, i)[0][:3]
            assert np.all(np.abs(end - change.states[i + 1]) < 0.1 * DEFECT)
        for state in change.states[[0, -1]]:
            gait = row_at(table, state[0])[STATE:CONTROL]
            assert np.all(np.abs(state - gait) < 0.1 * STATE_TOLERANCE)


def test_knees_bear_all_steps():
    def moment(kappa, length):
        force = kappa * (P.rest_length - length)
        return 0.5 * force * np.sqrt(KNEE_STRAIGHT**2 - length**2)

    for change in whole(speed_changes(P)):
        for i in range(len(change.controls)):
            result, (first, second, push) = stride(change, i)
            rear, front, touchdown = result[REAR_BOTTOM:LANDING_TIME]
            assert moment(push, rear) < 1.02 * KNEES
            assert moment(max(first, second), front) < 1.02 * KNEES
            assert moment(max(first, push), touchdown) < 1.02 * KNEES
            assert moment(first, change.states[i, 1]) < 1.02 * KNEES
            assert moment(second, result[1]) < 1.02 * KNEES


def test_all_swings_have_their_time():
    for change in whole(speed_changes(P)):
        times = [
            stride(change, i)[0][[LANDING_TIME, LIFTED_TIME]] for i in range(len(change.controls))
        ]
        for (_, lifted), (landing, _) in pairwise(times):
            assert lifted + landing > 0.99 * SWING


def test_the_nearest_and_shortest_come_first():
    changes = speed_changes(P)
    for change in whole(changes)[::17]:
        first = next(changes.towards(change.states[0], change.states[-1, 0], 1))
        assert len(first.controls) <= len(change.controls)
        assert np.all(np.abs(first.states[0] - change.states[0]) < 2.0 * STATE_TOLERANCE)
        assert abs(first.states[-1, 0] - change.states[-1, 0]) < 0.1
    assert len(list(changes.towards(changes.start[0], 0.9, 3))) == 3


def test_they_scale_with_the_template():
    small = replace(P, mass=10.0, rest_length=0.3, leg_stiffness=P.leg_stiffness / 2.4)
    unit = np.array([np.sqrt(0.3), 0.3, np.sqrt(0.3)])
    for ours, theirs in zip(speed_changes(small).rest, speed_changes(P).rest, strict=True):
        np.testing.assert_allclose(ours.states, theirs.states * unit)
        np.testing.assert_allclose(ours.stiffness, theirs.stiffness / 2.4)


@pytest.mark.slow(seconds=1)
def test_the_command_writes_what_the_library_reads(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(change_search, "SPEEDS", (0.8, 0.9, 1.0))
    monkeypatch.setattr(change_search, "_TRIES", 3)
    assert main(["gaits", "--changes", "--output", str(tmp_path)]) == 0
    assert "steps" in capsys.readouterr().out
    made = json.loads((tmp_path / "speed_changes.json").read_text())
    place = files("template_control.slip.planning").joinpath("speed_changes.json")
    shipped = json.loads(place.read_text())
    assert made.keys() == shipped.keys()
    assert made["changes"][0].keys() == shipped["changes"][0].keys()
    assert len(made["changes"]) == 6


def test_the_search_takes_few_steps_for_a_small_change():
    found = search_changes((0.8, 0.9))
    assert {ends: len(change.controls) for ends, (_, change) in found.items()} == {
        (0.8, 0.9): pytest.approx(2, abs=1),
        (0.9, 0.8): pytest.approx(2, abs=1),
    }
