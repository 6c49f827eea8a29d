"""The family of walking gaits by speed: gaits, range, continuity, and how it is made."""

import json
from functools import partial
from importlib.resources import files

import numpy as np
import pinocchio as pin
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Context
from template_control.errors import GaitError
from template_control.robot.library import ROBOTS
from template_control.robot.template import walk_limits
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.gaits import family_search
from template_control.slip.gaits.family_search import (
    gait_figures,
    search_family,
)
from template_control.slip.gaits.gait import vlo_jacobians, without_push_off
from template_control.slip.gaits.walking_by_speed import (
    NATURAL,
    coordinates,
    gaits_by_speed,
    nearest_gait,
    walking_by_speed,
)
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.similarity import REFERENCE
from template_control.warm_up import ANNOUNCEMENT

FAMILY = walking_by_speed()
SPEEDS = np.round(np.arange(0.3, 1.46, 0.05), 2)
UNIT = np.sqrt(REFERENCE.gravity * REFERENCE.rest_length)


@pytest.fixture(scope="module")
def gaits():
    return [tc.gait_for_speed(REFERENCE, float(speed)) for speed in SPEEDS]


def test_every_gait_has_its_speed_and_returns(gaits):
    for speed, gait in zip(SPEEDS, gaits, strict=True):
        assert gait.mean_speed == pytest.approx(speed, abs=1e-8)
        for stride in ("w", "wp"):
            end, outcome = ReturnMap(gait.parameters, stride).step(gait.vlo, gait.controls)
            assert outcome is Outcome.SECTION
            np.testing.assert_allclose(end, gait.vlo, atol=1e-8)


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_s_template_has_the_same_gaits(name):
    p = tc.template_for(tc.load_robot(name))
    low, high = FAMILY.range(p)
    unit = np.sqrt(p.gravity * p.rest_length)
    for speed in (low, 0.5 * (low + high), high):
        gait = tc.gait_for_speed(p, speed)
        assert gait.mean_speed == pytest.approx(speed, abs=1e-8)
        twin = gaits_by_speed(REFERENCE).gait(gait.vlo[0] * UNIT / unit)
        np.testing.assert_allclose(coordinates(gait), coordinates(twin), atol=1e-8)


def test_the_range_is_told_and_the_rest_refused():
    low, high = FAMILY.range(REFERENCE)
    assert low <= 0.25
    assert high >= 1.45
    for speed in (low - 0.01, high + 0.01):
        with pytest.raises(GaitError, match=f"from {low:.2f} to {high:.2f} m/s"):
            tc.gait_for_speed(REFERENCE, speed)


def test_each_chain_is_continuous_in_speed():
    for chain in FAMILY.chains:
        assert np.all(np.diff(chain.mean_speed) > 0.0)
        columns = (np.log(chain.stiffness), chain.touchdown_angle, chain.height)
        links = np.diff(np.column_stack(columns), axis=0) / NATURAL
        assert np.max(np.abs(links)) < 0.6
        assert np.max(np.abs(np.diff(links, axis=0))) < 0.3
        # A gait between two knots is next to the interpolation: no branch is left on the way.
        for a, b in zip(chain.vlo_speed[:-1:6], chain.vlo_speed[1::6], strict=False):
            middle = 0.5 * (a + b)
            gait = chain.gait(REFERENCE, middle * UNIT)
            off = (coordinates(gait) - chain._curve(middle)) / NATURAL
            assert np.max(np.abs(off)) < 0.05


def test_the_chains_overlap():
    slow, fast = FAMILY.chains
    assert fast.mean_speed[0] < slow.mean_speed[-1]
    assert slow.mean_speed[0] < FAMILY.limits[1] < fast.mean_speed[-1]


def test_push_off_reaches_what_three_controls_do_not(gaits):
    """Of all gaits the rank is 3 instead of 2, and most settle much faster."""
    three, four = [], []
    for gait in gaits:
        small = np.linalg.svd(vlo_jacobians(without_push_off(gait))[1])[1][2]
        assert small < 1e-7
        assert np.linalg.svd(vlo_jacobians(gait)[1])[1][2] > 1e-4
        figures = gait_figures(gait)
        three.append(figures.without)
        four.append(figures.closed)
    assert np.all(np.array(four) < np.array(three))
    assert np.median(four) < 0.7
    assert np.median(three) > np.median(four) + 0.1


def test_the_planner_follows_the_family(gaits):
    planner = LqrPlanner(gaits[10])
    decision = planner.decide(Context(gaits[10].vlo, gaits[11].vlo))
    assert decision.nominal
    assert planner.gait.vlo[0] == pytest.approx(gaits[11].vlo[0])
    assert planner.gait.mean_speed == pytest.approx(SPEEDS[11], abs=1e-6)
    planner.reset()
    assert planner.gait is gaits[10]


def test_the_nearest_gait_is_one_and_near(gaits):
    gait = gaits[12]
    guess = coordinates(gait) + 0.1 * NATURAL
    found = nearest_gait(REFERENCE, float(gait.vlo[0]), guess)
    assert np.max(np.abs(coordinates(found) - guess) / NATURAL) < 0.25
    with pytest.raises(GaitError, match="no symmetric gait"):
        nearest_gait(REFERENCE, 3.0, guess)


def test_the_command_writes_what_the_library_reads(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(family_search, "_SLOW", family_search._FAST[5:7])
    monkeypatch.setattr(family_search, "_FAST", family_search._FAST[6:8])
    quick = partial(search_family, spacing=0.09, settling=1)
    monkeypatch.setattr("template_control.cli.gaits.search_family", quick)
    assert main(["gaits", "--family", "--output", str(tmp_path)]) == 0
    assert "largest eigenvalues" in capsys.readouterr().out
    made = json.loads((tmp_path / "walking.json").read_text())
    assert (tmp_path / "by_speed.png").exists()
    place = files("template_control.slip.gaits").joinpath("walking.json")
    shipped = json.loads(place.read_text())
    assert made.keys() == shipped.keys()
    assert [c.keys() for c in made["chains"]] == [c.keys() for c in shipped["chains"]]


@pytest.mark.slow(seconds=4)
def test_the_library_s_family_is_what_the_search_makes():
    made = map(family_search.chain_of, search_family())
    for new, shipped in zip(made, FAMILY.chains, strict=True):
        for name in ("vlo_speed", "stiffness", "touchdown_angle", "height", "mean_speed"):
            np.testing.assert_allclose(getattr(new, name), getattr(shipped, name), rtol=1e-7)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(
    # Near the gap of the family what human adds to a step costs 9 mm of height.
    ("name", "speed", "height"),
    [("human", 0.4, 0.01), ("rabbit", 0.62, 0.003)],
)
def test_robots_walk_where_they_could_not(name, speed, height):
    robot = tc.load_robot(name)
    gait = tc.gait_for_speed(tc.template_for(robot), speed)
    record = tc.simulate(tc.Experiment(robot, planner=LqrPlanner(gait), steps=30, record_every=5))
    assert (record.steps, record.fell) == (30, False)
    last = record.section_state[-10:].mean(axis=0) - gait.vlo
    assert np.all(np.abs(last) < [0.02, height, 0.04])


def test_a_robot_s_range_is_its_own_and_the_rest_is_refused(capsys, tmp_path):
    rabbit = tc.load_robot("rabbit")
    low, high = tc.walking_speeds(rabbit)
    template = FAMILY.range(tc.template_for(rabbit))
    assert template[0] < low < 0.62 < 0.9 < high < template[1]  # heavy legs, weak hips
    for speed in (low - 0.01, high + 0.01):
        with pytest.raises(GaitError, match=f"give one from {low:.2f} to {high:.2f} m/s"):
            tc.robot_gait_for_speed(rabbit, speed)
    for speed in (low, high):
        assert tc.robot_gait_for_speed(rabbit, speed).mean_speed == pytest.approx(speed, abs=1e-8)
    assert main(["walk", "--robot", "rabbit", "--speed", "1.1", "--output", str(tmp_path)]) == 2
    *before, line = capsys.readouterr().err.splitlines()
    assert line.endswith(f"give one from {low:.2f} to {high:.2f} m/s")
    assert set(before) <= {ANNOUNCEMENT}


def test_light_legs_walk_at_all_speeds_and_weak_hips_at_fewer():
    robot = tc.load_robot("five-link")
    whole = tc.walking_speeds(robot)
    assert whole == (0.30, 1.45)
    slowest, fastest = tc.walking_speeds(robot, 0.9)
    assert slowest == whole[0]
    assert fastest < whole[1]
    with pytest.raises(GaitError, match="five-link walks at no speed"):
        tc.walking_speeds(robot, 0.001)


def test_a_swing_takes_as_long_as_hips_and_legs_need():
    """A straight leg goes through a radian along a quintic, with 10 / sqrt(3) rad/T^2 at most."""
    names = ("bolt", "runner", "five-link", "human", "rabbit")
    swings = [walk_limits(tc.load_robot(name)).swing for name in names]
    assert swings == sorted(swings)
    robot = tc.load_robot("human")
    pin.crba(robot.model, data := robot.model.createData(), robot.neutral())
    inertia, torque = data.M[3, 3], robot.torque_limit[0]
    assert swings[3] == pytest.approx(np.sqrt(10.0 / np.sqrt(3.0) * inertia / torque))


ENDS = [("bolt", 0), ("rabbit", 0), ("rabbit", 1), ("human", 1)]


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("name", "end"), ENDS)
def test_robots_walk_at_the_ends_of_their_ranges(name, end):
    robot = tc.load_robot(name)
    speed = tc.walking_speeds(robot)[end]
    gait = tc.robot_gait_for_speed(robot, speed)
    record = tc.simulate(tc.Experiment(robot, planner=LqrPlanner(gait), steps=20, record_every=5))
    assert (record.steps, record.fell) == (20, False)
    last = record.section_state[-8:].mean(axis=0) - gait.vlo
    unit = gait.parameters.speed_unit / tc.SlipParameters().speed_unit
    assert np.all(np.abs(last) < [0.02 * unit, 0.01 * gait.parameters.rest_length, 0.03 * unit])


@pytest.mark.parametrize("name", ["human", "rabbit", "bolt", "five-link"])
def test_what_is_told_is_accepted_and_the_rest_refused(name):
    robot = tc.load_robot(name)
    slowest, fastest = tc.walking_speeds(robot)
    for speed in np.linspace(slowest, fastest, 4):
        gait = tc.robot_gait_for_speed(robot, float(speed))
        assert gait.mean_speed == pytest.approx(speed, abs=1e-8)
    for speed in (slowest - 0.01, fastest + 0.01):
        with pytest.raises(GaitError, match=f"from {slowest:.2f} to {fastest:.2f} m/s"):
            tc.robot_gait_for_speed(robot, speed)
